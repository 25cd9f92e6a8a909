(** Agents that move by themselves, by drag say: their common motion solves a linear equation, and a polynomial of time is
    as near to its solutions as it is to the equation. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Main Solution Rest AgentCertificate AgentForms AgentCheck AgentFall AgentMotion AgentEnd AgentRest.
Open Scope R_scope.

(** * The equation [x^(n) + a_n x^(n-1) + .. + a_1 x = 0] *)
Section Equation.
Variables (n : nat) (al : nat -> R).
Hypothesis Hn : (0 < n)%nat.
Definition own (x : nat -> R) (i : nat) : R := if (S i =? n)%nat then - sum n (fun l => al l * x l) else x (S i).
Definition pull_size : R := 1 + sum n (fun l => Rabs (al l)).
Lemma pull_above : 1 <= pull_size.
Proof.
  unfold pull_size. assert (0 <= sum n (fun l => Rabs (al l))); [|lra].
  rewrite <- (sum_zero n (fun _ => 0)) by reflexivity. apply sum_le. intros. apply Rabs_pos.
Qed.
Lemma own_linear q x z i : own (fun l => x l + q * z l) i = own x i + q * own z i.
Proof.
  unfold own. destruct (S i =? n)%nat; [|reflexivity].
  rewrite (sum_ext n (fun l => al l * (x l + q * z l)) (fun l => al l * x l + q * (al l * z l))) by (intros; ring). rewrite sum_plus, sum_scal. ring.
Qed.
Lemma own_zero i : own (fun _ => 0) i = 0.
Proof. unfold own. destruct (S i =? n)%nat; [|reflexivity]. rewrite sum_zero; [ring|intros; ring]. Qed.
Lemma own_comb m l (Z : nat -> nat -> R) i : own (comb m l Z) i = sum m (fun u => l u * own (Z u) i).
Proof.
  unfold comb, sum. induction (seq 0 m) as [|u s IH]; cbn [fold_right]; [apply own_zero|].
  rewrite <- IH. set (g := fun j => fold_right (fun i a => l i * Z i j + a) 0 s). transitivity (own (fun j => g j + l u * Z u j) i).
  - f_equal. apply functional_extensionality. intros j. unfold g. ring.
  - rewrite own_linear. ring.
Qed.
Lemma sum_last m f : sum (S m) f = sum m f + f m.
Proof.
  unfold sum. rewrite seq_S, fold_right_app. cbn [fold_right Nat.add]. generalize (seq 0 m) as s.
  induction s as [|i s IH]; cbn [fold_right]; [ring|]. rewrite IH. ring.
Qed.
Definition energy (x : nat -> R) : R := sum n (fun i => sq (x i)).
Lemma energy_above x i : (i < n)%nat -> sq (x i) <= energy x.
Proof.
  intros Hi. unfold energy. rewrite <- (sum_at n i (fun l => sq (x l)) Hi). apply sum_le. intros l _.
  destruct (i =? l)%nat; [lra|apply Rle_0_sqr].
Qed.
Lemma energy_pos x : 0 <= energy x.
Proof. unfold energy. rewrite <- (sum_zero n (fun _ => 0)) by reflexivity. apply sum_le. intros; apply Rle_0_sqr. Qed.
Lemma own_size x : sum n (fun i => 2 * (x i * own x i)) <= 2 * pull_size * energy x.
Proof.
  pose proof (energy_pos x) as E0. set (A := sum n (fun l => Rabs (al l))).
  apply Rle_trans with (sum n (fun i => sq (x i) + ((if (S i =? n)%nat then 0 else sq (x (S i))) + (if (S i =? n)%nat then 2 * A * energy x else 0)))).
  - apply sum_le. intros i Hi. unfold own. destruct (S i =? n)%nat.
    + rewrite Rplus_0_l. pose proof (Rle_0_sqr (x i)) as S0. fold (sq (x i)) in S0. change (Rsqr (x i)) with (sq (x i)) in S0.
      assert (K : 2 * (x i * - sum n (fun l => al l * x l)) <= 2 * A * energy x); [|lra].
      replace (2 * (x i * - sum n (fun l => al l * x l))) with (sum n (fun l => - (2 * x i) * (al l * x l))) by (rewrite sum_scal; ring).
      unfold A. replace (2 * sum n (fun l => Rabs (al l)) * energy x) with (sum n (fun l => 2 * energy x * Rabs (al l))) by (rewrite sum_scal; ring).
      apply sum_le. intros l Hl. pose proof (energy_above x i Hi). pose proof (energy_above x l Hl). unfold sq in *.
      pose proof (Rle_0_sqr (x i + x l)) as S1. pose proof (Rle_0_sqr (x i - x l)) as S2. unfold Rsqr in S1, S2.
      assert (C : - (2 * energy x) <= 2 * (x i * x l) <= 2 * energy x) by lra.
      unfold Rabs. destruct (Rcase_abs (al l)); nra.
    + rewrite Rplus_0_r. pose proof (Rle_0_sqr (x i - x (S i))) as S2. unfold Rsqr, sq in *. lra.
  - rewrite !sum_plus. fold (energy x). unfold pull_size. fold A. set (B := 2 * A * energy x).
    assert (Em : n = S (pred n)) by lia. set (m := pred n) in Em.
    assert (E1 : sum n (fun i => if (S i =? n)%nat then 0 else sq (x (S i))) <= energy x).
    { unfold energy. rewrite Em. rewrite sum_last, Nat.eqb_refl, Rplus_0_r, sum_front.
      pose proof (Rle_0_sqr (x 0%nat)) as S0. change (Rsqr (x 0%nat)) with (sq (x 0%nat)) in S0.
      assert (K : sum m (fun i => if (S i =? S m)%nat then 0 else sq (x (S i))) <= sum m (fun i => sq (x (S i)))); [|lra].
      apply sum_le. intros i Hi. destruct (Nat.eqb_spec (S i) (S m)); [lia|lra]. }
    assert (E2 : sum n (fun i => if (S i =? n)%nat then B else 0) = B).
    { rewrite Em, sum_last, Nat.eqb_refl, (sum_zero m); [ring|]. intros i Hi. destruct (Nat.eqb_spec (S i) (S m)); [lia|reflexivity]. }
    rewrite E2. unfold B. lra.
Qed.

(** what obeys the equation but for little stays small *)
Section Strays.
Variables (T la De : R) (e d : R -> nat -> R).
Hypothesis Hla : 0 < la.
Hypothesis He : forall t i, 0 < t < T -> (i < n)%nat -> is_derive (fun u => e u i) t (own (e t) i + d t i).
Hypothesis Hc : forall t i, 0 <= t < T -> (i < n)%nat -> continuous (fun u => e u i) t.
Hypothesis Hd : forall t, 0 <= t < T -> sum n (fun i => sq (d t i)) <= sq (la * De).
Let ka := 2 * pull_size + la.
Theorem strays_little t : 0 <= t < T -> energy (e t) + sq De <= exp (ka * t) * (energy (e 0) + sq De).
Proof.
  intros Ht. set (f := fun t => exp (- (ka * t)) * (energy (e t) + sq De)).
  set (dE := fun t => sum n (fun i => 2 * (e t i * (own (e t) i + d t i)))).
  set (df := fun t => - ka * exp (- (ka * t)) * (energy (e t) + sq De) + exp (- (ka * t)) * dE t).
  assert (D : f t <= f 0).
  { apply (decreasing T 0 f df); [| | |exact Ht]; clear t Ht; intros t Ht.
    - apply (is_derive_mult (fun t => exp (- (ka * t))) (fun t => energy (e t) + sq De)).
      + evar_last; [apply (is_derive_comp exp (fun t => - (ka * t))); [apply is_derive_exp|apply @is_derive_opp; apply is_derive_scal; apply @is_derive_id]|].
        unfold scal, opp, one; simpl; unfold mult; simpl. ring.
      + evar_last; [apply (is_derive_plus (fun t => energy (e t)) (fun _ => sq De)); [|apply @is_derive_const]|unfold plus, zero; simpl; apply Rplus_0_r].
        unfold energy, dE. apply (is_derive_sum n (fun u i => sq (e u i))). intros i Hi.
        evar_last; [apply (is_derive_mult (fun u => e u i) (fun u => e u i)); [apply He; assumption|apply He; assumption|intros; apply Rmult_comm]|].
        unfold plus, mult; simpl. ring.
      + intros; apply Rmult_comm.
    - apply (continuous_mult (fun t => exp (- (ka * t))) (fun t => energy (e t) + sq De)).
      + apply (continuous_comp (fun t => - (ka * t)) exp); [|apply @ex_derive_continuous; eexists; apply is_derive_exp].
        apply @continuous_opp. apply (continuous_mult (fun _ => ka)); [apply continuous_const|apply continuous_id].
      + apply (continuous_plus (fun t => energy (e t)) (fun _ => sq De)); [|apply continuous_const]. unfold energy.
        apply (continuous_sum n (fun u i => sq (e u i))). intros i Hi. apply (continuous_mult (fun u => e u i) (fun u => e u i)); apply Hc; assumption.
    - unfold df. set (x := exp (- (ka * t))). assert (X0 : 0 < x) by apply exp_pos.
      assert (K : dE t <= ka * (energy (e t) + sq De)).
      { unfold dE. rewrite (sum_ext n _ (fun i => 2 * (e t i * own (e t) i) + 2 * (e t i * d t i))) by (intros; ring). rewrite sum_plus.
        pose proof (own_size (e t)) as OS. specialize (Hd t Ht).
        assert (M : sum n (fun i => 2 * (e t i * d t i)) <= la * energy (e t) + la * sq De).
        { apply Rle_trans with (sum n (fun i => la * sq (e t i) + / la * sq (d t i))).
          - apply sum_le. intros i _. pose proof (Rle_0_sqr (la * e t i - d t i)) as S0. unfold Rsqr in S0.
            apply (Rmult_le_reg_l la); [exact Hla|]. replace (la * (la * sq (e t i) + / la * sq (d t i)))
              with (la * la * (e t i * e t i) + d t i * d t i) by (unfold sq; field; lra). lra.
          - rewrite sum_plus, !sum_scal. fold (energy (e t)). apply Rplus_le_compat_l. apply (Rmult_le_reg_l la); [exact Hla|].
            rewrite <- Rmult_assoc, Rinv_r, Rmult_1_l by lra. eapply Rle_trans; [exact Hd|]. apply Req_le. unfold sq. ring. }
        pose proof pull_above. pose proof (Rle_0_sqr De) as S0. change (Rsqr De) with (sq De) in S0.
        assert (0 <= pull_size * sq De) by (apply Rmult_le_pos; lra). unfold ka. lra. }
      replace (- ka * x * (energy (e t) + sq De) + x * dE t) with (- (x * (ka * (energy (e t) + sq De) - dE t))) by ring.
      assert (0 <= x * (ka * (energy (e t) + sq De) - dE t)) by (apply Rmult_le_pos; lra). lra. }
  unfold f in D. rewrite Rmult_0_r, Ropp_0, exp_0, Rmult_1_l in D.
  apply (Rmult_le_reg_l (exp (- (ka * t)))); [apply exp_pos|]. rewrite <- Rmult_assoc, <- exp_plus.
  replace (- (ka * t) + ka * t) with 0 by ring. rewrite exp_0, Rmult_1_l. exact D.
Qed.
End Strays.

(** from every unit vector a solution starts *)
Definition unit_at (l i : nat) : R := if (l =? i)%nat then 1 else 0.
Lemma own_bounded x D i : (forall j, Rabs (x j) <= D) -> Rabs (own x i) <= pull_size * D.
Proof.
  intros H. pose proof pull_above as P. assert (D0 : 0 <= D) by (eapply Rle_trans; [apply Rabs_pos|apply (H 0%nat)]).
  unfold own. destruct (S i =? n)%nat.
  - rewrite Rabs_Ropp. apply Rle_trans with (sum n (fun l => Rabs (al l)) * D); [|unfold pull_size; nra].
    replace (sum n (fun l => Rabs (al l)) * D) with (sum n (fun l => D * Rabs (al l))) by (rewrite sum_scal; ring). unfold sum.
    induction (seq 0 n) as [|l s IH]; cbn [fold_right]; [rewrite Rabs_R0; lra|]. eapply Rle_trans; [apply Rabs_triang|].
    apply Rplus_le_compat; [|exact IH]. rewrite Rabs_mult, Rmult_comm. apply Rmult_le_compat_r; [apply Rabs_pos|apply H].
  - eapply Rle_trans; [apply H|]. nra.
Qed.
Theorem runs T l : 0 < T -> exists x : R -> nat -> R, (forall i, x 0 i = unit_at l i) /\
  (forall t i, t < T -> continuous (fun u => x (Rmax 0 u) i) t) /\ forall t i, 0 < t < T -> is_derive (fun u => x u i) t (own (x t) i).
Proof.
  intros HT. pose proof pull_above as P. destruct (solvable nat T (fun _ x => own x) (unit_at l) HT) as [x [X0 [CX DX]]].
  - intros v Hv. exists pull_size. split; [lra|]. intros t i Ht. split.
    + rewrite <- (Rmult_1_r pull_size). apply own_bounded. intros j. unfold unit_at. destruct (l =? j)%nat; [rewrite Rabs_R1|rewrite Rabs_R0]; lra.
    + intros x z D H. replace (own x i - own z i) with (own (fun j => x j + -1 * z j) i) by (rewrite own_linear; ring).
      apply own_bounded. intros j. replace (x j + -1 * z j) with (x j - z j) by ring. apply H.
  - exists x. split; [exact X0|]. split; [exact CX|]. intros t i Ht. apply DX; [exact Ht|]. intros z. apply continuous_const.
Qed.
(** of which every other is a combination *)
Theorem combined T (X : nat -> R -> nat -> R) (w : R -> nat -> R) :
  (forall l, (l < n)%nat -> (forall i, X l 0 i = unit_at l i) /\ (forall t i, 0 <= t < T -> continuous (fun u => X l u i) t) /\
    forall t i, 0 < t < T -> is_derive (fun u => X l u i) t (own (X l t) i)) ->
  (forall t i, 0 < t < T -> (i < n)%nat -> is_derive (fun u => w u i) t (own (w t) i)) ->
  (forall t i, 0 <= t < T -> (i < n)%nat -> continuous (fun u => w u i) t) ->
  forall t i, 0 <= t < T -> (i < n)%nat -> w t i = sum n (fun l => w 0 l * X l t i).
Proof.
  intros HX Dw Cw t i Ht Hi. set (z := fun t => comb n (w 0) (fun l => X l t)). set (e := fun t i => w t i + -1 * z t i).
  assert (K : energy (e t) + sq 0 <= exp ((2 * pull_size + 1) * t) * (energy (e 0) + sq 0)).
  { apply (strays_little T 1 0 e (fun _ _ => 0)); [lra| | | |exact Ht].
    - intros u j Hu Hj. rewrite Rplus_0_r. unfold e. rewrite own_linear. evar_last.
      + apply (is_derive_plus (fun u => w u j) (fun u => -1 * z u j)); [apply Dw; assumption|]. apply is_derive_scal. unfold z, comb.
        apply (is_derive_sum n (fun u l => w 0 l * X l u j)). intros l Hl. apply is_derive_scal. apply (HX l Hl). exact Hu.
      + unfold z. rewrite own_comb. unfold plus, scal; simpl; unfold mult; simpl. reflexivity.
    - intros u j Hu Hj. unfold e. apply (continuous_plus (fun u => w u j) (fun u => -1 * z u j)); [apply Cw; assumption|].
      apply (continuous_mult (fun _ => -1)); [apply continuous_const|]. unfold z, comb. apply (continuous_sum n (fun u l => w 0 l * X l u j)).
      intros l Hl. apply (continuous_mult (fun _ => w 0 l)); [apply continuous_const|]. apply (HX l Hl). exact Hu.
    - intros u _. rewrite sum_zero by (intros; unfold sq; ring). apply Rle_0_sqr. }
  assert (E0 : energy (e 0) = 0).
  { unfold energy. apply sum_zero. intros j Hj. unfold e, z, comb. rewrite (sum_ext n _ (fun l => if (j =? l)%nat then w 0 l else 0)).
    - rewrite sum_at by exact Hj. unfold sq. ring.
    - intros l Hl. rewrite (proj1 (HX l Hl)). unfold unit_at. rewrite Nat.eqb_sym. destruct (j =? l)%nat; ring. }
  rewrite E0 in K. pose proof (energy_above (e t) i Hi) as A. assert (Z : sq (e t i) <= 0) by (unfold sq in *; lra).
  assert (e t i = 0); [|unfold e, z, comb in *; lra]. unfold sq in Z. nra.
Qed.

(** * A polynomial of time whose coefficients are integers over a power of 2, however found *)
(** row [i] of a list of vectors as a polynomial, and its slope *)
Definition row (l : list (list Z)) (i : nat) : list Z := map (fun u => nth i u 0%Z) l.
Definition poly l i (s : R) : R := zeval (row l i) s.
Definition rise l i (s : R) : R := zslope (row l i) s.
Lemma poly_cons u l i s : poly (u :: l) i s = vec_of u i + s * poly l i s.
Proof. reflexivity. Qed.
Lemma rise_cons u l i s : rise (u :: l) i s = poly l i s + s * rise l i s.
Proof. reflexivity. Qed.
Lemma poly_derive l i s : is_derive (poly l i) s (rise l i s).
Proof. apply zeval_derive. Qed.
Lemma poly_1 l i : IZR (fold_right (fun v s => nth i v 0 + s)%Z 0%Z l) = poly l i 1.
Proof. unfold poly. rewrite <- zeval_1. induction l as [|u l IH]; cbn [fold_right row map]; [reflexivity|]. rewrite !plus_IZR, IH. reflexivity. Qed.
Variables (b D : Z) (g : list Z) (T : R).
Hypothesis HD : (0 < D)%Z.
Hypothesis HT : 0 < T.
Hypothesis Hb : IZR b = IZR D * T.
Hypothesis Hg : forall l, (l < n)%nat -> IZR (nth l g 0%Z) = - (IZR D * (T * al l)).
Lemma pushes_ok u i : (i < n)%nat -> IZR (nth i (pushes n b g u) 0%Z) = IZR D * T * own (vec_of u) i.
Proof.
  intros Hi. unfold pushes. rewrite nth_map_seq by exact Hi. unfold own. destruct (S i =? n)%nat; [|rewrite mult_IZR, Hb; reflexivity].
  transitivity (sum n (fun l => - (IZR D * T) * (al l * vec_of u l))); [|rewrite sum_scal; ring].
  transitivity (sum n (fun l => IZR (nth l g 0%Z) * vec_of u l)).
  - unfold sum. induction (seq 0 n) as [|l s IH]; cbn [fold_right]; [reflexivity|]. rewrite plus_IZR, mult_IZR, IH. reflexivity.
  - apply sum_ext. intros l Hl. rewrite Hg by exact Hl. ring.
Qed.
Lemma total_size_ok f : IZR (total_size n f) = sum n (fun i => Rabs (IZR (f i))).
Proof. unfold total_size, sum. induction (seq 0 n) as [|i s IH]; cbn [fold_right]; [reflexivity|]. rewrite plus_IZR, abs_IZR, IH. reflexivity. Qed.
Lemma strays_ok s : 0 <= s <= 1 -> forall l j u,
  sum n (fun i => Rabs (IZR D * (IZR j * poly l i s + s * rise l i s) - IZR D * T * own (fun q => poly (u :: l) q s) i)) <= IZR (strays n b D g j u l).
Proof.
  intros Hs. induction l as [|v l IH]; intros j u; cbn [strays]; cbv zeta.
  - rewrite total_size_ok. apply sum_le. intros i Hi. rewrite pushes_ok by exact Hi. change (poly [] i s) with 0. change (rise [] i s) with 0.
    replace (own (fun q => poly [u] q s) i) with (own (vec_of u) i)
      by (f_equal; apply functional_extensionality; intros; rewrite poly_cons; change (poly [] x s) with 0; ring).
    rewrite <- Rabs_Ropp. apply Req_le. f_equal. ring.
  - rewrite plus_IZR, total_size_ok.
    set (w := fun i => IZR D * (IZR (j + 1) * poly l i s + s * rise l i s) - IZR D * T * own (fun q => poly (v :: l) q s) i).
    apply Rle_trans with (sum n (fun i => Rabs (IZR (D * j * nth i v 0 - nth i (pushes n b g u) 0)%Z) + Rabs (w i))).
    + apply sum_le. intros i Hi. rewrite minus_IZR, !mult_IZR, pushes_ok by exact Hi.
      assert (E : own (fun q => poly (u :: v :: l) q s) i = own (vec_of u) i + s * own (fun q => poly (v :: l) q s) i).
      { rewrite <- own_linear. reflexivity. }
      rewrite E. set (o := own (fun q => poly (v :: l) q s) i) in *. rewrite poly_cons, rise_cons.
      replace (IZR D * (IZR j * (vec_of v i + s * poly l i s) + s * (poly l i s + s * rise l i s)) - IZR D * T * (own (vec_of u) i + s * o))
        with ((IZR D * IZR j * vec_of v i - IZR D * T * own (vec_of u) i) + s * w i) by (unfold w; fold o; rewrite plus_IZR; ring).
      eapply Rle_trans; [apply Rabs_triang|]. unfold vec_of at 1. apply Rplus_le_compat_l. rewrite Rabs_mult, (Rabs_right s) by lra.
      pose proof (Rabs_pos (w i)). nra.
    + rewrite sum_plus. apply Rplus_le_compat_l. apply IH.
Qed.
Lemma squares_below f m : sum m (fun i => sq (f i)) <= sq (sum m (fun i => Rabs (f i))).
Proof.
  unfold sum. induction (seq 0 m) as [|i s IH]; cbn [fold_right]; [unfold sq; lra|].
  set (A := fold_right _ 0 s) in *. set (B := fold_right (fun i a => Rabs (f i) + a) 0 s) in *.
  assert (B0 : 0 <= B) by (unfold B; clear; induction s as [|l s IH]; cbn [fold_right]; [lra|pose proof (Rabs_pos (f l)); lra]).
  assert (E : sq (f i) = Rabs (f i) * Rabs (f i)) by (unfold sq; rewrite <- Rabs_mult; symmetry; apply Rabs_right; apply Rle_ge; apply Rle_0_sqr).
  rewrite E. pose proof (Rabs_pos (f i)). assert (0 <= Rabs (f i) * B) by (apply Rmult_le_pos; assumption). unfold sq in *. lra.
Qed.
Lemma at_end (f : R -> R) C : continuous f T -> (forall t, 0 <= t < T -> f t <= C) -> f T <= C.
Proof.
  intros Cf H. apply Rnot_lt_le. intros N. pose proof (Cf _ (open_gt C (f T) N)) as [e He].
  pose proof (cond_pos e). set (t := T - Rmin (e / 2) T). assert (M : 0 < Rmin (e / 2) T) by (apply Rmin_pos; lra).
  pose proof (Rmin_l (e / 2) T). pose proof (Rmin_r (e / 2) T). specialize (H t ltac:(unfold t; lra)).
  assert (C < f t); [|lra]. apply He. unfold ball; simpl. unfold AbsRing_ball, abs, minus, plus, opp; simpl. apply Rabs_def1; unfold t; lra.
Qed.
Lemma exp_below K y : y <= INR K -> exp y <= 3 ^ K.
Proof.
  intros H. apply Rle_trans with (exp (INR K)); [apply exp_le; exact H|]. clear H y. induction K as [|K IH]; [change (INR 0) with 0; rewrite exp_0; simpl; lra|].
  rewrite S_INR, exp_plus, <- tech_pow_Rmult, Rmult_comm. apply Rmult_le_compat; [left; apply exp_pos|left; apply exp_pos|apply exp_le_3|exact IH].
Qed.
Theorem encloses p l us K (X : R -> nat -> R) : (0 < p)%Z -> T * pull_size + / 2 <= INR K -> (forall i, X 0 i = unit_at l i) ->
  (forall t i, 0 <= t <= T -> continuous (fun u => X u i) t) -> (forall t i, 0 < t < T -> is_derive (fun u => X u i) t (own (X t) i)) ->
  let u0 := map (fun i => if (l =? i)%nat then p else 0%Z) (seq 0 n) in forall i, (i < n)%nat ->
  Rabs (poly (u0 :: us) i 1 / IZR p - X T i) <= IZR (strays n b D g 1 u0 us * 3 ^ Z.of_nat K) / IZR (D * p).
Proof.
  intros Hp HK X0 CX DX u0 i Hi. apply IZR_lt in Hp. pose proof HD as D0. apply IZR_lt in D0. set (St := IZR (strays n b D g 1 u0 us)).
  set (P := fun t i => poly (u0 :: us) i (t / T) / IZR p). set (e := fun t i => X t i + -1 * P t i). set (De := St / (IZR D * IZR p)).
  set (dP := fun t i => rise (u0 :: us) i (t / T) / (T * IZR p)). set (d := fun t i => own (P t) i - dP t i).
  assert (S0 : 0 <= St).
  { pose proof (strays_ok 0 ltac:(lra) us 1%Z u0) as K0. eapply Rle_trans; [|exact K0]. rewrite <- (sum_zero n (fun _ => 0)) by reflexivity.
    apply sum_le. intros; apply Rabs_pos. }
  assert (De0 : 0 <= De) by (unfold De; apply Rmult_le_pos; [exact S0|left; apply Rinv_0_lt_compat; apply Rmult_lt_0_compat; assumption]).
  assert (DP : forall t j, is_derive (fun t => P t j) t (dP t j)).
  { intros t j. unfold P, dP. apply (is_derive_ext (fun t => / IZR p * poly (u0 :: us) j (t / T))); [intros v; apply Rmult_comm|]. evar_last.
    - apply is_derive_scal. apply (is_derive_comp (poly (u0 :: us) j) (fun t => t / T)); [apply poly_derive|].
      apply (is_derive_ext (fun t : R => / T * t)); [intros; apply Rmult_comm|]. apply is_derive_scal. apply @is_derive_id.
    - unfold scal, one; simpl; unfold mult; simpl. field. lra. }
  assert (Ce : forall t j, 0 <= t <= T -> continuous (fun t => e t j) t).
  { intros t j Ht. unfold e. apply (continuous_plus (fun t => X t j) (fun t => -1 * P t j)); [apply CX; exact Ht|].
    apply (continuous_mult (fun _ => -1)); [apply continuous_const|]. apply @ex_derive_continuous. eexists. apply DP. }
  assert (Small : forall t, 0 <= t < T -> Rabs (e t i) <= 3 ^ K * De).
  { intros t Ht. assert (E : energy (e t) + sq De <= exp ((2 * pull_size + / T) * t) * (energy (e 0) + sq De)).
    { apply (strays_little T (/ T) De e d); [apply Rinv_0_lt_compat; exact HT| | | |exact Ht].
      - intros v j Hv Hj. evar_last; [apply (is_derive_plus (fun v => X v j) (fun v => -1 * P v j)); [apply DX; exact Hv|apply is_derive_scal; apply DP]|].
        unfold e, d. rewrite own_linear. unfold plus; simpl. ring.
      - intros v j Hv _. apply Ce. lra.
      - intros v Hv. assert (V : 0 <= v / T <= 1).
        { split; [apply Rmult_le_pos; [lra|left; apply Rinv_0_lt_compat; exact HT]|]. apply (Rmult_le_reg_r T); [exact HT|].
          unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
        eapply Rle_trans; [apply squares_below|]. set (A := sum n (fun j => Rabs (d v j))).
        assert (A0 : 0 <= A) by (unfold A; rewrite <- (sum_zero n (fun _ => 0)) by reflexivity; apply sum_le; intros; apply Rabs_pos).
        assert (A1 : A <= / T * De); [|unfold sq; apply Rmult_le_compat; assumption].
        pose proof (strays_ok (v / T) V us 1%Z u0) as K0. fold St in K0. set (q := / (IZR D * T * IZR p)).
        assert (Q0 : 0 < q) by (apply Rinv_0_lt_compat; repeat apply Rmult_lt_0_compat; assumption).
        apply Rle_trans with (q * St); [|right; unfold q, De; field; lra].
        eapply Rle_trans; [|apply Rmult_le_compat_l; [left; exact Q0|exact K0]]. rewrite <- sum_scal. unfold A. apply sum_le. intros j Hj.
        rewrite <- (Rabs_right q) by lra. rewrite <- Rabs_mult, <- Rabs_Ropp. apply Req_le. f_equal. unfold d.
        assert (OP : own (P v) j = / IZR p * own (fun q => poly (u0 :: us) q (v / T)) j).
        { transitivity (own (fun k => 0 + / IZR p * poly (u0 :: us) k (v / T)) j); [f_equal; apply functional_extensionality; intros k; unfold P, Rdiv; ring|].
          rewrite (own_linear (/ IZR p) (fun _ => 0)), own_zero. ring. }
        rewrite OP. set (o := own (fun q => poly (u0 :: us) q (v / T)) j). unfold dP, q. rewrite rise_cons. field. lra. }
    assert (E0 : energy (e 0) = 0).
    { unfold energy. apply sum_zero. intros j Hj. unfold e, P. rewrite X0. replace (0 / T) with 0 by (unfold Rdiv; ring). rewrite poly_cons. unfold vec_of, u0.
      rewrite nth_map_seq by exact Hj. unfold unit_at. destruct (l =? j)%nat; unfold sq; field; lra. }
    rewrite E0, Rplus_0_l in E. pose proof (energy_above (e t) i Hi) as B. pose proof (Rle_0_sqr De) as Q0. change (Rsqr De) with (sq De) in Q0.
    assert (X1 : exp ((2 * pull_size + / T) * t) <= 3 ^ K * 3 ^ K).
    { pose proof pull_above. assert (I0 : 0 < / T) by (apply Rinv_0_lt_compat; exact HT).
      assert (Z : (2 * pull_size + / T) * t <= (2 * pull_size + / T) * T) by (apply Rmult_le_compat_l; lra).
      replace ((2 * pull_size + / T) * T) with ((T * pull_size + / 2) + (T * pull_size + / 2)) in Z by (field; lra).
      apply Rle_trans with (exp ((T * pull_size + / 2) + (T * pull_size + / 2))); [apply exp_le; exact Z|]. rewrite exp_plus.
      pose proof (exp_below K _ HK). apply Rmult_le_compat; try (left; apply exp_pos); assumption. }
    assert (P3 : 0 < 3 ^ K) by (apply pow_lt; lra).
    assert (F : sq (e t i) <= sq (3 ^ K * De)).
    { apply Rle_trans with (3 ^ K * 3 ^ K * sq De); [|right; unfold sq; ring]. assert (exp ((2 * pull_size + / T) * t) * sq De <= 3 ^ K * 3 ^ K * sq De) by (apply Rmult_le_compat_r; assumption). lra. }
    apply Rest.abs_sq; [apply Rmult_le_pos; lra|exact F]. }
  assert (End : Rabs (e T i) <= 3 ^ K * De).
  { apply Rabs_le. split.
    - apply Ropp_le_cancel. rewrite Ropp_involutive. apply (at_end (fun t => - e t i)); [apply @continuous_opp; apply Ce; lra|].
      intros t Ht. specialize (Small t Ht). apply Rabs_le_between in Small. lra.
    - apply (at_end (fun t => e t i)); [apply Ce; lra|]. intros t Ht. specialize (Small t Ht). apply Rabs_le_between in Small. lra. }
  rewrite mult_IZR, mult_IZR. fold St. rewrite <- pow_IZR.
  replace (St * 3 ^ K / (IZR D * IZR p)) with (3 ^ K * De) by (unfold De; field; lra). eapply Rle_trans; [|exact End].
  rewrite <- Rabs_Ropp. apply Req_le. f_equal. unfold e, P. replace (T / T) with 1 by (field; lra). ring.
Qed.
End Equation.

(** * From the check to it *)
Section Drag.
Variable a : agents.
Let c := graph a.
Let n := degree a.
Let d := prepare c.
Hypothesis Hedges : check_edges c (dls d) = true.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hend : check_end c d = true.
Hypothesis Hn : (0 < n)%nat.
(** where the common motion tends to, of whatever agents *)
Lemma common_ends off X i j v (f : R -> R) : (forall t, 0 <= t < deadline c -> end_state c (placed off (X t) i) j = f t) ->
  filterlim f (at_left (deadline c)) (locally v) ->
  filterlim (fun t => X t i j - away a off (X t) i j) (at_left (deadline c)) (locally ((if (i =? 0)%nat then off j else 0) + v)).
Proof.
  intros E L. destruct (T_k a Hprot) as [T0 _]. fold c in T0. set (q := if (i =? 0)%nat then off j else 0).
  apply (filterlim_ext_loc (fun t => q + f t)).
  - exists (mkposreal _ T0). intros t Bt Lt. unfold ball in Bt; simpl in Bt; unfold AbsRing_ball, abs, minus, plus, opp in Bt; simpl in Bt.
    apply Rabs_def2 in Bt. rewrite <- E by lra. unfold away, placed, q. fold c. ring.
  - apply (filterlim_comp_2 (F := at_left (deadline c)) (G := locally q) (H := locally v) (fun _ => q) f Rplus); [apply filterlim_const|exact L|].
    apply (filterlim_plus q v).
Qed.
(** solutions from the unit vectors *)
Definition solves (X : R -> nat -> R) (l : nat) : Prop := (forall i, X 0 i = unit_at l i) /\
  (forall t i, 0 <= t <= deadline c -> continuous (fun u => X u i) t) /\
  forall t i, 0 < t <= deadline c -> is_derive (fun u => X u i) t (own n (at_ (plant a)) (X t) i).
Lemma solutions : exists X, forall l, (l < n)%nat -> solves (X l) l.
Proof.
  destruct (T_k a Hprot) as [T0 _]. fold c in T0.
  assert (One : forall l, exists x, solves x l).
  { intros l. destruct (runs n (at_ (plant a)) (2 * deadline c) l ltac:(lra)) as [x [X0 [CX DX]]]. exists (fun t => x (Rmax 0 t)). split; [|split].
    - intros i. rewrite Rmax_left by lra. apply X0.
    - intros t i Ht. apply CX. lra.
    - intros t i Ht. rewrite Rmax_right by lra. apply (is_derive_ext_loc (fun u => x u i)); [|apply DX; lra].
      assert (He : 0 < t) by lra. exists (mkposreal _ He). intros u Hu. unfold ball in Hu; simpl in Hu; unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu.
      apply Rabs_def2 in Hu. rewrite Rmax_right by lra. reflexivity. }
  apply (Rest.finite_choice (fun _ _ => 0) n (fun l X => solves X l)). intros l _. apply One.
Qed.
Lemma drag_ends X off Z Sl i j : (forall l, (l < n)%nat -> solves (X l) l) -> forallb (Qeq_bool 0) (damping a) = true -> flies a off Z Sl -> (i < n)%nat -> (j < order c)%nat ->
  filterlim (fun t => Z t i j - away a off (Z t) i j) (at_left (deadline c)) (locally (outcome a (fun i l => X l (deadline c) i) off (Z 0) i j)).
Proof.
  intros HX HD HZ Hi Hj. destruct (T_k a Hprot) as [T0 _]. fold c in T0.
  set (w := fun t i => end_state c (placed off (Z (Rmax 0 t)) i) j). set (f := fun t => sum n (fun l => w 0 l * X l t i)).
  assert (EO : outcome a (fun i l => X l (deadline c) i) off (Z 0) i j = (if (i =? 0)%nat then off j else 0) + f (deadline c)).
  { unfold outcome, f. f_equal. fold n. apply sum_ext. intros l _. unfold w. rewrite Rmax_left by lra. fold c. ring. }
  rewrite EO. apply (common_ends off Z i j _ f).
  - intros t Ht. pose proof (combined n (at_ (plant a)) Hn (deadline c) X w) as K. unfold f. rewrite <- K; [unfold w; rewrite Rmax_right by lra; reflexivity| | | |exact Ht|exact Hi].
    + intros l Hl. destruct (HX l Hl) as [K0 [K1 K2]]. split; [exact K0|]. split; [intros; apply K1; lra|intros; apply K2; lra].
    + intros u v Hu Hv. exact (w_derive a off Z Sl Hedges Hend Hprot Hn HZ (fun l => zeros _ l HD) j v u Hu Hv).
    + intros u v Hu Hv. exact (w_continuous a off Z Sl Hend Hn HZ j v u Hu Hv).
  - eapply filterlim_filter_le_1; [|apply (continuous_sum n (fun t l => w 0 l * X l t i) (deadline c))].
    + intros P [e He]. exists e. intros u Hu _. apply He. exact Hu.
    + intros l Hl. apply (continuous_mult (fun _ => w 0 l)); [apply continuous_const|]. apply (HX l Hl). lra.
Qed.
Lemma drag_inside M X : check_drag a M = true -> (forall l, (l < n)%nat -> solves (X l) l) -> forall i l, (i < n)%nat -> (l < n)%nat ->
  Rabs (Q2R (fst (entry_of M i l)) - X l (deadline c) i) <= Q2R (snd (entry_of M i l)).
Proof.
  intros HM HX i l Hi Hl. unfold check_drag in HM. cbv zeta in HM. fold n c in HM. set (T := span c) in *.
  set (g0 := map (fun l => - (T * nth l (plant a) 0))%Q (seq 0 n)) in *. set (D := common (T :: g0)) in *. set (y := (_ + (1 # 2))%Q) in *.
  set (K := Z.to_nat _) in *. set (p := (2 ^ (256 + 2 * Z.of_nat K))%Z) in *. apply andb_prop in HM as [H H4]. apply andb_prop in H as [H H3].
  apply andb_prop in H as [H1 H2]. rewrite forallb_forall in H4. specialize (H4 l ltac:(apply in_seq; lia)).
  set (u := map _ _) in H4. set (us := vectors _ _ _ _ _ _ _) in *.
  rewrite forallb_forall in H4. specialize (H4 i ltac:(apply in_seq; lia)). destruct (good_ok _ _ H1) as [D0 _].
  assert (ET : Q2R T = deadline c) by apply span_ok. destruct (T_k a Hprot) as [T0 _]. fold c in T0.
  assert (Hp : (0 < p)%Z) by (apply Z.pow_pos_nonneg; lia).
  assert (Hb : IZR (scaled D T) = IZR D * deadline c).
  { rewrite <- ET. apply (scaled_ok D T D0). apply (good_ok _ _ H1). left. reflexivity. }
  assert (Hg : forall v, (v < n)%nat -> IZR (nth v (map (scaled D) g0) 0%Z) = - (IZR D * (deadline c * at_ (plant a) v))).
  { intros v Hv. rewrite nth_scaled by (apply andb_prop in H1 as [G1 G2]; simpl in G2; apply andb_prop in G2 as [_ G2]; apply andb_true_intro; split; assumption).
    unfold g0. rewrite nth_map_seq by exact Hv. rewrite Q2R_opp, Q2R_mult, ET. unfold at_. ring. }
  assert (HK : deadline c * pull_size n (at_ (plant a)) + / 2 <= INR K).
  { apply Qle_bool_iff, Qle_Rle in H3. rewrite index_ok in H3. eapply Rle_trans; [|exact H3]. unfold y. rewrite Q2R_plus, Q2R_mult, Q2R_plus, ET, Q2R_1, qsum_ok.
    assert (E2 : Q2R (1 # 2) = / 2) by (unfold Q2R; simpl; lra). rewrite E2. unfold pull_size.
    rewrite (sum_ext n (fun v => Q2R (Qabs _)) (fun v => Rabs (at_ (plant a) v))) by (intros; apply abs_ok). lra. }
  assert (NP : forall z, (0 < z)%Z -> ~ (inject_Z z == 0)%Q) by (intros z Hz Z0; unfold Qeq in Z0; simpl in Z0; lia).
  apply (near_ok _ _ _ _ H4). rewrite !Q2R_div, !Effort.Q2R_inject by (apply NP; try apply Z.mul_pos_pos; assumption). rewrite poly_1.
  destruct (HX l Hl) as [K0 [K1 K2]].
  apply (encloses n (at_ (plant a)) Hn (scaled D T) D (map (scaled D) g0) (deadline c) D0 T0 Hb Hg p l us K (X l) Hp HK K0 K1 ltac:(intros; apply K2; lra) i Hi).
Qed.
End Drag.
