(** From every state a motion starts, so that nothing that is said of all motions is void. *)
Require Import QArith Qreals List Bool Reals Lra Lia.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Checker Flow Sound Slide Solution.
Open Scope R_scope.

Lemma gain_continuous T r k t : t < T -> continuous (gain T r k) t.
Proof. intros H. apply @ex_derive_continuous. unfold gain. auto_derive. lra. Qed.
(** the sum of sizes, which bounds each of them *)
Fixpoint total (n : nat) (x : nat -> R) : R := match n with O => 0 | S p => total p x + Rabs (x p) end.
Definition cut (n : nat) (x : nat -> R) (i : nat) : R := if (i <? n)%nat then x i else 0.
Lemma total_pos n x : 0 <= total n x.
Proof. induction n as [|n IH]; simpl; [lra|]. pose proof (Rabs_pos (x n)). lra. Qed.
Lemma cut_in n x i : (i < n)%nat -> cut n x i = x i.
Proof. intros H. unfold cut. destruct (Nat.ltb_spec i n); [reflexivity|lia]. Qed.
Lemma total_above n x i : Rabs (cut n x i) <= total n x.
Proof.
  unfold cut. destruct (Nat.ltb_spec i n) as [H|_]; [|rewrite Rabs_R0; apply total_pos].
  induction n as [|n IH]; [lia|]. simpl. pose proof (total_pos n x). pose proof (Rabs_pos (x n)).
  destruct (Nat.eq_dec i n) as [->|N]; [lra|]. specialize (IH ltac:(lia)). lra.
Qed.
Lemma total_continuous n (x : R -> nat -> R) t : (forall i, continuous (fun u => x u i) t) -> continuous (fun u => total n (x u)) t.
Proof.
  intros H. induction n as [|n IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => total n (x u)) (fun u => Rabs (x u n))); [exact IH|].
  apply (continuous_comp (fun u => x u n) Rabs); [apply H|apply continuous_Rabs].
Qed.

(** [G t x i] obeys bounds of this kind, for the Laplacian and for members of families *)
Definition lipschitz (K : R) (G : (nat -> R) -> nat -> R) : Prop := (forall i, G (fun _ => 0) i = 0) /\
  forall x z d i, (forall j, Rabs (x j - z j) <= d) -> Rabs (G x i - G z i) <= K * d.
Lemma lipschitz_plus K1 K2 G1 G2 : lipschitz K1 G1 -> lipschitz K2 G2 -> lipschitz (K1 + K2) (fun x i => G1 x i + G2 x i).
Proof.
  intros [Z1 L1] [Z2 L2]. split; [intros i; rewrite Z1, Z2; ring|]. intros x z d i H. specialize (L1 x z d i H). specialize (L2 x z d i H).
  replace (G1 x i + G2 x i - (G1 z i + G2 z i)) with (G1 x i - G1 z i + (G2 x i - G2 z i)) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
Lemma lipschitz_ext K G1 G2 : (forall x i, G1 x i = G2 x i) -> lipschitz K G1 -> lipschitz K G2.
Proof. intros E [Z L]. split; intros; rewrite <- !E; [apply Z|apply L; assumption]. Qed.
Lemma lipschitz_le K L G : K <= L -> lipschitz K G -> lipschitz L G.
Proof.
  intros H [Z B]. split; [exact Z|]. intros x z d i D. eapply Rle_trans; [apply B; exact D|]. apply Rmult_le_compat_r; [|exact H].
  eapply Rle_trans; [apply Rabs_pos|apply (D 0%nat)].
Qed.
(** an edge of a weight that is at most [K] in size *)
Lemma lipschitz_edge K w t s : Rabs w <= K -> lipschitz (2 * K) (fun x i => if (t =? i)%nat then Rabs w * x t - w * x s else 0).
Proof.
  intros HK. split; [intros i; destruct (t =? i)%nat; ring|]. intros x z d i H. pose proof (H t) as Ht. pose proof (H s) as Hs.
  pose proof (Rabs_pos w). pose proof (Rabs_pos (x t - z t)). assert (Rabs w * d <= K * d) by (apply Rmult_le_compat_r; lra).
  destruct (t =? i)%nat; [|rewrite Rminus_0_r, Rabs_R0; nra].
  replace (Rabs w * x t - w * x s - (Rabs w * z t - w * z s)) with (Rabs w * (x t - z t) + - (w * (x s - z s))) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp, !Rabs_mult, Rabs_Rabsolu.
  pose proof (Rmult_le_compat_l _ _ _ (Rabs_pos w) Ht). pose proof (Rmult_le_compat_l _ _ _ (Rabs_pos w) Hs). lra.
Qed.
Lemma lipschitz_zero : lipschitz 0 (fun _ _ => 0).
Proof. split; [reflexivity|]. intros. rewrite Rminus_0_r, Rabs_R0. lra. Qed.
Lemma lap_lipschitz es : exists K, 0 <= K /\ lipschitz K (lap es).
Proof.
  induction es as [|e es [K [HK IH]]]; [exists 0; split; [lra|exact lipschitz_zero]|].
  exists (2 * Rabs (Q2R (wt e)) + K). split; [pose proof (Rabs_pos (Q2R (wt e))); lra|].
  apply (lipschitz_plus _ _ (fun x i => lap_edge i x e) (lap es)); [|exact IH].
  apply (lipschitz_ext _ (fun x i => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * x (tgt e) - Q2R (wt e) * x (src e) else 0)).
  - intros x i. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) i) as [<-|]; reflexivity.
  - apply lipschitz_edge. apply Rle_refl.
Qed.

(** what is driven by given sliding variables, and in time as [G] is *)
Theorem driven n G T r k (S : R -> nat -> R) (x0 : nat -> R) K : 0 < T -> 0 <= K ->
  (forall t, 0 <= t < T -> lipschitz K (G t)) -> (forall t i, t < T -> continuous (fun u => S u i) t) ->
  exists X, (forall i, (i < n)%nat -> X 0 i = x0 i) /\ (forall t i, t < T -> (i < n)%nat ->
    continuous (fun u => X (Rmax 0 u) i) t /\ continuous (fun u => S (Rmax 0 u) i) t) /\
  forall t i, 0 < t < T -> (i < n)%nat -> (forall x, continuous (fun u => G u x i) t) ->
    is_derive (fun u => X u i - S u i) t (- (gain T r k t * G t (X t) i)).
Proof.
  intros HT HK HG CS. set (f := fun u y i => - (gain T r k u * G u (fun j => y j + cut n (S u) j) i)).
  set (y0 := cut n (fun i => x0 i - S 0 i)). destruct (solvable nat T f y0 HT) as [Y [Y0 [CY DY]]].
  - intros v Hv. set (g := Rabs r + Rabs k / (T - v)).
    assert (Hk : 0 <= Rabs k / (T - v)) by (apply Rmult_le_pos; [apply Rabs_pos|left; apply Rinv_0_lt_compat; lra]).
    assert (Hg : 0 <= g) by (pose proof (Rabs_pos r); unfold g; lra).
    assert (B : forall t, 0 <= t <= v -> Rabs (gain T r k t) <= g).
    { intros t Ht. unfold gain, g. eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat_l. unfold Rdiv. rewrite Rabs_mult.
      apply Rmult_le_compat_l; [apply Rabs_pos|]. rewrite Rabs_right by (apply Rle_ge; left; apply Rinv_0_lt_compat; lra).
      apply Rinv_le_contravar; lra. }
    destruct (continuity_ab_maj (fun u => total n (S u)) 0 v (proj1 Hv)) as [b [Hb _]].
    { intros u Hu. apply continuity_pt_filterlim. apply total_continuous. intros i. apply CS. lra. }
    set (D := total n (fun i => x0 i - S 0 i) + total n (S b)).
    assert (HD : 0 <= D) by (unfold D; pose proof (total_pos n (fun i => x0 i - S 0 i)); pose proof (total_pos n (S b)); lra).
    assert (gK : 0 <= g * K) by (apply Rmult_le_pos; assumption).
    exists (g * K * (1 + D)). split; [apply Rmult_le_pos; lra|]. intros t i Ht. destruct (HG t ltac:(lra)) as [Z L].
    assert (F : forall x z d, (forall j, Rabs (x j - z j) <= d) -> Rabs (gain T r k t * (G t x i - G t z i)) <= g * K * d).
    { intros x z d H. rewrite Rabs_mult, Rmult_assoc. apply Rmult_le_compat; try apply Rabs_pos; [apply B; exact Ht|apply L; exact H]. }
    split.
    + unfold f. rewrite Rabs_Ropp. replace (G t _ i) with (G t (fun j => y0 j + cut n (S t) j) i - G t (fun _ => 0) i) by (rewrite Z; ring).
      eapply Rle_trans; [apply (F _ _ D)|apply Rmult_le_compat_l; lra]. intros j. rewrite Rminus_0_r.
      eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat; [apply total_above|].
      eapply Rle_trans; [apply total_above|]. apply Hb. exact Ht.
    + intros x z d H. unfold f. replace (- _ - - _) with (- (gain T r k t * (G t (fun j => x j + cut n (S t) j) i - G t (fun j => z j + cut n (S t) j) i))) by ring.
      rewrite Rabs_Ropp. assert (Hd : 0 <= d) by (eapply Rle_trans; [apply Rabs_pos|apply (H 0%nat)]).
      apply Rle_trans with (g * K * d); [|apply Rmult_le_compat_r; [exact Hd|]; rewrite <- (Rmult_1_r (g * K)) at 1; apply Rmult_le_compat_l; lra].
      apply F. intros j. replace (_ - _) with (x j - z j) by ring. apply H.
  - assert (C : forall t i, t < T -> continuous (fun u => S (Rmax 0 u) i) t).
    { intros t i Ht. apply (continuous_comp (Rmax 0) (fun u => S u i)); [apply continuous_Rmax|]. apply CS. apply Rmax_lub_lt; assumption. }
    exists (fun t i => Y t i + cut n (S t) i). split; [|split].
    + intros i Hi. rewrite Y0. unfold y0. rewrite !cut_in by exact Hi. ring.
    + intros t i Ht Hi. split; [|apply C; exact Ht].
      apply (continuous_ext (fun u => Y (Rmax 0 u) i + S (Rmax 0 u) i)); [intros u; rewrite cut_in by exact Hi; reflexivity|].
      apply (continuous_plus (fun u => Y (Rmax 0 u) i) (fun u => S (Rmax 0 u) i)); [apply CY|apply C]; exact Ht.
    + intros t i Ht Hi CG. apply (is_derive_ext (fun u => Y u i)); [intros u; rewrite cut_in by exact Hi; simpl; ring|].
      apply (DY t i Ht). intros z. unfold f. apply (continuous_opp (fun u => gain T r k u * G u (fun j => z j + cut n (S u) j) i)).
      apply continuous_times; [apply gain_continuous; lra|].
      (* what [S] moves within [G] vanishes *)
      set (z' := fun j => z j + cut n (S t) j). set (q := fun u => total n (fun j => S u j - S t j)).
      assert (Cq : continuous q t).
      { apply (total_continuous n (fun u j => S u j - S t j)). intros j.
        apply (continuous_minus (fun u => S u j) (fun _ => S t j)); [apply CS; lra|apply continuous_const]. }
      assert (Q0 : q t = 0).
      { unfold q. clear. induction n as [|p IH]; simpl; [reflexivity|]. rewrite IH, Rminus_eq_0, Rabs_R0. ring. }
      specialize (CG z'). unfold continuous in Cq, CG. rewrite Q0 in Cq. rewrite filterlim_locally in Cq, CG.
      apply filterlim_locally. intros e. assert (He : 0 < e / (2 * (K + 1))) by (apply Rdiv_lt_0_compat; [apply cond_pos|lra]).
      assert (He2 : 0 < e / 2) by (pose proof (cond_pos e); lra). specialize (Cq (mkposreal _ He)). specialize (CG (mkposreal _ He2)).
      assert (Now : locally t (fun u => 0 < u < T)).
      { assert (Hd : 0 < Rmin t (T - t)) by (apply Rmin_pos; lra). exists (mkposreal _ Hd). intros u Hu. change (Rabs (u - t) < Rmin t (T - t)) in Hu.
        pose proof (Rmin_l t (T - t)). pose proof (Rmin_r t (T - t)). apply Rabs_def2 in Hu. lra. }
      generalize (filter_and _ _ (filter_and _ _ Cq CG) Now). apply filter_imp. intros u [[U1 U2] U3].
      change (Rabs (q u - 0) < e / (2 * (K + 1))) in U1. change (Rabs (G u z' i - G t z' i) < e / 2) in U2.
      change (Rabs (G u (fun j => z j + cut n (S u) j) i - G t z' i) < e). rewrite Rminus_0_r in U1.
      destruct (HG u ltac:(lra)) as [_ L]. specialize (L (fun j => z j + cut n (S u) j) z' (q u) i).
      assert (A : forall j, Rabs (z j + cut n (S u) j - z' j) <= q u).
      { intros j. eapply Rle_trans; [|apply (total_above n (fun j => S u j - S t j) j)]. right. f_equal. unfold z', cut.
        destruct (j <? n)%nat; ring. }
      specialize (L A). pose proof (Rle_abs (q u)). assert (U4 : q u < e / (2 * (K + 1))) by lra.
      apply (Rmult_lt_compat_l (K + 1)) in U4; [|lra]. replace ((K + 1) * (e / (2 * (K + 1)))) with (e / 2) in U4 by (field; lra).
      pose proof (Rle_trans _ _ _ (Rabs_pos _) (A 0%nat)).
      replace (G u (fun j => z j + cut n (S u) j) i - G t z' i) with (G u (fun j => z j + cut n (S u) j) i - G u z' i + (G u z' i - G t z' i)) by ring.
      eapply Rle_lt_trans; [apply Rabs_triang|]. lra.
Qed.

(** * Sliding variables: S' = - (mu1 - delta) sgn(S) - pull S until S = 0, so with the disturbance that slows them most *)
Section Slides.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let Tr := Q2R T_r.
Let w := psi c T_r mu2 mu3.
Let p := pull c T_r mu2 mu3.
Let above := parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.
Let w_derive t : t < Tr -> is_derive w t (- (p t * w t)) := psi_derive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t.
Let w_pos t : 0 < w t := psi_pos c T_r mu2 mu3 t.
Definition spent t := RInt (fun u => / w u) 0 t.
Definition remains (q t : R) : R := if Rlt_dec t Tr then w t * Rmax 0 (1 - q * spent t) else 0.
Lemma w_continuous t : t < Tr -> continuous w t.
Proof. intros H. apply @ex_derive_continuous. eexists. apply w_derive. exact H. Qed.
Lemma inverse_continuous t : t < Tr -> continuous (fun u => / w u) t.
Proof. intros H. apply (continuous_comp w Rinv); [apply w_continuous; exact H|]. apply continuous_Rinv. pose proof (w_pos t). lra. Qed.
Lemma spent_derive t : t < Tr -> is_derive spent t (/ w t).
Proof. intros H. apply (primitive (fun u => / w u) Tr); [apply above|apply inverse_continuous|exact H]. Qed.
Lemma spent_pos t : 0 <= t < Tr -> 0 <= spent t.
Proof.
  intros H. apply RInt_ge_0; [lra| |].
  - apply (@ex_RInt_continuous R_CompleteNormedModule). intros z Hz. apply inverse_continuous. rewrite Rmax_right in Hz by lra. lra.
  - intros u _. left. apply Rinv_0_lt_compat. apply w_pos.
Qed.
Lemma product_derive q t : t < Tr -> is_derive (fun u => w u * (1 - q * spent u)) t (- (p t * (w t * (1 - q * spent t))) - q).
Proof.
  intros H. pose proof (w_pos t) as P. evar_last.
  - apply is_derive_times; [apply w_derive; exact H|]. apply @is_derive_minus; [apply @is_derive_const|].
    apply is_derive_scal. apply spent_derive. exact H.
  - unfold minus, plus, opp, zero; simpl. field. lra.
Qed.
Lemma soon (a b : R) : a < b -> locally a (fun u => u < b).
Proof.
  intros H. assert (He : 0 < b - a) by lra. exists (mkposreal _ He). intros u Hu. change (Rabs (u - a) < b - a) in Hu.
  apply Rabs_def2 in Hu. lra.
Qed.
Lemma remains_continuous q t : 0 < q -> 0 <= t -> continuous (remains q) t.
Proof.
  intros Hq Ht. destruct above as [A [_ [_ Pm]]]. fold Tr in A. destruct (Rtotal_order t Tr) as [L|[->|L]].
  - apply (continuous_ext_loc _ (fun u => w u * Rmax 0 (1 - q * spent u))).
    + eapply filter_imp; [|apply (soon t Tr L)]. intros u Hu. unfold remains. destruct (Rlt_dec u Tr); [reflexivity|contradiction].
    + apply continuous_times; [apply w_continuous; exact L|].
      apply (continuous_comp (fun u => 1 - q * spent u) (Rmax 0)); [|apply continuous_Rmax].
      apply @ex_derive_continuous. eexists. apply @is_derive_minus; [apply @is_derive_const|].
      apply is_derive_scal. apply spent_derive. exact L.
  - apply filterlim_locally. intros e. set (z := Q2R mu3 * Q2R (kappa c)) in *. set (y := exp (ln e / z)).
    assert (Y : 0 < y) by apply exp_pos. assert (He : 0 < Rmin Tr (Tr * y)) by (apply Rmin_pos; [lra|apply Rmult_lt_0_compat; lra]).
    exists (mkposreal _ He). intros u Hu. change (Rabs (u - Tr) < Rmin Tr (Tr * y)) in Hu. apply Rabs_def2 in Hu.
    pose proof (Rmin_l Tr (Tr * y)). pose proof (Rmin_r Tr (Tr * y)).
    change (Rabs (remains q u - remains q Tr) < e). unfold remains. destruct (Rlt_dec Tr Tr) as [N|_]; [lra|].
    destruct (Rlt_dec u Tr) as [L|_]; [|rewrite Rminus_0_r, Rabs_R0; apply cond_pos]. rewrite Rminus_0_r.
    pose proof (w_pos u) as P. pose proof (spent_pos u ltac:(lra)) as G.
    assert (G2 : 0 <= q * spent u) by (apply Rmult_le_pos; lra).
    assert (B : 0 <= Rmax 0 (1 - q * spent u) <= 1) by (split; [apply Rmax_l|apply Rmax_lub; lra]).
    rewrite Rabs_right by (apply Rle_ge, Rmult_le_pos; lra). apply Rle_lt_trans with (w u); [nra|].
    eapply Rle_lt_trans; [apply (psi_power c T_r T_s mu1 mu2 mu3 delta Hprot Hkind u); lra|]. fold Tr z.
    rewrite <- (exp_ln e) by apply cond_pos. unfold Rpower. apply exp_increasing.
    assert (Z : 0 < (Tr - u) / Tr < y).
    { split; [apply Rdiv_lt_0_compat; lra|]. apply (Rmult_lt_reg_r Tr); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
    assert (K : ln ((Tr - u) / Tr) < ln e / z) by (rewrite <- (ln_exp (ln e / z)); apply ln_increasing; apply Z).
    apply (Rmult_lt_compat_l z) in K; [|exact Pm]. replace (z * (ln e / z)) with (ln e) in K by (field; lra). exact K.
  - apply (continuous_ext_loc _ (fun _ => 0)); [|apply continuous_const]. assert (He : 0 < t - Tr) by lra.
    exists (mkposreal _ He). intros u Hu. change (Rabs (u - t) < t - Tr) in Hu. apply Rabs_def2 in Hu.
    unfold remains. destruct (Rlt_dec u Tr); [lra|reflexivity].
Qed.
Lemma remains_0 q : remains q 0 = 1.
Proof.
  unfold remains, spent. destruct above as [A _]. fold Tr in A. destruct (Rlt_dec 0 Tr) as [_|N]; [|lra].
  rewrite RInt_point. unfold w. rewrite (psi_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). unfold zero; simpl. rewrite Rmax_right; lra.
Qed.
Lemma remains_pos q t : 0 <= remains q t.
Proof. unfold remains. destruct (Rlt_dec t Tr); [|lra]. apply Rmult_le_pos; [left; apply w_pos|apply Rmax_l]. Qed.
(** its derivative where it is not 0 *)
Lemma remains_falls q t : remains q t <> 0 -> is_derive (remains q) t (- (p t * remains q t) - q).
Proof.
  intros H. unfold remains in H. destruct (Rlt_dec t Tr) as [L|]; [|contradiction].
  assert (G : 0 < 1 - q * spent t).
  { apply Rnot_le_lt. intros G. apply H. rewrite Rmax_left by exact G. ring. }
  assert (E : remains q t = w t * (1 - q * spent t)).
  { unfold remains. destruct (Rlt_dec t Tr); [|contradiction]. rewrite Rmax_right by lra. reflexivity. }
  rewrite E. apply (is_derive_ext_loc (fun u => w u * (1 - q * spent u))); [|apply product_derive; exact L].
  assert (C : continuous (fun u => 1 - q * spent u) t).
  { apply @ex_derive_continuous. eexists. apply @is_derive_minus; [apply @is_derive_const|].
    apply is_derive_scal. apply spent_derive. exact L. }
  assert (N : locally t (fun u => 0 < 1 - q * spent u)) by (apply (C (fun v => 0 < v)), open_gt; exact G).
  eapply filter_imp; [|apply filter_and; [exact N|exact (soon t Tr L)]]. intros u [U1 U2]. unfold remains.
  destruct (Rlt_dec u Tr); [|contradiction]. rewrite Rmax_right by lra. reflexivity.
Qed.

(** the sliding variable that starts at [a] *)
Let r := Q2R mu1 - Q2R delta.
Definition slide (a t : R) : R := if Req_EM_T a 0 then 0 else a * remains (r / Rabs a) t.
Lemma rate_pos a : a <> 0 -> 0 < r / Rabs a.
Proof. intros H. destruct above as [_ [M _]]. apply Rdiv_lt_0_compat; [exact M|apply Rabs_pos_lt; exact H]. Qed.
Lemma slide_continuous a t : 0 <= t -> continuous (slide a) t.
Proof.
  intros Ht. destruct (Req_EM_T a 0) as [E|N].
  - apply (continuous_ext (fun _ => 0)); [|apply continuous_const]. intros u. unfold slide. destruct (Req_EM_T a 0); [reflexivity|contradiction].
  - apply (continuous_ext (fun u => a * remains (r / Rabs a) u)); [intros u; unfold slide; destruct (Req_EM_T a 0); [contradiction|reflexivity]|].
    apply continuous_times; [apply continuous_const|]. apply remains_continuous; [apply rate_pos; exact N|exact Ht].
Qed.
Lemma slide_0 a : slide a 0 = a.
Proof. unfold slide. destruct (Req_EM_T a 0) as [->|_]; [reflexivity|]. rewrite remains_0. ring. Qed.
Lemma slide_law a t e : slide a t <> 0 -> 0 < e -> exists eta, 0 < eta /\ forall h, 0 < h < eta ->
  Rabs (Rabs (slide a (t + h)) - (Rabs (slide a t) - h * (Q2R mu1 + p t * Rabs (slide a t)))) <= h * (Q2R delta + e).
Proof.
  unfold slide. destruct (Req_EM_T a 0) as [E|N]; [intros H; contradiction (H eq_refl)|]. intros H He.
  set (q := r / Rabs a) in *. pose proof (Rabs_pos_lt a N) as A.
  assert (H2 : remains q t <> 0) by (intros Z; apply H; rewrite Z; ring).
  pose proof (remains_falls q t H2) as D. apply is_derive_Reals in D.
  destruct (D (e / Rabs a) ltac:(apply Rdiv_lt_0_compat; assumption)) as [d Hd]. exists d. split; [apply cond_pos|]. intros h Hh.
  specialize (Hd h ltac:(lra) ltac:(rewrite Rabs_right; lra)). apply Rabs_def2 in Hd as [Hd Hl].
  rewrite !Rabs_mult, !(Rabs_right (remains _ _)) by (apply Rle_ge, remains_pos).
  apply (Rmult_lt_compat_l (h * Rabs a)) in Hd; [|apply Rmult_lt_0_compat; lra].
  apply (Rmult_lt_compat_l (h * Rabs a)) in Hl; [|apply Rmult_lt_0_compat; lra].
  replace (h * Rabs a * (e / Rabs a)) with (h * e) in Hd by (field; lra).
  replace (h * Rabs a * - (e / Rabs a)) with (- (h * e)) in Hl by (field; lra).
  replace (h * Rabs a * ((remains q (t + h) - remains q t) / h - (- (p t * remains q t) - q)))
    with (Rabs a * remains q (t + h) - Rabs a * remains q t + h * (p t * (Rabs a * remains q t)) + h * r) in Hd, Hl
    by (unfold q; field; lra).
  assert (Dp : 0 <= h * Q2R delta) by (apply Rmult_le_pos; [lra|apply (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind)]).
  unfold r in *. apply Rabs_le. split; lra.
Qed.
End Slides.

Theorem slides_exist c (s0 : nat -> R) : check_protocol c = true -> (forall T i, kind c = Nominal T -> s0 i = 0) ->
  exists S, slides c S /\ (forall i, S 0 i = s0 i) /\ forall t i, continuous (fun u => S u i) t.
Proof.
  intros HP H0. destruct (kind c) as [T|T_r T_s mu1 mu2 mu3 delta] eqn:K.
  - exists (fun _ _ => 0). unfold slides. rewrite K. split; [reflexivity|]. split; [|intros; apply continuous_const].
    intros i. symmetry. apply (H0 T i eq_refl).
  - exists (fun t i => slide c T_r mu1 mu2 mu3 delta (s0 i) (Rmax 0 t)). split; [|split].
    + unfold slides. rewrite K. intros t i e Ht _ N He. rewrite (Rmax_right 0 t) in N |- * by lra.
      destruct (slide_law c _ _ _ _ _ _ HP K (s0 i) t e N He) as [eta [H1 H2]]. exists eta. split; [exact H1|].
      intros h Hh. rewrite (Rmax_right 0 (t + h)) by lra. apply H2. exact Hh.
    + intros i. rewrite Rmax_left by lra. apply (slide_0 c _ _ _ _ _ _ HP K).
    + intros t i. apply (continuous_comp (Rmax 0) (slide c T_r mu1 mu2 mu3 delta (s0 i))); [apply continuous_Rmax|].
      apply (slide_continuous c _ _ _ _ _ _ HP K). apply Rmax_l.
Qed.
Theorem motions_exist c : check_protocol c = true -> existence c.
Proof.
  intros HP x0 s0 H0. destruct (slides_exist c s0 HP H0) as [S [HS [S0 CS]]]. destruct (lap_lipschitz (edges c)) as [K [HK L]].
  destruct (driven (order c) (fun _ => lap (edges c)) (deadline c) (Q2R (rho1 c)) (k c) S x0 K) as [X [X0 [CX DX]]];
    [apply (T_pos c HP)|exact HK|intros; exact L|intros; apply CS|].
  exists X, S. split; [split; [split; [|exact CX]|exact HS]|].
  - intros t i Ht Hi. apply DX; [exact Ht|exact Hi|]. intros x. apply continuous_const.
  - intros i Hi. split; [apply X0; exact Hi|apply S0].
Qed.
