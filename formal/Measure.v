(** The root of a Lyapunov function measures the state: it is a norm of the coordinates that sliding variables drive. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Certificate Checker Flow Sound Slide Solution Exist Input Margin Effort Peak Reach Driven Moving.
Open Scope R_scope.

Section Form.
Variable F : mat.
Hypothesis P : forall x, 0 <= bil F x x.
Lemma expand x y a : bil F (fun i => x i + a * y i) (fun i => x i + a * y i) = bil F x x + a * (bil F x y + bil F y x) + a * a * bil F y y.
Proof. rewrite bil_plus_l, !bil_plus_r, !bil_scal_l, !bil_scal_r. ring. Qed.
Lemma cross_below x y : bil F x y + bil F y x <= 2 * (sqrt (bil F x x) * sqrt (bil F y y)).
Proof.
  set (a := bil F x x). set (d := bil F y y). set (b := bil F x y + bil F y x).
  assert (A : 0 <= a) by apply P. assert (D : 0 <= d) by apply P.
  assert (H : forall z, 0 <= a + z * b + z * z * d) by (intros z; unfold a, b, d; rewrite <- expand; apply P).
  assert (K : b * b <= 4 * (a * d)).
  { destruct D as [D|D].
    - specialize (H (- b / (2 * d))). apply (Rmult_le_compat_l (4 * d)) in H; [|lra].
      replace (4 * d * (a + - b / (2 * d) * b + - b / (2 * d) * (- b / (2 * d)) * d)) with (4 * (a * d) - b * b) in H by (field; lra). lra.
    - rewrite <- D in *. destruct (Req_dec b 0) as [->|N]; [lra|]. specialize (H (- (a + 1) / b)).
      replace (a + - (a + 1) / b * b + - (a + 1) / b * (- (a + 1) / b) * 0) with (-1) in H by (field; exact N). lra. }
  pose proof (sqrt_pos a). pose proof (sqrt_pos d). assert (S0 : 0 <= sqrt a * sqrt d) by (apply Rmult_le_pos; assumption).
  assert (E : sqrt a * sqrt d * (sqrt a * sqrt d) = a * d).
  { replace (sqrt a * sqrt d * (sqrt a * sqrt d)) with (sqrt a * sqrt a * (sqrt d * sqrt d)) by ring. rewrite !sqrt_sqrt by assumption. reflexivity. }
  set (q := sqrt a * sqrt d) in *. apply Rnot_lt_le. intros C. assert (2 * q * (2 * q) < b * b) by (apply Rmult_le_0_lt_compat; lra). lra.
Qed.
Lemma root_plus x y : sqrt (bil F (fun i => x i + y i) (fun i => x i + y i)) <= sqrt (bil F x x) + sqrt (bil F y y).
Proof.
  pose proof (sqrt_pos (bil F x x)). pose proof (sqrt_pos (bil F y y)).
  rewrite <- (sqrt_square (sqrt (bil F x x) + sqrt (bil F y y))) by lra. apply sqrt_le_1_alt.
  pose proof (cross_below x y) as C. rewrite bil_plus_l, !bil_plus_r.
  replace ((sqrt (bil F x x) + sqrt (bil F y y)) * (sqrt (bil F x x) + sqrt (bil F y y)))
    with (sqrt (bil F x x) * sqrt (bil F x x) + 2 * (sqrt (bil F x x) * sqrt (bil F y y)) + sqrt (bil F y y) * sqrt (bil F y y)) by ring.
  rewrite !sqrt_sqrt by apply P. lra.
Qed.
End Form.
Lemma dot_sizes : forall r z a b, 0 <= b -> (forall i, (i < length r)%nat -> Rabs (z i) <= IZR (nth i a 0%Z) * b) ->
  Rabs (dot r z) <= IZR (zdot (map Z.abs r) a) * b.
Proof.
  induction r as [|u r IH]; intros z a b Hb H; [simpl; rewrite Rabs_R0; lra|]. destruct a as [|v a].
  - rewrite dot_zero; [simpl; rewrite Rabs_R0; lra|]. intros i Hi. specialize (H i Hi). destruct i; simpl in H; rewrite Rmult_0_l in H;
      apply Rabs_le_between in H; lra.
  - cbn [dot map zdot]. rewrite plus_IZR, mult_IZR, abs_IZR. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, Rmult_plus_distr_r, Rmult_assoc.
    apply Rplus_le_compat; [apply Rmult_le_compat_l; [apply Rabs_pos|apply (H 0%nat); simpl; lia]|].
    apply IH; [exact Hb|]. intros i Hi. apply (H (S i)). simpl. lia.
Qed.
Lemma bil_sizes n a' y b : 0 <= b -> (forall i, (i < n)%nat -> Rabs (y i) <= IZR (nth i a' 0%Z) * b) -> forall A x a, rows_le n A ->
  (forall i, (i < length A)%nat -> Rabs (x i) <= IZR (nth i a 0%Z) * b) ->
  Rabs (bil A x y) <= IZR (zdot (map (fun r => zdot (map Z.abs r) a') A) a) * (b * b).
Proof.
  intros Hb Hy. induction A as [|r A IH]; intros x a HR Hx; [simpl; rewrite Rabs_R0; lra|]. inversion HR as [|? ? R1 R2]; subst.
  destruct a as [|u a].
  - rewrite (bil_ext_l _ x (fun _ => 0 * 0)); [rewrite bil_scal_l; simpl; rewrite Rmult_0_l, Rabs_R0; lra|].
    intros i Hi. specialize (Hx i Hi). destruct i; simpl in Hx; rewrite Rmult_0_l in Hx; apply Rabs_le_between in Hx; lra.
  - cbn [bil map zdot]. rewrite plus_IZR, mult_IZR. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, Rmult_plus_distr_r.
    apply Rplus_le_compat.
    + pose proof (dot_sizes r y a' b Hb (fun i Hi => Hy i (Nat.lt_le_trans _ _ _ Hi R1))) as D. pose proof (Hx 0%nat ltac:(simpl; lia)) as X. simpl in X.
      rewrite (Rmult_comm (IZR (zdot _ _))). eapply Rle_trans; [apply Rmult_le_compat; [apply Rabs_pos|apply Rabs_pos|exact X|exact D]|].
      right. ring.
    + apply IH; [exact R2|]. intros i Hi. apply (Hx (S i)). simpl. lia.
Qed.
Lemma sided_ok M : 0 <= M -> forall r C x, (forall j, (j < length r)%nat -> exists a, 0 <= a <= M /\ x j = - (a * IZR (nth j C 0%Z))) ->
  Rabs (dot r x) <= IZR (sided C r) * M.
Proof.
  intros HM. assert (K : forall r C x, (forall j, (j < length r)%nat -> exists a, 0 <= a <= M /\ x j = - (a * IZR (nth j C 0%Z))) ->
    - (IZR (fst (parts_of r C)) * M) <= dot r x <= IZR (snd (parts_of r C)) * M).
  { induction r as [|u r IH]; intros C x H; [simpl; lra|]. destruct C as [|v C].
    - rewrite dot_zero; [simpl; lra|]. intros j Hj. destruct (H j Hj) as [a [_ ->]]. destruct j; simpl; ring.
    - cbn [dot parts_of]. cbv zeta. specialize (IH C (shift x) ltac:(intros j Hj; apply (H (S j)); simpl; lia)).
      destruct (H 0%nat ltac:(simpl; lia)) as [a [Ha E]]. simpl in E. rewrite E. destruct (0 <=? u * v)%Z eqn:S0; cbn [fst snd].
      + apply Z.leb_le, IZR_le in S0. rewrite mult_IZR in S0. rewrite plus_IZR, mult_IZR. set (q := IZR u * IZR v) in *.
        replace (IZR u * - (a * IZR v)) with (- (a * q)) by (unfold q; ring). assert (0 <= a * q) by (apply Rmult_le_pos; lra).
        assert (a * q <= M * q) by (apply Rmult_le_compat_r; lra). lra.
      + apply Z.leb_gt, IZR_lt in S0. rewrite mult_IZR in S0. rewrite minus_IZR, mult_IZR. set (q := IZR u * IZR v) in *.
        replace (IZR u * - (a * IZR v)) with (a * - q) by (unfold q; ring). assert (0 <= a * - q) by (apply Rmult_le_pos; lra).
        assert (a * - q <= M * - q) by (apply Rmult_le_compat_r; lra). lra. }
  intros r C x H. specialize (K r C x H). unfold sided. cbv zeta. set (p := parts_of r C) in *.
  pose proof (IZR_le _ _ (Z.le_max_l (fst p) (snd p))) as A. pose proof (IZR_le _ _ (Z.le_max_r (fst p) (snd p))) as B.
  apply Rabs_le. apply (Rmult_le_compat_r M) in A; [|exact HM]. apply (Rmult_le_compat_r M) in B; [|exact HM]. lra.
Qed.
Lemma form_size n F : rows_le n F -> (length F <= n)%nat -> exists K, 0 <= K /\ forall x M, 0 <= M ->
  (forall i, (i < n)%nat -> Rabs (x i) <= M) -> bil F x x <= K * (M * M).
Proof.
  intros HR HL. set (a := repeat 1%Z n). exists (Rabs (IZR (zdot (map (fun r => zdot (map Z.abs r) a) F) a))). split; [apply Rabs_pos|].
  intros x M HM H. assert (B : forall i, (i < n)%nat -> Rabs (x i) <= IZR (nth i a 0%Z) * M).
  { intros i Hi. unfold a. rewrite nth_indep with (d' := 1%Z) by (rewrite repeat_length; exact Hi). rewrite nth_repeat, Rmult_1_l. apply H. exact Hi. }
  pose proof (bil_sizes n a x M HM B F x a HR (fun i Hi => B i (Nat.lt_le_trans _ _ _ Hi HL))) as Q.
  eapply Rle_trans; [apply Rle_abs|]. eapply Rle_trans; [exact Q|]. apply Rmult_le_compat_r; [apply Rle_0_sqr|apply Rle_abs].
Qed.

(** * The root of a Lyapunov function *)
Section Measure.
Variables (es : list edge) (n : nat) (ly : lyap) (F : mat) (m r : R).
Hypotheses (Hm : 0 < m) (HR : rows_le n F) (HL : (length F <= n)%nat) (Hr : 0 < r).
Hypothesis HV : forall x, bil F x x / m = V es ly x.
Hypothesis V0 : forall x, 0 <= V es ly x.
Hypothesis Hdecay : forall x, r * bil F x x <= bil F (lap es x) x + bil F x (lap es x).
Let U x := sqrt (V es ly x).
Lemma form_pos x : 0 <= bil F x x.
Proof. specialize (V0 x). rewrite <- HV in V0. apply (Rmult_le_compat_r m) in V0; [|lra]. unfold Rdiv in V0. rewrite Rmult_assoc, Rinv_l in V0; lra. Qed.
Lemma U_form x : U x = sqrt (bil F x x) * sqrt (/ m).
Proof. unfold U. rewrite <- HV. unfold Rdiv. apply sqrt_mult_alt. apply form_pos. Qed.
Lemma measure_plus x y : U (fun i => x i + y i) <= U x + U y.
Proof. rewrite !U_form, <- Rmult_plus_distr_r. apply Rmult_le_compat_r; [apply sqrt_pos|]. apply root_plus. apply form_pos. Qed.
Lemma measure_size : exists K, 0 <= K /\ forall x M, 0 <= M -> (forall i, (i < n)%nat -> Rabs (x i) <= M) -> U x <= K * M.
Proof.
  destruct (form_size n F HR HL) as [K [K0 H]]. exists (sqrt K * sqrt (/ m)). split; [apply Rmult_le_pos; apply sqrt_pos|].
  intros x M HM Hx. rewrite U_form. replace (sqrt K * sqrt (/ m) * M) with (sqrt K * M * sqrt (/ m)) by ring.
  apply Rmult_le_compat_r; [apply sqrt_pos|]. rewrite <- (sqrt_square M HM) at 1. rewrite <- sqrt_mult_alt by exact K0. apply sqrt_le_1_alt. apply H; assumption.
Qed.
Lemma measure_falls x : 0 < U x -> exists C a, 0 <= C /\ 0 < a /\
  forall y, 0 <= y <= a -> U (fun i => x i - y * lap es x i) <= U x - y * (r / 2 * U x) + C * (y * y).
Proof.
  intros HU. set (u := U x) in *. exists (V es ly (lap es x) / (2 * u)), (/ r). pose proof (V0 (lap es x)) as C0.
  split; [apply Rmult_le_pos; [exact C0|left; apply Rinv_0_lt_compat; lra]|]. split; [apply Rinv_0_lt_compat; exact Hr|].
  intros y Hy. set (C := V es ly (lap es x) / (2 * u)). assert (CP : 0 <= C) by (apply Rmult_le_pos; [exact C0|left; apply Rinv_0_lt_compat; lra]).
  assert (Yr : y * r <= 1) by (pose proof (Rmult_le_compat_r r y (/ r) ltac:(lra) (proj2 Hy)) as Q; rewrite Rinv_l in Q; lra).
  assert (YU : y * (r / 2 * u) <= u / 2) by nra.
  assert (Y2 : 0 <= C * (y * y)) by (apply Rmult_le_pos; [exact CP|apply Rle_0_sqr]).
  rewrite <- (sqrt_square (u - y * (r / 2 * u) + C * (y * y))) by lra. unfold U. apply sqrt_le_1_alt.
  assert (EU : u * u = V es ly x) by (unfold u, U; apply sqrt_sqrt; apply V0).
  assert (EC : 2 * u * C = V es ly (lap es x)) by (unfold C; field; lra).
  assert (Q : V es ly (fun i => x i - y * lap es x i) <= u * u - y * (r * (u * u)) + y * y * V es ly (lap es x)).
  { rewrite EU, <- !HV. pose proof (expand F x (lap es x) (- y)) as X.
    replace (bil F (fun i => x i - y * lap es x i) (fun i => x i - y * lap es x i)) with (bil F x x + - y * (bil F x (lap es x) + bil F (lap es x) x) + - y * - y * bil F (lap es x) (lap es x)).
    2: { rewrite <- X. f_equal; apply FunctionalExtensionality.functional_extensionality; intros i; ring. }
    pose proof (Hdecay x) as D. apply (Rmult_le_reg_r m); [exact Hm|].
    replace ((bil F x x + - y * (bil F x (lap es x) + bil F (lap es x) x) + - y * - y * bil F (lap es x) (lap es x)) / m * m)
      with (bil F x x + - y * (bil F x (lap es x) + bil F (lap es x) x) + - y * - y * bil F (lap es x) (lap es x)) by (field; lra).
    replace ((bil F x x / m - y * (r * (bil F x x / m)) + y * y * (bil F (lap es x) (lap es x) / m)) * m)
      with (bil F x x - y * (r * bil F x x) + y * y * bil F (lap es x) (lap es x)) by (field; lra).
    apply (Rmult_le_compat_l y) in D; [|lra]. lra. }
  eapply Rle_trans; [exact Q|]. rewrite <- EC. set (z := - (y * (r / 2 * u)) + C * (y * y)).
  replace (u - y * (r / 2 * u) + C * (y * y)) with (u + z) by (unfold z; ring). pose proof (Rle_0_sqr z) as Z. unfold Rsqr in Z.
  replace (u * u - y * (r * (u * u)) + y * y * (2 * u * C)) with (u * u + 2 * (u * z)) by (unfold z; field). lra.
Qed.
End Measure.
