(** Motions of the cascade: how far velocities are from the commanded ones dies, and what measures positions follows. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Solution Main Weighted AgentCertificate AgentForms
  AgentMotion AgentEnd AgentRest CascadeCertificate.
Open Scope R_scope.

(** * Norms *)
Section Norms.
Variable F : (nat -> R) -> (nat -> R) -> R.
Hypothesis HF : positive F.
Lemma cross x z : F x z <= sqrt (F x x) * sqrt (F z z).
Proof.
  rewrite <- sqrt_mult by apply (above0 F HF). eapply Rle_trans; [apply Rle_abs|]. rewrite <- sqrt_Rsqr_abs. apply sqrt_le_1_alt.
  exact (cauchy F HF x z).
Qed.
End Norms.
Lemma dot_positive m : positive (fun x z => sum m (fun i => x i * z i)).
Proof.
  constructor; intros.
  - apply sum_ext. intros. ring.
  - rewrite <- sum_plus. apply sum_ext. intros. ring.
  - rewrite <- sum_scal. apply sum_ext. intros. ring.
  - rewrite <- (sum_zero m (fun _ => 0)) by reflexivity. apply sum_le. intros. apply Rle_0_sqr.
Qed.

Section Gain.
Variable c : cascade.
Let a := team c.
Let G := graph a.
Let T := deadline G.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Let T_k := T_k a Hprot.
Lemma free t : eta a t = uncapped a t.
Proof. unfold eta, uncapped. rewrite Hcap. reflexivity. Qed.
Lemma gain_derive t : t < T -> is_derive (eta a) t (theta c t * sq (eta a t)).
Proof.
  intros Ht. destruct T_k as [A B]. pose proof (eta_pos a Hprot Hgain t Ht) as E.
  apply (is_derive_ext (uncapped a)); [intros; symmetry; apply free|]. evar_last; [apply (uncapped_derive a t Ht)|].
  unfold theta. fold a G. assert (D : eta a t - Q2R (slope a) = k G / (T - t)) by (rewrite free; unfold uncapped, gain; fold G T; ring).
  fold G in B. replace (sq (1 - Q2R (slope a) / eta a t) / k G * sq (eta a t)) with (sq (eta a t - Q2R (slope a)) / k G) by (unfold sq; field; lra).
  rewrite D. unfold sq. fold G T. field. fold T in Ht. lra.
Qed.
(** [theta] is at most [1/k] *)
Lemma theta_ok t : t < T -> 0 <= theta c t <= / k G.
Proof.
  intros Ht. destruct T_k as [A B]. fold G in B. pose proof (eta_pos a Hprot Hgain t Ht) as E. destruct Hgain as [R0 _].
  assert (D : eta a t - Q2R (slope a) = k G / (T - t)) by (rewrite free; unfold uncapped, gain; fold G T; ring).
  assert (P : 0 < k G / (T - t)) by (apply Rdiv_lt_0_compat; lra).
  unfold theta. fold a G. set (z := Q2R (slope a) / eta a t). assert (Z : 0 <= z <= 1).
  { unfold z. split; [apply Rmult_le_pos; [exact R0|left; apply Rinv_0_lt_compat; exact E]|].
    apply (Rmult_le_reg_r (eta a t)); [exact E|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
  assert (K : 0 < / k G) by (apply Rinv_0_lt_compat; exact B). unfold sq, Rdiv. assert (0 <= (1 - z) * (1 - z) <= 1) by nra. nra.
Qed.
Lemma decays_derive p t : t < T -> is_derive (fun t => exp (p * turns a t)) t (p * eta a t * exp (p * turns a t)).
Proof.
  intros Ht. evar_last; [apply (is_derive_after exp (fun t => p * turns a t)); [apply is_derive_exp|]; apply is_derive_scal; apply (turns_derive a Hprot); exact Ht|].
  reflexivity.
Qed.
Lemma decays_continuous p t : t < T -> continuous (fun t => exp (p * turns a t)) t.
Proof. intros Ht. apply @ex_derive_continuous. eexists. apply decays_derive. exact Ht. Qed.
Definition pushed p t := RInt (fun r => exp (p * turns a r)) 0 t.
Lemma pushed_derive p t : t < T -> is_derive (pushed p) t (exp (p * turns a t)).
Proof. apply (primitive (fun r => exp (p * turns a r)) T); [apply T_k|]. intros u Hu. apply decays_continuous. exact Hu. Qed.
Lemma pushed_0 p : pushed p 0 = 0.
Proof. apply (RInt_point 0 (fun r => exp (p * turns a r))). Qed.
Lemma carried_ok b t : 0 <= t < T -> carried c b t = exp (- (b * turns a t)) * pushed (b - alpha c) t.
Proof.
  intros Ht. unfold carried, pushed. fold a. change (Rmult (exp (- (b * turns a t))) ?i) with (scal (exp (- (b * turns a t))) i).
  rewrite <- (RInt_scal (fun r => exp ((b - alpha c) * turns a r))).
  - apply RInt_ext. intros r _. unfold scal; simpl; unfold mult; simpl. rewrite <- exp_plus. f_equal. ring.
  - apply (ex_RInt_continuous (fun r => exp ((b - alpha c) * turns a r))). intros z [_ Hz]. apply decays_continuous.
    eapply Rle_lt_trans; [exact Hz|]. apply Rmax_lub_lt; [apply T_k|apply Ht].
Qed.
(** what falls, and is driven by what dies *)
Lemma root_near m e : 0 <= m -> 0 < e -> sqrt m <= sqrt (m + e * e) <= sqrt m + e.
Proof.
  intros H He. pose proof (sqrt_pos m) as R0. split; [apply sqrt_le_1_alt; nra|].
  rewrite <- (sqrt_square (sqrt m + e)) by lra. apply sqrt_le_1_alt.
  replace ((sqrt m + e) * (sqrt m + e)) with (sqrt m * sqrt m + 2 * (sqrt m * e) + e * e) by ring. rewrite sqrt_sqrt by exact H. nra.
Qed.
Lemma root_derive f t d : 0 < f t -> is_derive f t d -> is_derive (fun u => sqrt (f u)) t (d / (2 * sqrt (f t))).
Proof.
  intros P D. pose proof (sqrt_lt_R0 _ P). evar_last; [apply (is_derive_after sqrt f); [apply is_derive_Reals, derivable_pt_lim_sqrt; exact P|exact D]|].
  field. lra.
Qed.
Lemma driven_root b d (f df : R -> R) : 0 <= d -> (forall t, 0 < t < T -> is_derive f t (df t)) -> (forall t, 0 <= t < T -> continuous f t) ->
  (forall t, 0 <= f t) -> (forall t, 0 <= t < T -> df t <= 2 * (d * exp (- (alpha c * turns a t)) * sqrt (f t)) - 2 * (b * eta a t * f t)) ->
  forall t, 0 <= t < T -> sqrt (f t) <= exp (- (b * turns a t)) * sqrt (f 0) + d * carried c b t.
Proof.
  intros Hd D C P B t Ht. set (m := fun u => exp (2 * b * turns a u) * f u).
  assert (M0 : forall u, 0 <= m u) by (intros; apply Rmult_le_pos; [left; apply exp_pos|apply P]).
  assert (Root : forall u, sqrt (m u) = exp (b * turns a u) * sqrt (f u)).
  { intros u. unfold m. replace (2 * b * turns a u) with (b * turns a u + b * turns a u) by ring. rewrite exp_plus.
    rewrite sqrt_mult by (try apply P; apply Rle_0_sqr). rewrite sqrt_square by (left; apply exp_pos). reflexivity. }
  set (g := fun u => exp ((b - alpha c) * turns a u)).
  assert (Dm : forall u, 0 < u < T -> is_derive m u (2 * b * eta a u * exp (2 * b * turns a u) * f u + exp (2 * b * turns a u) * df u)).
  { intros u Hu. apply (is_derive_times (fun u => exp (2 * b * turns a u)) f); [apply decays_derive; apply Hu|apply D; exact Hu]. }
  assert (K : forall e, 0 < e -> sqrt (m t) <= sqrt (m 0) + d * pushed (b - alpha c) t + e).
  { intros e He. assert (Pe : forall u, 0 < m u + e * e) by (intros u; specialize (M0 u); nra).
    assert (I : sqrt (m t + e * e) - d * pushed (b - alpha c) t <= sqrt (m 0 + e * e) - d * pushed (b - alpha c) 0).
    { apply (decreasing T 0 (fun u => sqrt (m u + e * e) - d * pushed (b - alpha c) u)
        (fun u => (2 * b * eta a u * exp (2 * b * turns a u) * f u + exp (2 * b * turns a u) * df u) / (2 * sqrt (m u + e * e)) - d * g u)); [| | |exact Ht]; intros u Hu.
      - apply (is_derive_minus (fun u => sqrt (m u + e * e)) (fun u => d * pushed (b - alpha c) u));
          [|apply is_derive_scal; apply pushed_derive; apply Hu].
        apply (root_derive (fun u => m u + e * e)); [apply Pe|]. evar_last; [apply (is_derive_plus m (fun _ => e * e)); [apply Dm; exact Hu|apply @is_derive_const]|].
        unfold plus, zero; simpl. ring.
      - apply (continuous_minus (fun u => sqrt (m u + e * e)) (fun u => d * pushed (b - alpha c) u)).
        + apply (continuous_comp (fun u => m u + e * e) sqrt); [|apply (continuous_sqrt (m u + e * e))].
          apply (continuous_plus m (fun _ => e * e)); [|apply continuous_const].
          apply (continuous_mult (fun u => exp (2 * b * turns a u)) f); [apply decays_continuous; apply Hu|apply C; exact Hu].
        + apply (continuous_mult (fun _ => d)); [apply continuous_const|]. apply @ex_derive_continuous. eexists. apply pushed_derive. apply Hu.
      - destruct (root_near (m u) e (M0 u) He) as [N1 N2]. pose proof (sqrt_lt_R0 _ (Pe u)) as Q. set (r := sqrt (m u + e * e)) in *.
        apply (Rmult_le_reg_r (2 * r)); [lra|]. rewrite Rmult_0_l, Rmult_minus_distr_r. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r.
        specialize (B u Hu). set (E2 := exp (2 * b * turns a u)) in *. assert (P2 : 0 < E2) by apply exp_pos.
        assert (W : E2 * df u <= E2 * (2 * (d * exp (- (alpha c * turns a u)) * sqrt (f u)) - 2 * (b * eta a u * f u))) by (apply Rmult_le_compat_l; lra).
        assert (Eg : E2 * exp (- (alpha c * turns a u)) * sqrt (f u) = g u * sqrt (m u)).
        { rewrite Root. unfold E2, g. rewrite <- exp_plus, <- Rmult_assoc, <- exp_plus. f_equal. f_equal. ring. }
        assert (Y : d * (g u * sqrt (m u)) <= d * (g u * r)) by (apply Rmult_le_compat_l; [exact Hd|]; apply Rmult_le_compat_l; [left; apply exp_pos|exact N1]).
        replace (E2 * (2 * (d * exp (- (alpha c * turns a u)) * sqrt (f u)) - 2 * (b * eta a u * f u)))
          with (2 * (d * (E2 * exp (- (alpha c * turns a u)) * sqrt (f u))) - 2 * b * eta a u * E2 * f u) in W by ring. rewrite Eg in W. lra. }
    rewrite pushed_0, Rmult_0_r, Rminus_0_r in I. destruct (root_near (m t) e (M0 t) He), (root_near (m 0) e (M0 0) He). lra. }
  assert (K0 : sqrt (m t) <= sqrt (m 0) + d * pushed (b - alpha c) t) by (apply le_epsilon; exact K).
  rewrite !Root, turns_0, Rmult_0_r, exp_0, Rmult_1_l in K0. rewrite carried_ok by exact Ht.
  apply (Rmult_le_reg_l (exp (b * turns a t))); [apply exp_pos|]. eapply Rle_trans; [exact K0|]. right.
  assert (E : exp (b * turns a t) * exp (- (b * turns a t)) = 1) by (rewrite <- exp_plus; replace (b * turns a t + - (b * turns a t)) with 0 by ring; apply exp_0).
  transitivity (exp (b * turns a t) * exp (- (b * turns a t)) * (sqrt (f 0) + d * pushed (b - alpha c) t)); [rewrite E; ring|ring].
Qed.
End Gain.

(** * The motion *)
Section Motion.
Variables (c : cascade) (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Let a := team c.
Let G := graph a.
Let N := order G.
Let T := deadline G.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis Hin : forall e, In e (edges G) -> (tgt e < N)%nat /\ (src e < N)%nat.
Hypothesis HX : tracks c h X Sl.
Let T_k := T_k a Hprot.
Lemma slides_not t j : 0 <= t < T -> (j < N)%nat -> Sl t j = 0.
Proof.
  intros Ht Hj. destruct HX as [H1 [H2 H3]].
  set (b := Agents G 1 (slope a) None [] [] [] [] [] 0 0 [] false None [] [] None).
  apply (resting b (fun _ => 0) (fun t _ j => Sl t j) Sl Hprot); [|exact Ht|exact Hj]. split; [exact H1|]. split; [exact H2|].
  intros u i Hi Hu. destruct (H3 u i Hi Hu) as [_ [C _]]. split; [|split; [exact C|intros; exact C]]. intros _. split; [|intros i' Hi'; inversion Hi'].
  apply (is_derive_ext (fun _ => 0)); [intros; symmetry; exact (Rminus_eq_0 _)|]. evar_last; [apply @is_derive_const|].
  unfold control, sum, at_, b, zero; simpl. rewrite Q2R_0. ring.
Qed.
Definition place t j := placed h (X (Rmax 0 t)) 0 j.
Definition speed t j := X (Rmax 0 t) 1%nat j.
Lemma place_at t : 0 <= t -> place t = placed h (X t) 0.
Proof. intros H. unfold place. rewrite Rmax_right by exact H. reflexivity. Qed.
Lemma speed_at t : 0 <= t -> speed t = X t 1%nat.
Proof. intros H. unfold speed. rewrite Rmax_right by exact H. reflexivity. Qed.
Lemma place_derive t j : 0 < t < T -> (j < N)%nat -> is_derive (fun u => place u j) t (speed t j).
Proof.
  intros Ht Hj. destruct HX as [_ [_ H]]. destruct (H t j Hj ltac:(apply Ht)) as [D _]. destruct (D (proj1 Ht)) as [_ D1].
  apply (near a (fun u => X u 0%nat j - h j)); [exact Ht| |].
  - intros u Hu. unfold place, placed. rewrite Rmax_right by lra. reflexivity.
  - rewrite speed_at by lra. evar_last; [apply (is_derive_minus (fun u => X u 0%nat j) (fun _ => h j)); [exact D1|apply @is_derive_const]|].
    exact (Rminus_0_r _).
Qed.
Lemma speed_derive t j : 0 < t < T -> (j < N)%nat -> is_derive (fun u => speed u j) t (steer c h (X t) t j).
Proof.
  intros Ht Hj. destruct HX as [_ [_ H]]. destruct (H t j Hj ltac:(apply Ht)) as [D _]. destruct (D (proj1 Ht)) as [D0 _].
  apply (near a (fun u => X u 1%nat j - Sl u j)); [exact Ht| |exact D0].
  intros u Hu. unfold speed. rewrite Rmax_right by lra. rewrite (slides_not u j ltac:(split; [lra|exact (proj2 Hu)]) Hj). ring.
Qed.
Lemma place_continuous t j : 0 <= t < T -> (j < N)%nat -> continuous (fun u => place u j) t.
Proof.
  intros Ht Hj. unfold place, placed. simpl. apply (continuous_minus (fun u => X (Rmax 0 u) 0%nat j) (fun _ => h j)); [|apply continuous_const].
  destruct HX as [_ [_ H]]. apply (H t j Hj (proj2 Ht)). lia.
Qed.
Lemma speed_continuous t j : 0 <= t < T -> (j < N)%nat -> continuous (fun u => speed u j) t.
Proof. intros Ht Hj. destruct HX as [_ [_ H]]. apply (H t j Hj (proj2 Ht)). lia. Qed.
Definition lags t j := speed t j + eta a t * lp c (place t) j.
Lemma lags_at t : 0 <= t -> lags t = lag c h (X t) t.
Proof. intros H. unfold lags, lag. rewrite place_at, speed_at by exact H. reflexivity. Qed.
Lemma steer_lags t j : 0 <= t < T -> steer c h (X t) t j + (theta c t * sq (eta a t) * lp c (place t) j + eta a t * lp c (speed t) j)
  = - (alpha c * eta a t) * lags t j.
Proof.
  intros Ht. pose proof (eta_pos a Hprot Hgain t (proj2 Ht)). unfold steer, lags. rewrite place_at, speed_at by lra. cbv zeta. fold a.
  unfold sq. field. lra.
Qed.
Lemma lags_derive t j : 0 < t < T -> (j < N)%nat -> is_derive (fun u => lags u j) t (- (alpha c * eta a t) * lags t j).
Proof.
  intros Ht Hj. evar_last.
  - apply (is_derive_plus (fun u => speed u j) (fun u => eta a u * lp c (place u) j)); [apply speed_derive; assumption|].
    apply (is_derive_times (eta a) (fun u => lp c (place u) j)); [apply (gain_derive c Hprot Hgain Hcap); apply Ht|].
    apply (is_derive_lap N (edges G) j place (speed t) t Hin). intros i Hi. apply place_derive; assumption.
  - unfold plus; simpl. rewrite <- steer_lags by lra. reflexivity.
Qed.
Lemma lags_continuous t j : 0 <= t < T -> (j < N)%nat -> continuous (fun u => lags u j) t.
Proof.
  intros Ht Hj. apply (continuous_plus (fun u => speed u j) (fun u => eta a u * lp c (place u) j)); [apply speed_continuous; assumption|].
  apply (continuous_mult (eta a) (fun u => lp c (place u) j)); [apply (eta_continuous a); apply Ht|].
  apply (continuous_lap N (edges G) j place t Hin). intros i Hi. apply place_continuous; assumption.
Qed.
Theorem lags_die t j : 0 <= t < T -> (j < N)%nat -> lags t j = exp (- (alpha c * turns a t)) * lags 0 j.
Proof.
  intros Ht Hj. assert (E : exp (alpha c * turns a t) * lags t j = exp (alpha c * turns a 0) * lags 0 j).
  { apply (still T (fun u => exp (alpha c * turns a u) * lags u j)); [| |exact Ht]; intros u Hu.
    - evar_last; [apply (is_derive_times (fun u => exp (alpha c * turns a u)) (fun u => lags u j));
        [apply (decays_derive c Hprot); apply Hu|apply lags_derive; assumption]|]. fold a. ring.
    - apply (continuous_mult (fun u => exp (alpha c * turns a u)) (fun u => lags u j)); [apply (decays_continuous c Hprot); apply Hu|apply lags_continuous; assumption]. }
  rewrite turns_0, Rmult_0_r, exp_0, Rmult_1_l in E. rewrite <- E, <- Rmult_assoc, <- exp_plus.
  replace (- (alpha c * turns a t) + alpha c * turns a t) with 0 by ring. rewrite exp_0. ring.
Qed.
End Motion.
