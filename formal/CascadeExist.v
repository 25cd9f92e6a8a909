(** From all initial states the cascade has a motion: positions obey a linear equation that is driven by what dies. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Checker Flow Slide Solution Exist Weighted AgentCertificate AgentForms AgentMotion AgentEnd
  CascadeCertificate CascadeMotion.
Open Scope R_scope.

Section Exists.
Variables (c : cascade) (h : nat -> R) (begin : nat -> nat -> R).
Let a := team c.
Let G := graph a.
Let N := order G.
Let T := deadline G.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis Ha : 0 < alpha c.
Hypothesis Hin : forall e, In e (edges G) -> (tgt e < N)%nat /\ (src e < N)%nat.
Let first j := if (j <? N)%nat then begin 0%nat j - h j else 0.
Let lag0 j := if (j <? N)%nat then begin 1%nat j + eta a 0 * lp c first j else 0.
Let dies t := exp (- (alpha c * turns a t)).
Let flow t (x : nat -> R) j := dies t * lag0 j - eta a t * lp c x j.
Let HT : 0 < T := proj1 (T_k a Hprot).
Lemma dies_derive t : t < T -> is_derive dies t (- (alpha c * eta a t) * dies t).
Proof.
  intros Ht. apply (is_derive_ext (fun t => exp (- alpha c * turns a t))); [intros; unfold dies; f_equal; ring|].
  evar_last; [apply (decays_derive c Hprot _ _ Ht)|]. unfold dies. fold a. replace (- (alpha c * turns a t)) with (- alpha c * turns a t) by ring. ring.
Qed.
Theorem launch : exists X S, tracks c h X S /\ forall i j, (i < 2)%nat -> (j < N)%nat -> X 0 i j = begin i j.
Proof.
  destruct (lap_lipschitz (edges G)) as [K [HK [Z L]]].
  assert (Bounds : forall v, 0 <= v < T -> exists M, 0 <= M /\ forall t i, 0 <= t <= v -> Rabs (flow t first i) <= M /\
    forall x y d, (forall j, Rabs (x j - y j) <= d) -> Rabs (flow t x i - flow t y i) <= M * d).
  { intros v Hv. pose proof (eta_pos a Hprot Hgain v (proj2 Hv)) as Ev.
    set (D := total N first). set (Q := total N lag0). assert (D0 : 0 <= D) by apply total_pos. assert (Q0 : 0 <= Q) by apply total_pos.
    assert (EK : 0 <= eta a v * K) by (apply Rmult_le_pos; lra). assert (EKD : 0 <= eta a v * K * D) by (apply Rmult_le_pos; lra).
    exists (Q + eta a v * K * D + eta a v * K). split; [lra|]. intros t i Ht.
    assert (Et : 0 < eta a t <= eta a v) by (split; [apply (eta_pos a Hprot Hgain); exact (Rle_lt_trans _ _ _ (proj2 Ht) (proj2 Hv))|
      apply (eta_grows a Hprot); split; [apply Ht|apply Hv]]).
    assert (Lx : forall x y d, (forall j, Rabs (x j - y j) <= d) -> Rabs (eta a t * lp c x i - eta a t * lp c y i) <= eta a v * K * d).
    { intros x y d H. rewrite <- Rmult_minus_distr_l, Rabs_mult, Rabs_right by lra. rewrite Rmult_assoc.
      apply Rmult_le_compat; [lra|apply Rabs_pos|apply Et|apply L; exact H]. }
    split.
    - unfold flow. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp.
      assert (X1 : Rabs (dies t * lag0 i) <= Q).
      { rewrite Rabs_mult, Rabs_right by (apply Rle_ge; left; apply exp_pos).
        assert (X2 : Rabs (lag0 i) <= Q).
        { pose proof (total_above N lag0 i) as A. unfold cut in A. unfold lag0 in A at 1. unfold lag0 at 1. destruct (Nat.ltb_spec i N) as [Hi|Hi]; [|rewrite Rabs_R0; exact Q0].
          exact A. }
        assert (X3 : dies t <= 1).
        { unfold dies. rewrite <- exp_0. apply AgentRest.exp_le. pose proof (turns_pos a Hprot Hgain t) as P.
          assert (0 <= turns a t) by (apply P; fold G T; lra). assert (0 <= alpha c * turns a t) by (apply Rmult_le_pos; lra). lra. }
        pose proof (exp_pos (- (alpha c * turns a t))) as X4. fold (dies t) in X4. pose proof (Rabs_pos (lag0 i)). nra. }
      assert (X5 : Rabs (eta a t * lp c first i) <= eta a v * K * D).
      { replace (eta a t * lp c first i) with (eta a t * lp c first i - eta a t * lp c (fun _ => 0) i) by (unfold lp; fold a G; rewrite Z; ring).
        apply Lx. intros j. rewrite Rminus_0_r. pose proof (total_above N first j) as A. unfold cut in A. unfold first in A at 1. unfold first at 1.
        destruct (j <? N)%nat; [exact A|rewrite Rabs_R0; exact D0]. }
      lra.
    - intros x y d H. assert (d0 : 0 <= d) by (eapply Rle_trans; [apply Rabs_pos|apply (H 0%nat)]). unfold flow.
      replace (dies t * lag0 i - eta a t * lp c x i - (dies t * lag0 i - eta a t * lp c y i)) with (- (eta a t * lp c x i - eta a t * lp c y i)) by ring.
      rewrite Rabs_Ropp. eapply Rle_trans; [apply Lx; exact H|]. apply Rmult_le_compat_r; lra. }
  destruct (solvable nat T flow first HT Bounds) as [P [P0 [CP DP]]].
  assert (CE : forall t, t < T -> continuous (eta a) t) by (intros; apply (eta_continuous a); assumption).
  assert (CD : forall t, t < T -> continuous dies t) by (intros t Ht; apply @ex_derive_continuous; eexists; apply dies_derive; exact Ht).
  assert (Dp : forall t j, 0 < t < T -> is_derive (fun u => P u j) t (flow t (P t) j)).
  { intros t j Ht. apply DP; [exact Ht|]. intros z. unfold flow. apply (continuous_minus (fun u => dies u * lag0 j) (fun u => eta a u * lp c z j)).
    - apply (continuous_mult dies (fun _ => lag0 j)); [apply CD; lra|apply continuous_const].
    - apply (continuous_mult (eta a) (fun _ => lp c z j)); [apply CE; lra|apply continuous_const]. }
  set (X := fun t i j => if (i =? 0)%nat then P t j + h j else flow t (P t) j).
  assert (EP : forall t, placed h (X t) 0 = P t) by (intros t; apply functional_extensionality; intros j; unfold placed, X; simpl; ring).
  exists X, (fun _ _ => 0). split; [split; [|split; [reflexivity|]]|].
  - unfold slides. destruct (kind (graph (team c))); [reflexivity|]. intros t i e _ _ W. contradiction (W eq_refl).
  - intros t j Hj Ht. fold a G T N in Hj, Ht. split; [|split; [apply continuous_const|]].
    + intros H0. split.
      * apply (is_derive_ext (fun u => flow u (P u) j)); [intros u; unfold X; simpl; ring|]. unfold flow. evar_last.
        -- apply (is_derive_minus (fun u => dies u * lag0 j) (fun u => eta a u * lp c (P u) j)).
           ++ apply (is_derive_times dies (fun _ => lag0 j)); [apply dies_derive; exact Ht|apply @is_derive_const].
           ++ apply (is_derive_times (eta a) (fun u => lp c (P u) j)); [apply (gain_derive c Hprot Hgain Hcap); exact Ht|].
              apply (is_derive_lap N (edges G) j P (fun j => flow t (P t) j) t Hin). intros i Hi. apply Dp. lra.
        -- unfold steer. cbv zeta. rewrite EP. pose proof (eta_pos a Hprot Hgain t Ht) as E0. fold a.
           change (X t 1%nat) with (fun j => flow t (P t) j). unfold minus, plus, opp, zero; simpl.
           change (lp c (fun j0 => flow t (P t) j0)) with (lap (edges G) (fun j0 => flow t (P t) j0)).
           set (lf := lap (edges G) (fun j0 => flow t (P t) j0) j). unfold flow, sq. field. lra.
      * apply (is_derive_ext (fun u => P u j + h j)); [intros; reflexivity|]. evar_last;
          [apply (is_derive_plus (fun u => P u j) (fun _ => h j)); [apply Dp; lra|apply @is_derive_const]|]. unfold plus, zero; simpl. unfold X. simpl. ring.
    + assert (RM : forall g : R -> R, continuous g (Rmax 0 t) -> continuous (fun u => g (Rmax 0 u)) t).
      { intros g Hg. apply (continuous_comp (Rmax 0) g); [apply continuous_Rmax|exact Hg]. }
      assert (Mt : Rmax 0 t < T) by (apply Rmax_lub_lt; lra).
      intros i Hi. destruct i as [|[|i]]; [| |lia]; unfold X; simpl.
      * apply (continuous_plus (fun u => P (Rmax 0 u) j) (fun _ => h j)); [apply CP; exact Ht|apply continuous_const].
      * unfold flow. apply (continuous_minus (fun u => dies (Rmax 0 u) * lag0 j) (fun u => eta a (Rmax 0 u) * lp c (P (Rmax 0 u)) j)).
        -- apply (continuous_mult (fun u => dies (Rmax 0 u)) (fun _ => lag0 j)); [apply (RM dies); apply CD; exact Mt|apply continuous_const].
        -- apply (continuous_mult (fun u => eta a (Rmax 0 u)) (fun u => lp c (P (Rmax 0 u)) j)); [apply (RM (eta a)); apply CE; exact Mt|].
           apply (continuous_lap N (edges G) j (fun u => P (Rmax 0 u)) t Hin). intros l Hl. apply CP. exact Ht.
  - intros i j Hi Hj. assert (EF : P 0 = first) by (apply functional_extensionality; exact P0). unfold X.
    destruct i as [|[|i]]; [| |lia]; simpl; rewrite EF.
    + unfold first. destruct (Nat.ltb_spec j N); [ring|lia].
    + unfold flow, dies. rewrite (turns_0 a), Rmult_0_r, Ropp_0, exp_0. unfold lag0. destruct (Nat.ltb_spec j N); [ring|lia].
Qed.
End Exists.
