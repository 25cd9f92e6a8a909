(** How large the input gets: what no state and no coordinate exceeds, exponentials from above, the gain against a decay. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Effort.
Open Scope R_scope.

(** * [e^y] from above *)
Lemma power_derive m y : is_derive (fun y => y ^ S m / INR (fact (S m))) y (y ^ m / INR (fact m)).
Proof.
  assert (N0 : INR (fact m) <> 0) by apply INR_fact_neq_0. assert (N1 : INR (S m) <> 0) by (apply not_0_INR; lia).
  apply (is_derive_ext (fun y => / INR (fact (S m)) * y ^ S m)); [intros u; unfold Rdiv; apply Rmult_comm|]. evar_last.
  - apply is_derive_scal. apply (is_derive_pow (fun y => y)). apply is_derive_id.
  - rewrite fact_simpl, mult_INR. unfold one; simpl pred; simpl. fold (INR (S m)). field. split; assumption.
Qed.
Lemma taylor_derive m y : is_derive (fun y => sum_f_R0 (fun i => y ^ i / INR (fact i)) (S m)) y
  (sum_f_R0 (fun i => y ^ i / INR (fact i)) m).
Proof.
  induction m as [|m IH].
  - cbn [sum_f_R0]. replace (y ^ 0 / INR (fact 0)) with (0 + y ^ 0 / INR (fact 0)) by ring.
    apply (is_derive_plus (fun y => y ^ 0 / INR (fact 0)) (fun y => y ^ 1 / INR (fact 1))); [|apply power_derive].
    apply is_derive_ext with (f := fun _ => 1 / INR (fact 0)); [intros; reflexivity|]. apply (is_derive_const (1 / INR (fact 0))).
  - change (sum_f_R0 (fun i => y ^ i / INR (fact i)) (S m)) with (sum_f_R0 (fun i => y ^ i / INR (fact i)) m + y ^ S m / INR (fact (S m))).
    apply (is_derive_plus (fun y => sum_f_R0 (fun i => y ^ i / INR (fact i)) (S m)) (fun y => y ^ S (S m) / INR (fact (S (S m))))); [exact IH|apply power_derive].
Qed.
Lemma exp_taylor_above m : forall y, 0 <= y ->
  exp y <= sum_f_R0 (fun i => y ^ i / INR (fact i)) m + y ^ S m / INR (fact (S m)) * exp y.
Proof.
  induction m as [|m IH]; intros y Hy.
  - pose proof (exp_ineq1_le (- y)) as E. rewrite exp_Ropp in E. pose proof (exp_pos y) as P. simpl.
    apply (Rmult_le_compat_r (exp y)) in E; [|lra]. rewrite Rinv_l in E by lra. lra.
  - set (S0 := fun m y => sum_f_R0 (fun i => y ^ i / INR (fact i)) m). set (P := fun m y => y ^ m / INR (fact m)).
    change (exp y <= S0 (S m) y + P (S (S m)) y * exp y).
    pose proof (decreasing (y + 1) 0 (fun y => - (S0 (S m) y + P (S (S m)) y * exp y - exp y))
      (fun y => - (S0 m y + (P (S m) y * exp y + P (S (S m)) y * exp y) - exp y))) as K. cbv beta in K.
    assert (D : forall u, is_derive (fun y => - (S0 (S m) y + P (S (S m)) y * exp y - exp y)) u
      (- (S0 m u + (P (S m) u * exp u + P (S (S m)) u * exp u) - exp u))).
    { intros u. apply (is_derive_opp (fun y => S0 (S m) y + P (S (S m)) y * exp y - exp y)).
      apply (is_derive_minus (fun y => S0 (S m) y + P (S (S m)) y * exp y) exp); [|apply is_derive_exp].
      apply (is_derive_plus (S0 (S m)) (fun y => P (S (S m)) y * exp y)); [apply taylor_derive|].
      apply (is_derive_mult (P (S (S m))) exp); [apply power_derive|apply is_derive_exp|intros; apply Rmult_comm]. }
    assert (Z0 : S0 (S m) 0 + P (S (S m)) 0 * exp 0 - exp 0 = 0).
    { rewrite exp_0. unfold P. rewrite pow_ne_zero by lia. assert (Z : S0 (S m) 0 = 1).
      { unfold S0. clear. induction m as [|m IH]; [simpl; lra|]. rewrite tech5, IH, pow_ne_zero by lia. unfold Rdiv. ring. }
      rewrite Z. unfold Rdiv. ring. }
    rewrite Z0 in K. enough (- (S0 (S m) y + P (S (S m)) y * exp y - exp y) <= - 0) by lra.
    apply K; [| | |lra]; intros u Hu.
    + apply D.
    + apply @ex_derive_continuous. eexists. apply D.
    + specialize (IH u ltac:(lra)). change (exp u <= S0 m u + P (S m) u * exp u) in IH. pose proof (exp_pos u).
      assert (0 <= P (S (S m)) u).
      { unfold P. apply Rmult_le_pos; [apply pow_le; lra|]. left. apply Rinv_0_lt_compat, INR_fact_lt_0. }
      assert (0 <= P (S (S m)) u * exp u) by (apply Rmult_le_pos; lra). lra.
Qed.

(** * Neither the largest [|x_i|] nor the largest [|(L x)_i|] grows *)
Lemma plus_derive y : is_derive (fun y => sq (Rmax 0 y)) y (2 * Rmax 0 y).
Proof.
  destruct (Rtotal_order y 0) as [N|[->|P]].
  - rewrite Rmax_left by lra. apply (is_derive_ext_loc (fun _ => 0)).
    + assert (He : 0 < - y) by lra. exists (mkposreal _ He). intros u Hu.
      unfold ball in Hu; simpl in Hu; unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu. apply Rabs_def2 in Hu.
      rewrite Rmax_left by lra. unfold sq. symmetry. apply Rmult_0_l.
    + rewrite Rmult_0_r. apply (is_derive_const 0).
  - apply is_derive_Reals. intros eps He. exists (mkposreal eps He). intros h Hh Hb. simpl in Hb.
    rewrite Rplus_0_l, (Rmax_left 0 0) by lra. unfold sq.
    assert (A : Rabs h < eps) by exact Hb.
    replace ((Rmax 0 h * Rmax 0 h - 0 * 0) / h - 2 * 0) with (Rmax 0 h * Rmax 0 h / h) by (field; exact Hh).
    unfold Rmax. destruct (Rle_dec 0 h) as [L|L].
    + replace (h * h / h) with h by (field; exact Hh). exact A.
    + unfold Rdiv. rewrite Rmult_0_l, Rmult_0_l, Rabs_R0. exact He.
  - rewrite Rmax_right by lra. apply (is_derive_ext_loc (fun u => u * u)).
    + exists (mkposreal _ P). intros u Hu.
      unfold ball in Hu; simpl in Hu; unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu. apply Rabs_def2 in Hu.
      rewrite Rmax_right by lra. reflexivity.
    + auto_derive; [exact I|ring].
Qed.
(** how far beyond [M] or [-M], squared *)
Definition over (M y : R) : R := sq (Rmax 0 (y - M)) + sq (Rmax 0 (- y - M)).
Definition dover (M y : R) : R := 2 * Rmax 0 (y - M) - 2 * Rmax 0 (- y - M).
Lemma over_derive M y : is_derive (over M) y (dover M y).
Proof.
  unfold over, dover. replace (_ - _) with (2 * Rmax 0 (y - M) * 1 + 2 * Rmax 0 (- y - M) * -1) by ring.
  apply (is_derive_plus (fun y => sq (Rmax 0 (y - M))) (fun y => sq (Rmax 0 (- y - M)))).
  - evar_last. { apply (is_derive_comp (fun y => sq (Rmax 0 y)) (fun y => y - M)); [apply plus_derive|]. auto_derive; [exact I|reflexivity]. }
    unfold scal; simpl; unfold mult; simpl. ring.
  - evar_last. { apply (is_derive_comp (fun y => sq (Rmax 0 y)) (fun y => - y - M)); [apply plus_derive|]. auto_derive; [exact I|reflexivity]. }
    unfold scal; simpl; unfold mult; simpl. ring.
Qed.
Lemma over_pos M y : 0 <= over M y.
Proof. unfold over. pose proof (sq_pos (Rmax 0 (y - M))). pose proof (sq_pos (Rmax 0 (- y - M))). lra. Qed.
Lemma over_edge M w y z : 0 <= M -> - (dover M y * (Rabs w * y - w * z)) <= Rabs w * over M z.
Proof.
  intros HM. assert (W : 0 <= Rabs w) by apply Rabs_pos.
  assert (B : exists b, 0 <= b /\ Rabs z - M <= b /\ over M z = sq b).
  { unfold over, Rmax. destruct (Rle_dec 0 (z - M)) as [P|P]; destruct (Rle_dec 0 (- z - M)) as [N|N].
    - exists 0. assert (z = 0) by lra. subst z. rewrite Rabs_R0. unfold sq. repeat split; nra.
    - exists (z - M). rewrite Rabs_right by lra. unfold sq. repeat split; nra.
    - exists (- z - M). rewrite Rabs_left1 by lra. unfold sq. repeat split; nra.
    - exists 0. assert (Rabs z <= M) by (apply Rabs_le; lra). unfold sq. repeat split; nra. }
  destruct B as [b [B0 [B1 ->]]]. assert (Z : Rabs (w * z) <= Rabs w * (M + b)) by (rewrite Rabs_mult; apply Rmult_le_compat_l; lra).
  apply Rabs_le_between in Z. unfold dover, Rmax, sq.
  destruct (Rle_dec 0 (y - M)) as [P|P]; destruct (Rle_dec 0 (- y - M)) as [N|N].
  - assert (y = 0) by lra. subst y. assert (M = 0) by lra. subst M. nra.
  - set (a := y - M) in *. replace y with (M + a) in * by (unfold a; ring).
    assert (H : - (Rabs w * (M + a) - w * z) <= Rabs w * (b - a)) by lra.
    assert (2 * a * - (Rabs w * (M + a) - w * z) <= 2 * a * (Rabs w * (b - a))) by (apply Rmult_le_compat_l; lra).
    assert (0 <= Rabs w * ((a - b) * (a - b))) by (apply Rmult_le_pos; [assumption|apply Rle_0_sqr]).
    assert (0 <= Rabs w * (a * a)) by (apply Rmult_le_pos; [assumption|apply Rle_0_sqr]). nra.
  - set (a := - y - M) in *. replace y with (- M - a) in * by (unfold a; ring).
    assert (H : Rabs w * (- M - a) - w * z <= Rabs w * (b - a)) by lra.
    assert (2 * a * (Rabs w * (- M - a) - w * z) <= 2 * a * (Rabs w * (b - a))) by (apply Rmult_le_compat_l; lra).
    assert (0 <= Rabs w * ((a - b) * (a - b))) by (apply Rmult_le_pos; [assumption|apply Rle_0_sqr]).
    assert (0 <= Rabs w * (a * a)) by (apply Rmult_le_pos; [assumption|apply Rle_0_sqr]). nra.
  - assert (0 <= Rabs w * (b * b)) by (apply Rmult_le_pos; [assumption|apply Rle_0_sqr]). lra.
Qed.

Section Contraction.
Variables (es : list edge) (n : nat) (T rho1 k : R).
Hypotheses (HT : 0 < T) (H1 : 0 < rho1) (Hk : 0 < k).
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Local Notation gain := (gain T rho1 k).
Local Notation clock := (clock T rho1 k).
Variable f : R -> nat -> R.
Hypothesis Df : forall t i, 0 < t < T -> (i < n)%nat -> is_derive (fun u => f u i) t (- (gain t * lap es (f t) i)).
Hypothesis Cf : forall t i, 0 <= t < T -> (i < n)%nat -> continuous (fun u => f u i) t.
Variable M : R.
Hypothesis HM : 0 <= M.
Let phi l (x : nat -> R) := fold_right (fun i a => over M (x i) + a) 0 l.
Let dphi l (x : nat -> R) := fold_right (fun i a => dover M (x i) * - lap es x i + a) 0 l.
Lemma phi_part l x i : In i l -> over M (x i) <= phi l x.
Proof.
  unfold phi. induction l as [|j l IH]; simpl; [intros []|]. intros [->|H].
  - assert (0 <= fold_right (fun i a => over M (x i) + a) 0 l); [|lra].
    clear. induction l as [|j l IH]; simpl; [lra|]. pose proof (over_pos M (x j)). lra.
  - pose proof (over_pos M (x j)). specialize (IH H). lra.
Qed.
Let W := fold_right (fun e a => Rabs (Q2R (wt e)) + a) 0 es.
Lemma lap_over x i : (i < n)%nat -> dover M (x i) * - lap es x i <= W * phi (seq 0 n) x.
Proof.
  intros Hi. enough (G : forall l, (forall e, In e l -> (src e < n)%nat) -> dover M (x i) * - lap l x i
    <= fold_right (fun e a => Rabs (Q2R (wt e)) + a) 0 l * phi (seq 0 n) x) by (apply G; exact Hsrc).
  unfold lap. induction l as [|e l IH]; intros Hl; simpl; [rewrite Ropp_0; lra|].
  specialize (IH ltac:(intros; apply Hl; right; assumption)).
  assert (K : dover M (x i) * - lap_edge i x e <= Rabs (Q2R (wt e)) * phi (seq 0 n) x).
  { assert (P : over M (x (src e)) <= phi (seq 0 n) x).
    { apply phi_part. apply in_seq. specialize (Hl e ltac:(left; reflexivity)). lia. }
    pose proof (over_pos M (x (src e))). pose proof (Rabs_pos (Q2R (wt e))). unfold lap_edge. destruct (tgt e =? i)%nat.
    - pose proof (over_edge M (Q2R (wt e)) (x i) (x (src e)) HM) as O. assert (Rabs (Q2R (wt e)) * over M (x (src e)) <= Rabs (Q2R (wt e)) * phi (seq 0 n) x) by (apply Rmult_le_compat_l; assumption). lra.
    - assert (0 <= Rabs (Q2R (wt e)) * phi (seq 0 n) x) by (apply Rmult_le_pos; lra). lra. }
  rewrite Ropp_plus_distr, Rmult_plus_distr_l, Rmult_plus_distr_r. lra.
Qed.
Theorem contained : (forall i, (i < n)%nat -> Rabs (f 0 i) <= M) -> forall t i, 0 <= t < T -> (i < n)%nat -> Rabs (f t i) <= M.
Proof.
  intros H0. set (C := INR n * W).
  assert (D : forall t, 0 < t < T -> is_derive (fun u => phi (seq 0 n) (f u)) t (gain t * dphi (seq 0 n) (f t))).
  { intros t Ht. unfold phi, dphi. assert (L : forall i, In i (seq 0 n) -> (i < n)%nat) by (intros i Hi; apply in_seq in Hi; lia).
    induction (seq 0 n) as [|i l IH]; simpl; [rewrite Rmult_0_r; apply (is_derive_const 0)|]. rewrite Rmult_plus_distr_l.
    apply (is_derive_plus (fun u => over M (f u i)) (fun u => fold_right (fun i a => over M (f u i) + a) 0 l)).
    - evar_last. { apply (is_derive_comp (over M) (fun u => f u i)); [apply over_derive|]. apply Df; [exact Ht|apply L; left; reflexivity]. }
      unfold scal; simpl; unfold mult; simpl. ring.
    - apply IH. intros j Hj. apply L. right. assumption. }
  assert (Cp : forall t, 0 <= t < T -> continuous (fun u => phi (seq 0 n) (f u)) t).
  { clear D. intros t Ht. unfold phi. assert (L : forall i, In i (seq 0 n) -> (i < n)%nat) by (intros i Hi; apply in_seq in Hi; lia).
    induction (seq 0 n) as [|i l IH]; simpl; [apply continuous_const|].
    apply (continuous_plus (fun u => over M (f u i)) (fun u => fold_right (fun i a => over M (f u i) + a) 0 l)).
    - apply (continuous_comp (fun u => f u i) (over M)); [apply Cf; [exact Ht|apply L; left; reflexivity]|].
      apply @ex_derive_continuous. eexists. apply over_derive.
    - apply IH. intros j Hj. apply L. right. assumption. }
  assert (G : forall x, dphi (seq 0 n) x <= C * phi (seq 0 n) x).
  { clear D Cp. intros x. pose proof (lap_over x) as K. set (m := W * phi (seq 0 n) x) in K. unfold dphi, C.
    replace (INR n * W * phi (seq 0 n) x) with (INR (length (seq 0 n)) * m) by (rewrite seq_length; unfold m; ring).
    assert (L : forall i, In i (seq 0 n) -> (i < n)%nat) by (intros i Hi; apply in_seq in Hi; lia). clearbody m.
    induction (seq 0 n) as [|i l IH]; [simpl; lra|]. cbn [fold_right length]. rewrite S_INR.
    specialize (IH ltac:(intros; apply L; right; assumption)). specialize (K i (L i ltac:(left; reflexivity))). lra. }
  assert (Z : phi (seq 0 n) (f 0) = 0).
  { clear D Cp G. unfold phi. assert (L : forall i, In i (seq 0 n) -> (i < n)%nat) by (intros i Hi; apply in_seq in Hi; lia).
    induction (seq 0 n) as [|i l IH]; simpl; [reflexivity|]. rewrite IH by (intros; apply L; right; assumption).
    specialize (H0 i (L i ltac:(left; reflexivity))). apply Rabs_le_between in H0. unfold over. rewrite !Rmax_left by lra. unfold sq. ring. }
  intros t i Ht Hi.
  assert (K : exp (- (C * clock t)) * phi (seq 0 n) (f t) <= exp (- (C * clock 0)) * phi (seq 0 n) (f 0)).
  { apply (decreasing T 0 (fun t => exp (- (C * clock t)) * phi (seq 0 n) (f t)) (fun t => (- (C * gain t) * exp (- (C * clock t))) * phi (seq 0 n) (f t)
      + exp (- (C * clock t)) * (gain t * dphi (seq 0 n) (f t)))); [| | |exact Ht]; clear t Ht; intros t Ht.
    - apply (is_derive_mult (fun t => exp (- (C * clock t))) (fun t => phi (seq 0 n) (f t))); [|apply D; exact Ht|intros; apply Rmult_comm].
      evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp. apply is_derive_scal. apply clock_derive; [exact HT|apply Ht]. }
      unfold scal, opp; simpl; unfold mult; simpl. ring.
    - apply (continuous_mult (fun t => exp (- (C * clock t))) (fun t => phi (seq 0 n) (f t))); [|apply Cp; exact Ht].
      apply @ex_derive_continuous. eexists. apply is_derive_comp; [apply is_derive_exp|].
      apply @is_derive_opp. apply is_derive_scal. apply clock_derive; [exact HT|apply Ht].
    - specialize (G (f t)). assert (0 < gain t) by (apply gain_pos; auto; apply Ht). pose proof (exp_pos (- (C * clock t))) as P.
      assert (0 <= exp (- (C * clock t)) * gain t) by nra. nra. }
  rewrite Z, Rmult_0_r in K. pose proof (exp_pos (- (C * clock t))) as P.
  assert (Q : phi (seq 0 n) (f t) <= 0).
  { apply (Rmult_le_reg_l (exp (- (C * clock t)))); [exact P|]. rewrite Rmult_0_r. exact K. }
  pose proof (phi_part (seq 0 n) (f t) i ltac:(apply in_seq; lia)) as R. pose proof (sq_pos (Rmax 0 (f t i - M))) as A.
  pose proof (sq_pos (Rmax 0 (- f t i - M))) as B. unfold over in R.
  assert (A0 : Rmax 0 (f t i - M) = 0) by (apply Rsqr_0_uniq; unfold Rsqr, sq in *; lra).
  assert (B0 : Rmax 0 (- f t i - M) = 0) by (apply Rsqr_0_uniq; unfold Rsqr, sq in *; lra).
  pose proof (Rmax_r 0 (f t i - M)). pose proof (Rmax_r 0 (- f t i - M)). apply Rabs_le. lra.
Qed.
End Contraction.

Lemma is_derive_lap es n (f : R -> nat -> R) (df : nat -> R) t i : (forall e, In e es -> (src e < n)%nat) -> (i < n)%nat ->
  (forall j, (j < n)%nat -> is_derive (fun u => f u j) t (df j)) -> is_derive (fun u => lap es (f u) i) t (lap es df i).
Proof.
  intros Hs Hi H. unfold lap. induction es as [|e es IH]; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (fun u => lap_edge i (f u) e) (fun u => fold_right (fun e a => lap_edge i (f u) e + a) 0 es)).
  - unfold lap_edge. destruct (tgt e =? i)%nat; [|apply (is_derive_const 0)].
    apply (is_derive_minus (fun u => Rabs (Q2R (wt e)) * f u i) (fun u => Q2R (wt e) * f u (src e))).
    + apply is_derive_scal. apply H. assumption.
    + apply is_derive_scal. apply H, Hs. left. reflexivity.
  - apply IH. intros e' He. apply Hs. right. assumption.
Qed.
Lemma lap_scal es a x i : lap es (fun j => - (a * x j)) i = - (a * lap es x i).
Proof. unfold lap. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring. Qed.

(** * From an instant on the gain grows no faster than a decay of rate [r], [r k >= 2] *)
Lemma gain_falls T rho1 k r t0 t : 0 < T -> 0 < rho1 -> 0 < k -> 2 <= k * r -> 0 <= t0 <= t -> t < T ->
  sq (gain T rho1 k t) * exp (- (r * clock T rho1 k t)) <= sq (gain T rho1 k t0) * exp (- (r * clock T rho1 k t0)).
Proof.
  intros HT H1 Hk Hr H0 Ht. set (g := gain T rho1 k). set (s := clock T rho1 k).
  apply (decreasing T t0 (fun t => sq (g t) * exp (- (r * s t)))
    (fun t => (2 * g t * (k / sq (T - t))) * exp (- (r * s t)) + sq (g t) * (- (r * g t) * exp (- (r * s t))))); [| | |lra];
    clear t H0 Ht; intros t Ht.
  - apply (is_derive_mult (fun t => sq (g t)) (fun t => exp (- (r * s t)))); [| |intros; apply Rmult_comm].
    + unfold g, gain, sq. auto_derive; [lra|]. field. lra.
    + evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp. apply is_derive_scal. apply clock_derive; [exact HT|apply Ht]. }
      unfold scal, opp; simpl; unfold mult; simpl. fold g. ring.
  - apply @ex_derive_continuous. unfold g, s, gain, clock, sq. auto_derive. repeat split; try lra. apply Rdiv_lt_0_compat; lra.
  - pose proof (exp_pos (- (r * s t))) as P. assert (G : 0 < g t) by (apply gain_pos; auto; apply Ht).
    assert (K : k / sq (T - t) <= sq (g t) / k).
    { unfold g, gain, sq. assert (I : 0 < k / (T - t)) by (apply Rdiv_lt_0_compat; lra).
      replace (k / ((T - t) * (T - t))) with (k / (T - t) * (k / (T - t)) / k) by (field; lra).
      apply Rmult_le_compat_r; [left; apply Rinv_0_lt_compat; assumption|]. apply Rmult_le_compat; lra. }
    assert (L : 2 * (sq (g t) / k) <= r * sq (g t)).
    { replace (2 * (sq (g t) / k)) with (2 / k * sq (g t)) by (field; lra). apply Rmult_le_compat_r; [apply sq_pos|].
      apply (Rmult_le_reg_l k); [assumption|]. replace (k * (2 / k)) with 2 by (field; lra). exact Hr. }
    unfold sq at 2. replace (_ + _) with (g t * exp (- (r * s t)) * (2 * (k / sq (T - t)) - r * (g t * g t))) by ring.
    assert (0 < g t * exp (- (r * s t))) by (apply Rmult_lt_0_compat; assumption). unfold sq in *. nra.
Qed.
Lemma gain_grows T rho1 k t0 t : 0 < k -> t <= t0 -> t0 < T -> gain T rho1 k t <= gain T rho1 k t0.
Proof.
  intros Hk H0 H. unfold gain. apply Rplus_le_compat_l. apply Rmult_le_compat_l; [lra|]. apply Rinv_le_contravar; lra.
Qed.
(** what is at most [A] at all times, and its square at most [B e^(-r s)], times the gain *)
Lemma peak_of T rho1 k r t0 A B b (E : R -> R) : 0 < T -> 0 < rho1 -> 0 < k -> 2 <= k * r -> 0 <= t0 < T -> 0 <= B -> 0 <= b ->
  (t0 = 0 \/ gain T rho1 k t0 * A <= b) -> sq (gain T rho1 k t0) * (B * exp (- (r * clock T rho1 k t0))) <= sq b ->
  (forall t, 0 <= t < T -> 0 <= E t <= A /\ sq (E t) <= B * exp (- (r * clock T rho1 k t))) ->
  forall t, 0 <= t < T -> gain T rho1 k t * E t <= b.
Proof.
  intros HT H1 Hk Hr H0 HB Hb HA HE H t Ht. destruct (H t Ht) as [P Q].
  assert (G : 0 < gain T rho1 k t) by (apply gain_pos; auto; apply Ht).
  assert (L : t0 <= t -> gain T rho1 k t * E t <= b).
  { intros Hl. pose proof (gain_falls T rho1 k r t0 t HT H1 Hk Hr ltac:(lra) ltac:(lra)) as F.
    set (g := gain T rho1 k t) in *. set (y := E t) in *.
    assert (S : sq (g * y) <= sq b).
    { eapply Rle_trans; [|exact HE]. replace (sq (g * y)) with (sq g * sq y) by (unfold sq; ring).
      eapply Rle_trans; [apply Rmult_le_compat_l; [apply sq_pos|exact Q]|].
      replace (sq g * (B * exp (- (r * clock T rho1 k t)))) with (B * (sq g * exp (- (r * clock T rho1 k t)))) by ring.
      replace (sq (gain T rho1 k t0) * (B * exp (- (r * clock T rho1 k t0)))) with (B * (sq (gain T rho1 k t0) * exp (- (r * clock T rho1 k t0)))) by ring.
      apply Rmult_le_compat_l; assumption. }
    assert (0 <= g * y) by (apply Rmult_le_pos; lra). unfold sq in S. nra. }
  destruct (Rle_lt_dec t0 t) as [K|K]; [apply L; exact K|]. destruct HA as [HA|HA]; [apply L; lra|].
  eapply Rle_trans; [|exact HA]. apply Rmult_le_compat; try lra. apply gain_grows; lra.
Qed.

(** * In integers *)
Lemma term_power p : forall m j : nat, Q2R (term p j m) * (Q2R p ^ j / INR (fact j)) = Q2R p ^ (j + m) / INR (fact (j + m)).
Proof.
  induction m as [|m IH]; intros j; cbn [term].
  - rewrite Nat.add_0_r, RMicromega.Q2R_1. ring.
  - replace (j + S m)%nat with (S j + m)%nat by lia. rewrite <- IH, Q2R_mult, Q2R_div, Q2R_inject by (unfold Qeq; simpl; lia).
    assert (N0 : INR (fact j) <> 0) by apply INR_fact_neq_0.
    assert (N1 : IZR (Z.of_nat (S j)) <> 0) by (apply IZR_neq; lia).
    rewrite fact_simpl, mult_INR, (INR_IZR_INZ (S j)). simpl pow. field. split; assumption.
Qed.
Lemma Q2R_0 : Q2R 0 = 0.
Proof. unfold Q2R. simpl. lra. Qed.
Lemma nonzero q : Q2R q <> 0 -> ~ (q == 0)%Q.
Proof. intros H E. apply H. rewrite (Qeq_eqR _ _ E). apply Q2R_0. Qed.
Lemma above_ok p : 0 <= Q2R p -> Qle_bool 1 (term p 0 101) = false -> exp (Q2R p) <= Q2R (above p).
Proof.
  intros H L. assert (R : Q2R (term p 0 101) < 1).
  { rewrite <- RMicromega.Q2R_1. apply Qlt_Rlt. apply Qnot_le_lt. intros C. apply Qle_bool_iff in C. rewrite C in L. discriminate. }
  pose proof (horner_sum p 100 0) as E. pose proof (term_power p 101 0) as F. cbn [Nat.add] in E, F.
  rewrite Rplus_0_r in E. replace (Q2R p ^ 0 / INR (fact 0)) with 1 in E, F by (simpl; field). rewrite Rmult_1_r in E, F.
  pose proof (exp_taylor_above 100 (Q2R p) H) as K. rewrite <- E in K.
  replace (Q2R p ^ 101 / INR (fact 101)) with (Q2R (term p 0 101)) in K by exact F.
  unfold above. rewrite Q2R_div; [|apply nonzero; rewrite Q2R_minus, RMicromega.Q2R_1; lra].
  rewrite Q2R_minus, RMicromega.Q2R_1. apply (Rmult_le_reg_r (1 - Q2R (term p 0 101))); [lra|].
  unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
Qed.
Lemma floor_ok q : Q2R (floor q) <= Q2R q.
Proof.
  unfold floor. cbv zeta. set (r := (2 ^ 120)%Z). assert (Hr : (0 < r)%Z) by (unfold r; reflexivity). clearbody r.
  rewrite Q2R_div, !Q2R_inject by (unfold Qeq; cbn [Qnum Qden inject_Z]; lia).
  pose proof (Z.mul_div_le (Qnum q * r) (Zpos (Qden q)) eq_refl) as D. apply IZR_le in D. rewrite !mult_IZR in D.
  apply IZR_lt in Hr. assert (P : 0 < IZR (Zpos (Qden q))) by (apply IZR_lt; reflexivity). unfold Q2R.
  apply (Rmult_le_reg_l (IZR r * IZR (Zpos (Qden q)))); [nra|].
  replace (IZR r * IZR (Zpos (Qden q)) * (IZR (Qnum q * r / Zpos (Qden q)) / IZR r))
    with (IZR (Zpos (Qden q)) * IZR (Qnum q * r / Zpos (Qden q))) by (field; lra).
  replace (IZR r * IZR (Zpos (Qden q)) * (IZR (Qnum q) * / IZR (Zpos (Qden q)))) with (IZR (Qnum q) * IZR r) by (field; lra). exact D.
Qed.
Lemma greatest_ok l : forall i, Rabs (Q2R (nth i l 0%Q)) <= Q2R (greatest l).
Proof.
  assert (A : forall q, Q2R (Qabs q) = Rabs (Q2R q)).
  { intros q. unfold Q2R. destruct q as [a b]. simpl. rewrite Rabs_mult, <- abs_IZR, (Rabs_right (/ IZR (Zpos b))); [reflexivity|].
    left. apply Rinv_0_lt_compat. apply IZR_lt. reflexivity. }
  assert (P : forall l, 0 <= Q2R (greatest l)).
  { clear l. induction l as [|q l IH]; simpl; [rewrite Q2R_0; lra|]. fold (greatest l). destruct (Qle_bool _ _); [exact IH|]. rewrite A. apply Rabs_pos. }
  induction l as [|q l IH]; intros i.
  - destruct i; simpl; rewrite Q2R_0, Rabs_R0; lra.
  - change (greatest (q :: l)) with (if Qle_bool (Qabs q) (greatest l) then greatest l else Qabs q).
    destruct (Qle_bool (Qabs q) (greatest l)) eqn:E.
    + apply Qle_bool_iff, Qle_Rle in E. rewrite A in E. destruct i as [|i]; [exact E|apply IH].
    + assert (L : Q2R (greatest l) <= Q2R (Qabs q)).
      { apply Qle_Rle. apply Qlt_le_weak, Qnot_le_lt. intros C. apply Qle_bool_iff in C. rewrite C in E. discriminate. }
      rewrite A in *. destruct i as [|i]; [apply Rle_refl|]. eapply Rle_trans; [apply IH|exact L].
Qed.
Lemma span_ok c : Q2R (span c) = deadline c.
Proof. unfold span, deadline. destruct (kind c); [reflexivity|apply Q2R_plus]. Qed.
Lemma pos_Q q : pos q = true -> 0 < Q2R q.
Proof. intros H. apply Z.ltb_lt in H. unfold Q2R. apply Rmult_lt_0_compat; [apply IZR_lt; exact H|]. apply Rinv_0_lt_compat. apply IZR_lt. reflexivity. Qed.
Lemma notneg_Q q : notneg q = true -> 0 <= Q2R q.
Proof. intros H. apply Z.leb_le in H. unfold Q2R. apply Rmult_le_pos; [apply IZR_le; exact H|]. left. apply Rinv_0_lt_compat. apply IZR_lt. reflexivity. Qed.
Lemma size_dot r x M : (forall j, (j < length r)%nat -> Rabs (x j) <= M) -> 0 <= M -> Rabs (dot r x) <= IZR (size r) * M.
Proof.
  intros H HM. revert x H. induction r as [|a r IH]; intros x H; simpl; [rewrite Rabs_R0; lra|]. fold (size r).
  rewrite plus_IZR, abs_IZR. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, Rmult_plus_distr_r.
  apply Rplus_le_compat; [apply Rmult_le_compat_l; [apply Rabs_pos|apply H; simpl; lia]|].
  apply IH. intros j Hj. apply (H (S j)). simpl. lia.
Qed.

Section Ways.
Variable c : cert.
Let d := prepare c.
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypotheses (HT : 0 < T) (H1 : 0 < Q2R (rho1 c)) (Hk : 0 < k c).
Lemma way_ok A2 b rate v cst z : check_way c A2 b rate v cst z = true -> forall E : R -> R,
  (forall t, 0 <= t < T -> 0 <= E t /\ sq (E t) <= Q2R A2 /\ sq (E t) <= Q2R cst * (Q2R v * exp (- (Q2R rate * s c t)))) ->
  forall t, 0 <= t < T -> gain T (Q2R (rho1 c)) (k c) t * E t <= Q2R b.
Proof.
  unfold check_way. cbv zeta. set (w := floor (/ above z)). intros H E HE.
  apply andb_prop in H as [H H9]. apply andb_prop in H as [H H8]. apply andb_prop in H as [H H7']. apply andb_prop in H as [H H7].
  apply andb_prop in H as [H H6]. apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4].
  apply andb_prop in H as [H H3]. apply andb_prop in H as [Hz H2]. apply negb_true_iff in H2.
  apply notneg_Q in Hz, H5, H6, H7, H7'. apply (Rmult_le_pos _ _ H7) in H7'. clear H7. rename H7' into H7. apply pos_Q in H4. apply Qle_bool_iff, Qle_Rle in H3, H9.
  assert (Ek : Q2R (rho2 c * kappa c) = k c) by apply Q2R_mult.
  assert (ET : Q2R (span c) = T) by apply span_ok.
  pose proof (above_ok z Hz H2) as U. pose proof (exp_pos (Q2R z)) as Pz.
  assert (W : Q2R w <= / Q2R (above z)) by (rewrite <- Q2R_inv by (apply nonzero; lra); apply floor_ok). clearbody w.
  assert (W1 : exp (Q2R z) <= / Q2R w).
  { rewrite <- (Rinv_inv (exp (Q2R z))). apply Rinv_le_contravar; [exact H4|]. eapply Rle_trans; [exact W|]. apply Rinv_le_contravar; assumption. }
  assert (W2 : Q2R w <= 1).
  { assert (1 <= exp (Q2R z)) by (pose proof (exp_ineq1_le (Q2R z)); lra). rewrite <- (Rinv_inv (Q2R w)), <- Rinv_1. apply Rinv_le_contravar; lra. }
  set (g := (rho1 c + rho2 c * kappa c / (span c * w))%Q) in *.
  set (t0 := T * (1 - Q2R w)).
  assert (T0 : 0 <= t0 < T) by (unfold t0; split; [apply Rmult_le_pos; lra|]; assert (0 < T * Q2R w) by (apply Rmult_lt_0_compat; assumption); lra).
  assert (Eg : Q2R g = gain T (Q2R (rho1 c)) (k c) t0).
  { unfold g, gain, t0. rewrite Q2R_plus, Q2R_div by (apply nonzero; rewrite Q2R_mult, ET; apply Rgt_not_eq, Rmult_lt_0_compat; assumption).
    rewrite Ek, Q2R_mult, ET. f_equal. f_equal. ring. }
  set (y := floor (rate * (rho1 c * span c * (1 - w) + rho2 c * kappa c * z))) in *.
  assert (Hr : 0 < Q2R rate).
  { rewrite Q2R_mult, Ek in H3. replace (Q2R 2) with 2 in H3 by (unfold Q2R; simpl; lra).
    apply (Rmult_lt_reg_l (k c)); [exact Hk|]. lra. }
  assert (Y : exp (- (Q2R rate * s c t0)) <= / Q2R (horner y 0 100)).
  { destruct (horner_ok y 100 H6) as [Z0 Z1]. rewrite exp_Ropp. apply Rinv_le_contravar; [lra|]. eapply Rle_trans; [exact Z1|].
    assert (L : Q2R y <= Q2R rate * s c t0).
    { eapply Rle_trans; [apply floor_ok|]. rewrite Q2R_mult, Q2R_plus, !(Q2R_mult _ (_ - _)), (Q2R_mult (rho2 c * kappa c) z), Ek, Q2R_minus, RMicromega.Q2R_1, (Q2R_mult (rho1 c)), ET.
      apply Rmult_le_compat_l; [lra|]. unfold s, clock. fold T.
      assert (E0 : T - t0 = T * Q2R w) by (unfold t0; ring).
      replace (T / (T - t0)) with (/ Q2R w) by (rewrite E0; field; split; apply Rgt_not_eq; assumption).
      assert (Lz : Q2R z <= ln (/ Q2R w)).
      { rewrite <- (ln_exp (Q2R z)). destruct W1 as [W1|<-]; [left; apply ln_increasing; assumption|apply Rle_refl]. }
      unfold t0. assert (k c * Q2R z <= k c * ln (/ Q2R w)) by (apply Rmult_le_compat_l; lra). lra. }
    destruct L as [L|L]; [left; apply exp_increasing; exact L|rewrite L; apply Rle_refl]. }
  destruct (horner_ok y 100 H6) as [Z0 _].
  rewrite !Q2R_mult, Eg in H9. set (G := gain T (Q2R (rho1 c)) (k c) t0) in *.
  rewrite Q2R_mult, Ek in H3. replace (Q2R 2) with 2 in H3 by (unfold Q2R; simpl; lra).
  assert (G0 : 0 < G) by (apply gain_pos; auto; apply T0).
  intros t Ht. assert (A0 : 0 <= Q2R A2) by (destruct (HE t Ht) as [_ [A _]]; pose proof (sq_pos (E t)); lra).
  apply (peak_of T (Q2R (rho1 c)) (k c) (Q2R rate) t0 (sqrt (Q2R A2)) (Q2R cst * Q2R v)); auto.
  - apply orb_prop in H8 as [H8|H8].
    + left. apply Qeq_bool_eq, Qeq_eqR in H8. rewrite RMicromega.Q2R_1 in H8. unfold t0. rewrite H8. ring.
    + right. apply Qle_bool_iff, Qle_Rle in H8. rewrite !Q2R_mult, Eg in H8. fold G.
      assert (S : sq (G * sqrt (Q2R A2)) <= sq (Q2R b)).
      { unfold sq. replace (G * sqrt (Q2R A2) * (G * sqrt (Q2R A2))) with (G * G * (sqrt (Q2R A2) * sqrt (Q2R A2))) by ring.
        rewrite sqrt_sqrt by assumption. exact H8. }
      pose proof (sqrt_pos (Q2R A2)). assert (0 <= G * sqrt (Q2R A2)) by (apply Rmult_le_pos; lra). unfold sq in S. nra.
  - fold G. change (clock T (Q2R (rho1 c)) (k c) t0) with (s c t0).
    apply (Rmult_le_reg_r (Q2R (horner y 0 100))); [lra|]. unfold sq at 2. eapply Rle_trans; [|exact H9].
    set (h := Q2R (horner y 0 100)) in *. set (x := exp (- (Q2R rate * s c t0))) in *. assert (Px : 0 < x) by apply exp_pos.
    assert (X : x * h <= 1) by (apply (Rmult_le_compat_r h) in Y; [rewrite Rinv_l in Y|]; lra).
    unfold sq. replace (G * G * (Q2R cst * Q2R v * x) * h) with (G * G * (Q2R cst * Q2R v) * (x * h)) by ring.
    rewrite <- (Rmult_1_r (G * G * (Q2R cst * Q2R v))) at 2. apply Rmult_le_compat_l; [|exact X].
    apply Rmult_le_pos; [apply Rle_0_sqr|exact H7].
  - intros u Hu. destruct (HE u Hu) as [P [Q R]]. split.
    + split; [exact P|]. rewrite <- (sqrt_square (E u) P). apply sqrt_le_1_alt. exact Q.
    + change (clock T (Q2R (rho1 c)) (k c) u) with (s c u). rewrite Rmult_assoc. exact R.
Qed.
End Ways.

(** * The record at the begin, and along a motion *)
Lemma lap_times es n a x y i : (forall e, In e es -> (src e < n)%nat) -> (i < n)%nat ->
  (forall j, (j < n)%nat -> y j = a * x j) -> lap es y i = a * lap es x i.
Proof.
  intros Hs Hi H. unfold lap. induction es as [|e l IH]; simpl; [ring|].
  rewrite IH by (intros; apply Hs; right; assumption). unfold lap_edge. rewrite (H i Hi), (H (src e)) by (apply Hs; left; reflexivity).
  destruct (tgt e =? i)%nat; ring.
Qed.
Lemma dot_part l : forallb (Z.leb 0) l = true -> forall z i, (forall j, 0 <= z j) -> IZR (nth i l 0%Z) * z i <= dot l z.
Proof.
  induction l as [|a l IH]; intros H z i Hz; simpl in *; [destruct i; lra|]. apply andb_prop in H as [Ha H].
  apply Z.leb_le, IZR_le in Ha. assert (P : 0 <= IZR a * z 0%nat) by (apply Rmult_le_pos; [assumption|apply Hz]).
  assert (Q : 0 <= dot l (shift z)).
  { specialize (IH H (shift z) (length l) ltac:(intros; apply Hz)). rewrite nth_overflow in IH by lia. lra. }
  destruct i as [|i]; [lra|]. specialize (IH H (shift z) i ltac:(intros; apply Hz)). unfold shift at 1 in IH. lra.
Qed.

Lemma shares_ok r : forall p z, forallb pos p = true -> (length r <= length p)%nat ->
  0 <= Q2R (shares r p) /\ 0 <= qdot p (fun i => sq (z i)) /\ sq (dot r z) <= Q2R (shares r p) * qdot p (fun i => sq (z i)).
Proof.
  assert (P0 : forall p z, forallb pos p = true -> 0 <= qdot p (fun i => sq (z i))).
  { induction p as [|q p IH]; intros z H; simpl in *; [lra|]. apply andb_prop in H as [Hq H]. apply pos_Q in Hq.
    specialize (IH (shift z) H). change (shift (fun i => sq (z i))) with (fun i => sq (shift z i)).
    assert (0 <= Q2R q * sq (z 0%nat)) by (apply Rmult_le_pos; [lra|apply sq_pos]). lra. }
  induction r as [|a r IH]; intros p z Hp Hl.
  - simpl. rewrite Q2R_0. unfold sq. specialize (P0 p z Hp). unfold sq in P0. lra.
  - destruct p as [|q p]; [simpl in Hl; lia|]. cbn [shares dot qdot]. simpl in Hp. apply andb_prop in Hp as [Hq Hp].
    destruct (IH p (shift z) Hp ltac:(simpl in Hl; lia)) as [A0 [B0 K]]. apply pos_Q in Hq.
    rewrite Q2R_plus, Q2R_div, Q2R_inject, mult_IZR by (apply nonzero; lra).
    change (shift (fun i => sq (z i))) with (fun i => sq (shift z i)).
    set (A := Q2R (shares r p)) in *. set (B := qdot p (fun i => sq (shift z i))) in *. set (S := dot r (shift z)) in *.
    set (y := z 0%nat). set (b := IZR a). set (w := Q2R q) in *.
    assert (U0 : 0 <= b * b / w) by (apply Rmult_le_pos; [apply Rle_0_sqr|left; apply Rinv_0_lt_compat; exact Hq]).
    assert (Y0 : 0 <= w * sq y) by (apply Rmult_le_pos; [lra|apply sq_pos]).
    split; [lra|]. split; [lra|].
    assert (M1 : 0 <= b * b / w * B) by (apply Rmult_le_pos; assumption). assert (M2 : 0 <= w * sq y * A) by (apply Rmult_le_pos; assumption).
    assert (M : sq (b * y * S) <= b * b / w * B * (w * sq y * A)).
    { replace (b * b / w * B * (w * sq y * A)) with (sq (b * y) * (A * B)) by (unfold sq; field; lra).
      replace (sq (b * y * S)) with (sq (b * y) * sq S) by (unfold sq; ring). apply Rmult_le_compat_l; [apply sq_pos|exact K]. }
    assert (N : 2 * (b * y * S) <= b * b / w * B + w * sq y * A).
    { set (u := b * b / w * B) in *. set (x := w * sq y * A) in *. set (m := b * y * S) in *. unfold sq in M.
      pose proof (Rle_0_sqr (u - x)) as Q. unfold Rsqr in Q. nra. }
    replace (sq (b * y + S)) with (b * b / w * (w * sq y) + 2 * (b * y * S) + sq S) by (unfold sq; field; lra). nra.
Qed.

Section Known.
Variable c : cert.
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis Hfit : fits n (dL d) = true.
Hypothesis G : good (common (start c)) (start c) = true.
Variable x0 : nat -> R.
Hypothesis H0 : forall i, (i < n)%nat -> x0 i = Q2R (nth i (start c) 0%Q).
Let b := common (start c).
Lemma begin_ok i : (i < n)%nat -> IZR (zdot (nth i (dL d) []) (map (scaled b) (start c))) = IZR (dls d) * IZR b * lap es x0 i.
Proof.
  intros Hi. rewrite <- zdot_ok. change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite nth_map_seq by assumption.
  rewrite (lrow_ok (dls d) es i _ Hls), (lap_times es n (IZR b) x0) by (auto; intros j Hj; rewrite H0 by assumption; apply nth_scaled; exact G).
  ring.
Qed.
Lemma len_dL : length (dL d) = n.
Proof. change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite map_length. apply seq_length. Qed.
Lemma sum_ok cs z v : length cs = n -> (forall i, (i < n)%nat -> sq (z i) <= Q2R (nth i cs 0%Q) * v) ->
  norm2 n z <= Q2R (fold_right Qplus 0%Q cs) * v.
Proof.
  clear. generalize n as m. intros m Hl. revert m z Hl. induction cs as [|q cs IH]; intros m z Hl H; simpl in Hl; subst m.
  - unfold norm2. simpl. rewrite Q2R_0. lra.
  - rewrite norm2_shift. cbn [fold_right]. rewrite Q2R_plus, Rmult_plus_distr_r.
    apply Rplus_le_compat; [apply (H 0%nat); lia|]. apply IH; [reflexivity|]. intros i Hi. apply (H (S i)). lia.
Qed.
Lemma bounds_ok f v cs cn : check_constants c d f = true -> check_ends c d f = true -> bounds_of c d f = Some (v, cs, cn) ->
  Q2R v = V es (ly f) x0 /\ (forall x i, (i < n)%nat -> sq (lap es x i) <= Q2R (nth i cs 0%Q) * V es (ly f) x) /\
  forall x, norm2 n (lap es x) <= Q2R cn * V es (ly f) x.
Proof.
  intros HC HE H. unfold bounds_of in H. destruct (ly f) as [P|p g|p] eqn:El; [| |discriminate].
  2: { destruct (form (order c) (dls d) (dL d) (InEps p g)) as [[F m]|] eqn:EF; [|discriminate].
    set (cs' := map _ (dL d)) in H. destruct (_ && _) eqn:E in H; [|discriminate]. injection H as <- <- <-.
    apply andb_prop in E as [E E3]. apply andb_prop in E as [E1 E2]. apply Nat.eqb_eq in E2. rewrite forallb_forall in E3.
    destruct (form_ok n _ _ _ _ _ _ Hls eq_refl EF) as [Hm [HF HV]]. destruct (good_ok _ _ Hls) as [Hl _].
    assert (K : forall x i, (i < n)%nat -> sq (lap es x i) <= Q2R (nth i cs' 0%Q) * V es (InEps p g) x).
    { intros x i Hi. assert (Hin : In (nth i (dL d) []) (dL d)) by (apply nth_In; rewrite len_dL; exact Hi).
      unfold cs'. rewrite nth_indep with (d' := (fun r => (shares r p / inject_Z (dls d * dls d))%Q) []) by (rewrite map_length, len_dL; exact Hi).
      rewrite (map_nth (fun r => (shares r p / inject_Z (dls d * dls d))%Q)).
      specialize (E3 _ Hin). apply Z.eqb_eq in E3. destruct (fits_ok _ _ Hfit) as [_ F2]. unfold rows_le in F2. rewrite Forall_forall in F2.
      specialize (F2 _ Hin). assert (ER : dot (nth i (dL d) []) x = IZR (dls d) * lap es x i).
      { change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite nth_map_seq by exact Hi. apply lrow_ok. exact Hls. }
      set (r := nth i (dL d) []) in *. cbn [V coords]. set (z := fun j => x j - mean p g x * sgn g j).
      assert (EZ : dot r z = dot r x).
      { unfold z. rewrite (dot_ext r _ (fun j => x j + - mean p g x * sgn g j)) by (intros; ring). rewrite dot_plus, dot_scal.
        change (sgn g) with (vec_of g). rewrite zdot_ok, E3. ring. }
      destruct (shares_ok r p z E1 ltac:(unfold n in F2; lia)) as [_ [_ S]]. rewrite EZ, ER in S.
      rewrite Q2R_div, Q2R_inject, mult_IZR by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia). apply IZR_lt in Hl.
      change (fun j => sq (x j - mean p g x * sgn g j)) with (fun j => sq (z j)).
      set (l := IZR (dls d)) in *. apply (Rmult_le_reg_l (l * l)); [nra|].
      replace (l * l * (Q2R (shares r p) / (l * l) * qdot p (fun j => sq (z j)))) with (Q2R (shares r p) * qdot p (fun j => sq (z j))) by (field; lra).
      replace (l * l * sq (lap es x i)) with (sq (l * lap es x i)) by (unfold sq; ring). exact S. }
    split; [|split; [exact K|]].
    - rewrite (value_ok n F m (start c) x0 Hm HF G H0), HV. apply IZR_lt in Hm. field. lra.
    - intros x. apply sum_ok; [unfold cs'; rewrite map_length; apply len_dL|]. apply K. }
  enough (K : Q2R v = V es (InE P) x0 /\ cn = (/ lowest f)%Q /\
    forall x i, (i < n)%nat -> sq (lap es x i) <= Q2R (nth i cs 0%Q) * V es (InE P) x).
  { destruct K as [K1 [-> K2]]. split; [exact K1|]. split; [exact K2|]. intros x. destruct (ends_ok c f HE) as [L0 [L1 _]].
    specialize (L1 x). rewrite El in L1. rewrite Q2R_inv by (apply nonzero; lra).
    apply (Rmult_le_reg_l (Q2R (lowest f))); [exact L0|]. rewrite <- Rmult_assoc, Rinv_r, Rmult_1_l by lra. exact L1. }
  cbv zeta in H. fold b in H.
  set (a := common (concat P)) in *. set (PZ := map (map (scaled a)) P) in *.
  set (e := map (fun r => zdot r (map (scaled b) (start c))) (dL d)) in *.
  destruct (forallb (good a) P && (0 <? a)%Z && fits (order c) PZ) eqn:E; [|discriminate].
  apply andb_prop in E as [E HF]. apply andb_prop in E as [GP Ha]. apply Z.ltb_lt in Ha.
  destruct (fits_ok _ _ HF) as [F1 F2]. destruct (good_ok _ _ Hls) as [Hl _]. destruct (good_ok _ _ G) as [Hb _]. fold b in Hb.
  assert (B : forall x y, bil PZ x y = IZR a * qbil P x y) by (apply bil_scaled; assumption).
  assert (Ee : forall i, (i < n)%nat -> vec_of e i = IZR (dls d) * IZR b * lap es x0 i).
  { intros i Hi. unfold vec_of, e. rewrite <- begin_ok by assumption.
    rewrite nth_indep with (d' := zdot [] (map (scaled b) (start c))) by (rewrite map_length, len_dL; exact Hi).
    rewrite (map_nth (fun r => zdot r (map (scaled b) (start c)))). reflexivity. }
  set (v' := (inject_Z (zdot (lincomb e PZ) e) / inject_Z (a * (dls d * dls d) * (b * b)))%Q) in *.
  assert (EV : Q2R v' = V es (InE P) x0).
  { unfold v'. rewrite Q2R_div, !Q2R_inject by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia).
    rewrite <- zdot_ok, <- bil_vec_l.
    rewrite (bil_ext_l PZ (vec_of e) (fun i => IZR (dls d) * IZR b * lap es x0 i)) by (intros; apply Ee; unfold n; lia).
    rewrite (bil_ext_r PZ n _ (vec_of e) (fun i => IZR (dls d) * IZR b * lap es x0 i) F2) by (intros; apply Ee; assumption).
    rewrite bil_scal_l, bil_scal_r, B, !mult_IZR. apply IZR_lt in Ha, Hl, Hb. cbn [V coords]. field. lra. }
  destruct (constants f) as [cs'|] eqn:EC.
  - injection H as <- <- <-. split; [exact EV|]. split; [reflexivity|]. intros x i Hi. rewrite <- El. apply (constants_ok c f cs' HC EC x i Hi).
  - destruct (forallb (Z.leb 0) (slack PZ) && _) eqn:ES; [|discriminate]. injection H as <- <- <-. split; [exact EV|]. split; [reflexivity|].
    apply andb_prop in ES as [S1 S2]. rewrite forallb_forall in S2. intros x i Hi. specialize (S2 i ltac:(apply in_seq; unfold n in Hi; lia)).
    pose proof (slack_ok PZ (lap es x)) as K. rewrite B in K. cbn [V coords]. set (q := qbil P (lap es x) (lap es x)) in *.
    pose proof (dot_part (slack PZ) S1 (squares (lap es x)) i ltac:(intros; apply Rle_0_sqr)) as D. unfold squares at 1 in D.
    destruct (Z.ltb_spec 0 (nth i (slack PZ) 0%Z)) as [L|L].
    + assert (Li : (i < length (slack PZ))%nat).
      { destruct (Nat.lt_ge_cases i (length (slack PZ))) as [|C]; [assumption|]. rewrite nth_overflow in L by exact C. lia. }
      rewrite nth_indep with (d' := (fun y => (inject_Z (2 * a) / inject_Z y)%Q) 0%Z) by (rewrite map_length; exact Li).
      rewrite (map_nth (fun y => (inject_Z (2 * a) / inject_Z y)%Q)).
      rewrite Q2R_div, !Q2R_inject, mult_IZR by (unfold Qeq; cbn [Qnum Qden inject_Z]; lia).
      apply IZR_lt in L. set (l := IZR (nth i (slack PZ) 0%Z)) in *. apply (Rmult_le_reg_l l); [exact L|].
      replace (l * (2 * IZR a / l * q)) with (2 * (IZR a * q)) by (field; lra). unfold sq. lra.
    + assert (Z : lap es x i = 0) by (apply (lap_source n); exact S2).
      assert (N : nth i (slack PZ) 0%Z = 0%Z).
      { destruct (Nat.lt_ge_cases i (length (slack PZ))) as [C|C]; [|apply nth_overflow; exact C].
        rewrite forallb_forall in S1. specialize (S1 _ (nth_In _ 0%Z C)). apply Z.leb_le in S1. lia. }
      assert (Q0 : Q2R (nth i (map (fun y => (inject_Z (2 * a) / inject_Z y)%Q) (slack PZ)) 0%Q) = 0).
      { destruct (Nat.lt_ge_cases i (length (slack PZ))) as [C|C]; [|rewrite nth_overflow by (rewrite map_length; exact C); apply Q2R_0].
        rewrite nth_indep with (d' := (fun y => (inject_Z (2 * a) / inject_Z y)%Q) 0%Z) by (rewrite map_length; exact C).
        rewrite (map_nth (fun y => (inject_Z (2 * a) / inject_Z y)%Q)), N. unfold Q2R, Qdiv, Qmult, Qinv. cbn [Qnum Qden inject_Z].
        rewrite Z.mul_0_r. lra. }
      match goal with |- _ <= ?z * _ => replace z with 0 by (symmetry; exact Q0) end. rewrite Z. unfold sq. lra.
Qed.
End Known.

Section Held.
Variables (c : cert) (X S : R -> nat -> R).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypotheses (HT : 0 < T) (H1 : 0 < Q2R (rho1 c)) (Hk : 0 < k c).
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hfit : fits n (dL d) = true.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis HX : moves_from c X S 0.
Variables me mx : R.
Hypotheses (HE : forall j, (j < n)%nat -> Rabs (lap es (X 0) j) <= me) (HX0 : forall j, (j < n)%nat -> Rabs (X 0 j) <= mx).
Lemma held t i : 0 <= t < T -> (i < n)%nat ->
  Rabs (lap es (X t) i) <= me /\ Rabs (lap es (X t) i) <= IZR (size (nth i (dL d) [])) / IZR (dls d) * mx.
Proof.
  intros Ht Hi. destruct (good_ok _ _ Hls) as [Hl _].
  pose proof HX as [[HM _] HQ]. set (Y := fun u => X (Rmax 0 u)).
  assert (DY : forall t i, 0 < t < T -> (i < n)%nat -> is_derive (fun u => Y u i) t (- (gain T (Q2R (rho1 c)) (k c) t * lap es (Y t) i))).
  { intros u j Hu Hj. exact (Y_derive n (lap es) T _ _ X S 0 HM HQ u j Hu Hj). }
  assert (CY : forall t i, 0 <= t < T -> (i < n)%nat -> continuous (fun u => Y u i) t).
  { intros u j Hu Hj. exact (Y_cont n (lap es) T _ _ X S 0 HM HQ u j Hu Hj). }
  assert (EY : forall u, 0 <= u -> Y u = X u) by (intros u Hu; unfold Y; rewrite Rmax_right by exact Hu; reflexivity).
  split.
  - rewrite <- EY by apply Ht.
    apply (contained es n T (Q2R (rho1 c)) (k c) HT H1 Hk Hsrc (fun u j => lap es (Y u) j)); auto.
    + intros u j Hu Hj. rewrite <- lap_scal. apply (is_derive_lap es n Y); auto.
    + intros u j Hu Hj. apply (continuous_lap es n Y); auto.
    + eapply Rle_trans; [apply Rabs_pos|apply (HE i Hi)].
    + intros j Hj. rewrite EY by lra. apply HE. exact Hj.
  - assert (M0 : 0 <= mx) by (eapply Rle_trans; [apply Rabs_pos|apply (HX0 i Hi)]).
    assert (K : forall j, (j < n)%nat -> Rabs (X t j) <= mx).
    { intros j Hj. rewrite <- EY by apply Ht. apply (contained es n T (Q2R (rho1 c)) (k c) HT H1 Hk Hsrc Y); auto.
      intros m Hm. rewrite EY by lra. apply HX0. exact Hm. }
    destruct (fits_ok _ _ Hfit) as [_ F2]. assert (Hin : In (nth i (dL d) []) (dL d)) by (apply nth_In; unfold d; rewrite len_dL; exact Hi).
    unfold rows_le in F2. rewrite Forall_forall in F2. specialize (F2 _ Hin).
    pose proof (size_dot (nth i (dL d) []) (X t) _ (fun j Hj => K j (Nat.lt_le_trans _ _ _ Hj F2)) M0) as B.
    assert (E : dot (nth i (dL d) []) (X t) = IZR (dls d) * lap es (X t) i).
    { change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite nth_map_seq by exact Hi. apply lrow_ok. exact Hls. }
    apply IZR_lt in Hl. rewrite E, Rabs_mult, (Rabs_right (IZR (dls d))) in B by lra.
    apply (Rmult_le_reg_l (IZR (dls d))); [exact Hl|]. eapply Rle_trans; [exact B|]. apply Req_le. field. lra.
Qed.
End Held.
