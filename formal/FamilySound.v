(** What the integers of [FamilyChecker.v] mean: members, the decrease of forms for all of them, the sizes of inputs. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input FamilyCertificate FamilyFlow FamilyChecker.
Open Scope R_scope.

Lemma nth_vadd l : forall m i, nth i (vadd l m) 0%Z = (nth i l 0 + nth i m 0)%Z.
Proof.
  induction l as [|a l IH]; intros [|b m] [|i]; simpl; try reflexivity; try lia. apply IH.
Qed.
Lemma nth_unit c : forall j i, nth i (unit j c) 0%Z = if (j =? i)%nat then c else 0%Z.
Proof.
  unfold unit. induction j as [|j IH]; intros [|i]; simpl; try reflexivity; [destruct i; reflexivity|apply IH].
Qed.
Lemma Qle_R a b : Qle_bool a b = true -> Q2R a <= Q2R b.
Proof. intros H. apply Qle_bool_iff, Qle_Rle in H. exact H. Qed.
Lemma Q2R_0 : Q2R 0 = 0. Proof. unfold Q2R. simpl. lra. Qed.
Lemma Qeq_R a b : Qeq_bool a b = true -> Q2R a = Q2R b.
Proof. intros H. apply Qeq_bool_iff, Qeq_eqR in H. exact H. Qed.
Lemma notneg_R q : notneg q = true -> 0 <= Q2R q.
Proof.
  unfold notneg, Q2R. intros H. apply Z.leb_le, IZR_le in H. apply Rmult_le_pos; [exact H|]. left.
  apply Rinv_0_lt_compat. apply IZR_lt. reflexivity.
Qed.

(** * Members *)
Definition between (e : tie) (a : R) := Q2R (lo e) <= a <= Q2R (hi e).
Lemma tie_ok n e w : check_tie n e = true -> Q2R (bottom e) <= w <= Q2R (top e) -> exists a, between e a /\
  forall x i, pulls e w x i = a * (vec_of (fvec e) i * dot (hvec e) x).
Proof.
  intros H Hw. unfold check_tie in H. apply andb_prop in H as [H H4]. apply andb_prop in H as [_ H3].
  apply Qle_R in H3. rewrite Q2R_0 in H3.
  assert (K : exists a, between e a /\ Rabs w = a /\ w = IZR (sign_of e) * a).
  { clear H4. revert H3. unfold between, lo, hi, sign_of. destruct (positive e); intros H3.
    - exists w. split; [exact Hw|]. split; [apply Rabs_right; lra|]. rewrite Rmult_1_l. reflexivity.
    - rewrite !Q2R_opp in H3. rewrite !Q2R_opp. exists (- w). split; [lra|]. split; [apply Rabs_left1; lra|lra]. }
  destruct K as [a [B [E1 E2]]]. exists a. split; [exact B|]. intros x i.
  assert (Eh : forall y, dot (hvec e) y = y (head e) - IZR (sign_of e) * y (tail e)).
  { intros y. unfold hvec. rewrite dot_vadd, !dot_unit, opp_IZR. ring. }
  assert (Ev : forall j c, IZR (nth i (unit j c) 0%Z) = if (j =? i)%nat then IZR c else 0).
  { intros j c. rewrite nth_unit. destruct (j =? i)%nat; reflexivity. }
  unfold pulls, heard, fvec, vec_of. rewrite E1. rewrite Eh. rewrite E2.
  assert (Sc : IZR (sign_of e) = 1 \/ IZR (sign_of e) = -1) by (unfold sign_of; destruct (positive e); [left|right]; reflexivity).
  destruct (mutual e).
  - unfold hvec. rewrite nth_vadd, plus_IZR, !Ev, opp_IZR. destruct Sc as [-> | ->], (head e =? i)%nat, (tail e =? i)%nat; ring.
  - rewrite Ev. destruct (head e =? i)%nat; ring.
Qed.
(** the sizes of all weights *)
Fixpoint combined_at (l : list tie) (a : nat -> R) (x : nat -> R) (i : nat) : R :=
  match l with [] => 0 | e :: l' => a O * (vec_of (fvec e) i * dot (hvec e) x) + combined_at l' (shift a) x i end.
Definition all_between (l : list tie) (a : nat -> R) := forall j e, nth_error l j = Some e -> between e (a j).
Lemma member_ok n l : forallb (check_tie n) l = true -> forall w, admits l w -> exists a, all_between l a /\
  forall x i, member l w x i = combined_at l a x i.
Proof.
  induction l as [|e l IH]; intros H w Hw.
  - exists (fun _ => 0). split; [intros [|j] e0 E; discriminate E|reflexivity].
  - simpl in H. apply andb_prop in H as [H1 H2].
    destruct (tie_ok n e (w 0%nat) H1 (Hw 0%nat e eq_refl)) as [a0 [B0 E0]].
    destruct (IH H2 (shift w) (fun j e0 E => Hw (S j) e0 E)) as [a [B E]].
    exists (fun j => match j with O => a0 | S j' => a j' end). split.
    + intros [|j] e1 E1; [injection E1 as <-; exact B0|exact (B j e1 E1)].
    + intros x i. simpl. rewrite E0, E. reflexivity.
Qed.
Lemma combined_ext l : forall a x y i, (forall e, In e l -> dot (hvec e) x = dot (hvec e) y) -> combined_at l a x i = combined_at l a y i.
Proof.
  induction l as [|e l IH]; intros a x y i H; simpl; [reflexivity|].
  rewrite (H e) by (left; reflexivity). rewrite (IH _ x y) by (intros; apply H; right; assumption). reflexivity.
Qed.

(** * The decrease *)
Lemma bil_vec_r A f x : bil A x (vec_of f) = dot (map (fun r => zdot r f) A) x.
Proof.
  revert x. induction A as [|r A IH]; intros x; simpl; [reflexivity|]. rewrite IH, zdot_ok. ring.
Qed.
Lemma grad_ok F f x : bil F (vec_of f) x + bil F x (vec_of f) = dot (grad F f) x.
Proof. unfold grad. rewrite dot_vadd, <- bil_vec_l, bil_vec_r. reflexivity. Qed.
Lemma combined_grad F n l : rows_le n F -> (length F <= n)%nat -> forall a x,
  bil F (combined_at l a x) x + bil F x (combined_at l a x) =
  (fix go l a := match l with [] => 0 | e :: l' => a O * (dot (hvec e) x * dot (grad F (fvec e)) x) + go l' (shift a) end) l a.
Proof.
  intros HR HL. induction l as [|e l IH]; intros a x.
  - rewrite (bil_ext_l F _ (fun _ => 0 * 0)) by (intros; simpl; ring). rewrite (bil_scal_l F 0 (fun _ => 0)).
    rewrite (bil_ext_r F n x _ (fun _ => 0 * 0) HR) by (intros; simpl; ring). rewrite (bil_scal_r F 0 x (fun _ => 0)). ring.
  - rewrite <- IH.
    rewrite (bil_ext_l F (combined_at (e :: l) a x) (fun i => (a O * dot (hvec e) x) * vec_of (fvec e) i + combined_at l (shift a) x i))
      by (intros; simpl; ring).
    rewrite (bil_ext_r F n x (combined_at (e :: l) a x) (fun i => (a O * dot (hvec e) x) * vec_of (fvec e) i + combined_at l (shift a) x i) HR)
      by (intros; simpl; ring).
    rewrite bil_plus_l, bil_plus_r, bil_scal_l, bil_scal_r, <- grad_ok. ring.
Qed.
Fixpoint power (F : mat) (l : list tie) (a : nat -> R) (x : nat -> R) : R :=
  match l with [] => 0 | e :: l' => a O * (dot (hvec e) x * dot (grad F (fvec e)) x) + power F l' (shift a) x end.
Lemma power_ok F n l a x : rows_le n F -> (length F <= n)%nat ->
  bil F (combined_at l a x) x + bil F x (combined_at l a x) = power F l a x.
Proof. intros HR HL. rewrite (combined_grad F n l HR HL). revert a. induction l as [|e l IH]; intros a; simpl; [reflexivity|]. rewrite IH. reflexivity. Qed.

Lemma hvec_len n e : check_tie n e = true -> (length (hvec e) <= n)%nat.
Proof.
  intros H. unfold check_tie in H. apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [H1 H2].
  apply Nat.ltb_lt in H1, H2. unfold hvec.
  assert (L : forall l m, length (vadd l m) = Nat.max (length l) (length m)).
  { induction l as [|a l IH]; intros [|b m]; simpl; try reflexivity. rewrite IH. reflexivity. }
  rewrite L. unfold unit. rewrite !app_length, !repeat_length. simpl. lia.
Qed.
Definition same_to (n : nat) (x y : nat -> R) := forall i, (i < n)%nat -> x i = y i.
Lemma build_ok n F dq : forall l k a, (n <= k)%nat -> good dq (terms l) = true -> forallb (check_tie n) (map fst l) = true ->
  forallb (check_term n F) l = true -> all_between (map fst l) a -> forall x, exists z, same_to k x z /\
  bil (build dq F k l) z z <= IZR dq * power F (map fst l) a x.
Proof.
  induction l as [|[e [tau|]] l IH]; intros k a Hk G HT HC HA x; simpl in HT, HC; cbn [map fst].
  - exists x. split; [intros i _; reflexivity|]. simpl. lra.
  - apply andb_prop in HT as [HT1 HT2]. apply andb_prop in HC as [HC1 HC2]. cbn [build power].
    unfold check_term in HC1. cbn [fst snd] in HC1. apply andb_prop in HC1 as [HG Ht]. apply Nat.leb_le in HG. apply notneg_R in Ht.
    destruct (good_ok _ _ G) as [D0 D1].
    assert (S1 : IZR (scaled dq (middle e)) = IZR dq * Q2R (middle e)) by (apply scaled_ok; [exact D0|apply D1; left; reflexivity]).
    assert (S2 : IZR (scaled dq (radius e)) = IZR dq * Q2R (radius e)) by (apply scaled_ok; [exact D0|apply D1; right; left; reflexivity]).
    assert (S3 : IZR (scaled dq tau) = IZR dq * Q2R tau) by (apply scaled_ok; [exact D0|apply D1; right; right; left; reflexivity]).
    assert (G' : good dq (terms l) = true).
    { apply andb_true_intro. split; [apply Z.ltb_lt; exact D0|]. apply forallb_forall. intros q Hq. apply D1. right; right; right. exact Hq. }
    pose proof (HA 0%nat e eq_refl) as B. unfold between in B. apply IZR_lt in D0.
    set (r := Q2R (radius e)). set (m := Q2R (middle e)).
    assert (Er : r = (Q2R (hi e) - Q2R (lo e)) / 2) by (unfold r, radius; rewrite Q2R_mult, Q2R_minus; unfold Q2R at 3; simpl; lra).
    assert (Em : m = (Q2R (hi e) + Q2R (lo e)) / 2) by (unfold m, middle; rewrite Q2R_mult, Q2R_plus; unfold Q2R at 3; simpl; lra).
    set (h := dot (hvec e) x). set (g := dot (grad F (fvec e)) x).
    assert (Y : exists y, r * y = (a 0%nat - m) * h /\ y * y <= h * h).
    { destruct (Req_dec r 0) as [R0|R0].
      - exists 0. split; [|nra]. rewrite R0. assert (a 0%nat - m = 0) by lra. rewrite H. ring.
      - exists ((a 0%nat - m) / r * h). split; [field; exact R0|].
        assert (Q : Rabs ((a 0%nat - m) / r) <= 1).
        { unfold Rdiv. rewrite Rabs_mult. assert (P : 0 < r) by lra. rewrite Rabs_inv, (Rabs_right r) by lra.
          apply (Rmult_le_reg_r r); [exact P|]. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r, Rmult_1_l. apply Rabs_le. lra. }
        apply Rabs_le_between in Q. set (q := (a 0%nat - m) / r) in *.
        replace (q * h * (q * h)) with (q * q * (h * h)) by ring. assert (q * q <= 1) by nra. nra. }
    destruct Y as [y [Y1 Y2]].
    destruct (IH (S k) (shift a) ltac:(lia) G' HT2 HC2 (fun j e0 E => HA (S j) e0 E) (fun i => if (i =? k)%nat then y else x i)) as [z [Z1 Z2]].
    assert (Zk : z k = y) by (rewrite <- Z1 by lia; rewrite Nat.eqb_refl; reflexivity).
    assert (Zx : same_to k x z).
    { intros i Hi. rewrite <- Z1 by lia. destruct (Nat.eqb_spec i k); [lia|reflexivity]. }
    exists z. split; [exact Zx|].
    assert (Pw : power F (map fst l) (shift a) (fun i => if (i =? k)%nat then y else x i) = power F (map fst l) (shift a) x).
    { assert (N : same_to n (fun i => if (i =? k)%nat then y else x i) x) by (intros i Hi; destruct (Nat.eqb_spec i k); [lia|reflexivity]).
      clear - HT2 HC2 N. generalize (shift a). induction l as [|[e0 t0] l IH]; intros b; simpl; [reflexivity|].
      simpl in HT2, HC2. apply andb_prop in HT2 as [A1 A2]. apply andb_prop in HC2 as [B1 B2].
      rewrite (IH A2 B2). unfold check_term in B1. cbn [fst] in B1. apply andb_prop in B1 as [B1 _]. apply Nat.leb_le in B1.
      pose proof (hvec_len n e0 A1) as Lh.
      rewrite (dot_ext (hvec e0) _ x) by (intros; apply N; lia). rewrite (dot_ext (grad F (fvec e0)) _ x) by (intros; apply N; lia). reflexivity. }
    rewrite Pw in Z2. rewrite !bil_madd, !bil_outer, !dot_vadd, !dot_scale, !dot_unit, S1, S2, opp_IZR, S3.
    pose proof (hvec_len n e HT1) as Lh.
    rewrite <- (dot_ext (hvec e) x z) by (intros; apply Zx; lia). rewrite <- (dot_ext (grad F (fvec e)) x z) by (intros; apply Zx; lia).
    fold h g r m. rewrite Zk. set (t := Q2R tau) in *. set (d := IZR dq) in *.
    replace (h * (d * m * g + - (d * t) * h) + 1 * y * (d * r * g + d * t * y) + bil (build dq F (S k) l) z z)
      with (d * (m * (h * g) + (r * y) * g + t * (y * y - h * h)) + bil (build dq F (S k) l) z z) by ring.
    rewrite Y1. assert (t * (y * y - h * h) <= 0) by nra. nra.
  - apply andb_prop in HT as [HT1 HT2]. apply andb_prop in HC as [HC1 HC2]. cbn [build power].
    unfold check_term in HC1. cbn [fst snd] in HC1. apply andb_prop in HC1 as [HG Ht]. apply Nat.leb_le in HG.
    destruct (good_ok _ _ G) as [D0 D1].
    assert (S1 : IZR (scaled dq (lo e)) = IZR dq * Q2R (lo e)) by (apply scaled_ok; [exact D0|apply D1; left; reflexivity]).
    assert (G' : good dq (terms l) = true).
    { apply andb_true_intro. split; [apply Z.ltb_lt; exact D0|]. apply forallb_forall. intros q Hq. apply D1. right. exact Hq. }
    pose proof (HA 0%nat e eq_refl) as B. unfold between in B. apply IZR_lt in D0.
    destruct (IH k (shift a) Hk G' HT2 HC2 (fun j e0 E => HA (S j) e0 E) x) as [z [Z1 Z2]]. exists z. split; [exact Z1|].
    rewrite bil_madd, bil_outer, dot_scale, S1. pose proof (hvec_len n e HT1) as Lh.
    rewrite <- (dot_ext (hvec e) x z) by (intros; apply Z1; lia). rewrite <- (dot_ext (grad F (fvec e)) x z) by (intros; apply Z1; lia).
    set (h := dot (hvec e) x). set (g := dot (grad F (fvec e)) x). set (d := IZR dq) in *.
    assert (K : Q2R (lo e) * (h * g) <= a 0%nat * (h * g)).
    { apply orb_prop in Ht as [Ht|Ht].
      - apply Qeq_R in Ht. replace (a 0%nat) with (Q2R (lo e)) by lra. lra.
      - apply andb_prop in Ht as [Ht1 Ht2]. apply Z.leb_le, IZR_le in Ht1. pose proof (zero_vec_ok _ Ht2 x) as Zv.
        rewrite dot_vadd, dot_scale, opp_IZR in Zv. fold g h in Zv. set (c := IZR (nth (head e) (grad F (fvec e)) 0%Z)) in *.
        assert (Eg : g = c * h) by lra. rewrite Eg. assert (0 <= h * (c * h)) by nra. nra. }
    nra.
Qed.
Theorem decay_ok n sw fw F b l : check_decay n sw fw F b l = true -> fits n F = true -> forallb (check_tie n) (map fst l) = true ->
  forall w x, admits (map fst l) w -> Q2R b * bil F x x <= bil F (member (map fst l) w x) x + bil F x (member (map fst l) w x).
Proof.
  intros H HF HT w x Hw. unfold check_decay in H. cbv zeta in H. set (dq := common _) in *.
  apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. destruct (fits_ok _ _ HF) as [F1 F2].
  destruct (member_ok n _ HT w Hw) as [a [B E]].
  rewrite (bil_ext_l F (member (map fst l) w x) (combined_at (map fst l) a x)) by (intros; apply E).
  rewrite (bil_ext_r F n x (member (map fst l) w x) (combined_at (map fst l) a x) F2) by (intros; apply E). rewrite (power_ok F n) by assumption.
  destruct (good_ok _ _ H1) as [D0 D1].
  assert (G : good dq (terms l) = true).
  { apply andb_true_intro. split; [apply Z.ltb_lt; exact D0|]. apply forallb_forall. intros q Hq. apply D1. right. exact Hq. }
  destruct (build_ok n F dq l n a (le_n n) G HT H2 B x) as [z [Z1 Z2]].
  pose proof (nonneg_ok _ _ _ _ H3 z) as N. rewrite bil_madd, bil_mscale, opp_IZR in N.
  rewrite (scaled_ok dq b D0) in N by (apply D1; left; reflexivity).
  rewrite (bil_ext_l F z x) in N by (intros; symmetry; apply Z1; lia). rewrite (bil_ext_r F n x z x F2) in N by (intros; symmetry; apply Z1; lia).
  apply IZR_lt in D0. apply (Rmult_le_reg_l (IZR dq)); [exact D0|]. lra.
Qed.

(** * The form of what is left *)
Lemma crow_ok sw B i x : (0 < sw)%Z -> (forall b, In b B -> good sw (snd b) = true) -> forall P, still P = B ->
  dot (crow sw B i) x = IZR sw * xi P x i.
Proof.
  intros Hs HB P EP. unfold crow, xi. rewrite EP, dot_vadd, dot_unit. clear EP.
  enough (E : dot (fold_right (fun b a => vadd (unit (fst b) (- scaled sw (nth i (snd b) 0%Q))) a) [] B) x =
    - (IZR sw * fold_right (fun b a => Q2R (nth i (snd b) 0%Q) * x (fst b) + a) 0 B)) by (rewrite E; ring).
  induction B as [|[p v] B IH]; simpl; [ring|]. rewrite dot_vadd, dot_unit, IH by (intros; apply HB; right; assumption).
  assert (G : good sw v = true) by (apply (HB (p, v)); left; reflexivity).
  pose proof (nth_scaled sw v i G) as N. rewrite opp_IZR.
  assert (E : IZR (scaled sw (nth i v 0%Q)) = IZR sw * Q2R (nth i v 0%Q)).
  { rewrite <- N. f_equal. destruct (Nat.lt_ge_cases i (length v)) as [L|L].
    - rewrite nth_indep with (d' := scaled sw 0%Q) by (rewrite map_length; exact L). rewrite map_nth. reflexivity.
    - rewrite !nth_overflow by (try rewrite map_length; exact L). reflexivity. }
  rewrite E. ring.
Qed.
Section Quotient.
Variables (n : nat) (p : part) (P : list (list Q)).
Let q := quotient_of n p P.
Hypothesis H : check_quotient p P q = true.
Lemma quotient_parts : (0 < qsw q)%Z /\ (0 < qm q)%Z /\ (forall b, In b (still p) -> good (qsw q) (snd b) = true) /\ fits n (qF q) = true.
Proof.
  unfold check_quotient in H. cbv zeta in H. apply andb_prop in H as [H0 H6]. apply andb_prop in H0 as [H0 H5].
  apply andb_prop in H0 as [H0 H4]. apply andb_prop in H0 as [H0 H3]. apply andb_prop in H0 as [H1 H2].
  apply Z.ltb_lt in H2, H3. rewrite forallb_forall in H4. split; [exact H3|]. split; [|split; [exact H4|exact H6]].
  unfold q, quotient_of, qm, qsw in *. cbn in H3 |- *. nia.
Qed.
Theorem quotient_ok x : bil (qF q) x x = IZR (qm q) * qbil P (xi p x) (xi p x).
Proof.
  destruct quotient_parts as [S [_ [HB _]]].
  unfold check_quotient in H. cbv zeta in H. apply andb_prop in H as [H0 H6]. apply andb_prop in H0 as [H0 H5].
  apply andb_prop in H0 as [H0 _]. apply andb_prop in H0 as [H0 _]. apply andb_prop in H0 as [H1 H2].
  destruct (fits_ok _ _ H5) as [P1 P2]. unfold q, quotient_of in *. cbn [qF qm qsw qn] in *.
  set (sw := common_of (still p)) in *. set (d := common (concat P)) in *. set (C := map (crow sw (still p)) (seq 0 n)).
  set (PZ := map (map (scaled d)) P) in *.
  assert (A : forall i, (i < n)%nat -> app C x i = IZR sw * xi p x i).
  { intros i Hi. unfold app, C. rewrite (nth_map_seq _ n i) by exact Hi. apply (crow_ok sw (still p) i x S HB p eq_refl). }
  rewrite bil_tmul, bil_mmul, (bil_ext_l PZ (app C x) (fun i => IZR sw * xi p x i)) by (intros; apply A; lia).
  rewrite (bil_ext_r PZ n _ (app C x) (fun i => IZR sw * xi p x i) P2) by (intros; apply A; assumption).
  rewrite bil_scal_l, bil_scal_r. unfold PZ. rewrite bil_scaled by exact H1. rewrite !mult_IZR. ring.
Qed.
Variable r : factor.
Hypothesis Hr : factor_mod n (qsw q) (qfw q) (qF q) = Some r.
Lemma value_pos x : 0 <= qbil P (xi p x) (xi p x).
Proof.
  destruct quotient_parts as [_ [M _]]. destruct (factor_mod_ok _ _ _ _ _ Hr x) as [A _]. rewrite quotient_ok in A. apply IZR_lt in M.
  apply (Rmult_le_reg_l (IZR (qm q))); [exact M|]. lra.
Qed.
Lemma square_ok d pz qz x a : bounded_mod (qfw q) r d pz (qz * qm q) = true -> (0 <= pz)%Z -> (0 < qz)%Z -> qbil P (xi p x) (xi p x) <= a ->
  IZR qz * sq (dot d x) <= IZR pz * a.
Proof.
  intros B Hp Hq Ha. destruct quotient_parts as [_ [M _]]. destruct (factor_mod_ok _ _ _ _ _ Hr x) as [_ K].
  specialize (K _ _ _ B). rewrite quotient_ok, mult_IZR in K. apply IZR_lt in M. apply IZR_le in Hp.
  apply (Rmult_le_reg_l (IZR (qm q))); [exact M|]. unfold sq. set (v := qbil _ _ _) in *.
  assert (IZR pz * v <= IZR pz * a) by (apply Rmult_le_compat_l; assumption). nra.
Qed.
Lemma size_ok d s a x c : check_size q r d s a = true -> (0 < s)%Z -> 0 <= c -> qbil P (xi p x) (xi p x) <= c ->
  0 <= Q2R a /\ Rabs (dot d x) <= IZR s * (Q2R a * sqrt c).
Proof.
  intros B Hs Hc Hv. unfold check_size in B. apply andb_prop in B as [B0 B]. apply notneg_R in B0. split; [exact B0|].
  pose proof (square_ok _ _ (Zpos (Qden a) * Zpos (Qden a))%Z x c B ltac:(nia) ltac:(lia) Hv) as K.
  apply IZR_lt in Hs. pose proof (sqrt_pos c) as S0. pose proof (sqrt_sqrt c Hc) as S1.
  assert (D : 0 < IZR (Zpos (Qden a))) by (apply IZR_lt; reflexivity).
  assert (E : Q2R a * IZR (Zpos (Qden a)) = IZR (Qnum a)) by (unfold Q2R; field; lra).
  rewrite !mult_IZR, <- E, <- S1 in K.
  assert (K' : sq (dot d x) <= sq (IZR s * (Q2R a * sqrt c))).
  { apply (Rmult_le_reg_l (IZR (Zpos (Qden a)) * IZR (Zpos (Qden a)))); [nra|]. eapply Rle_trans; [exact K|]. right. unfold sq. ring. }
  unfold sq in K'. apply Rabs_le.
  assert (0 <= IZR s * (Q2R a * sqrt c)) by (apply Rmult_le_pos; [lra|apply Rmult_le_pos; assumption]). split; nra.
Qed.
Lemma offs_ok cs : check_offs q r p cs = true -> forall x a i, In i (its_agents p) -> qbil P (xi p x) (xi p x) <= a ->
  sq (xi p x i) <= Q2R (nth i cs 0%Q) * a.
Proof.
  intros HC x a i Hi Ha. unfold check_offs in HC. rewrite forallb_forall in HC. specialize (HC i Hi). cbv zeta in HC.
  set (c := nth i cs 0%Q) in *. apply andb_prop in HC as [C0 C1]. destruct quotient_parts as [S [_ [HB _]]].
  pose proof (proj1 (Z.leb_le _ _) C0) as C0'.
  pose proof (square_ok _ _ (Zpos (Qden c)) x a C1 ltac:(nia) ltac:(lia) Ha) as K.
  rewrite (crow_ok (qsw q) (still p) i x S HB p eq_refl), !mult_IZR in K. apply IZR_lt in S.
  assert (D : 0 < IZR (Zpos (Qden c))) by (apply IZR_lt; reflexivity).
  assert (E : Q2R c * IZR (Zpos (Qden c)) = IZR (Qnum c)) by (unfold Q2R; field; lra). rewrite <- E in K.
  apply (Rmult_le_reg_l (IZR (Zpos (Qden c)) * (IZR (qsw q) * IZR (qsw q)))); [apply Rmult_lt_0_compat; nra|].
  unfold sq in *. lra.
Qed.
Definition functional (l : list tie) (u : vec) (a : nat -> R) (x : nat -> R) : R := dot u (combined_at l a x).
Lemma functional_cons e l u a x : functional (e :: l) u a x = a O * (IZR (weighed u e) * dot (hvec e) x) + functional l u (shift a) x.
Proof.
  unfold functional, weighed. rewrite <- zdot_ok.
  rewrite (dot_ext u (combined_at (e :: l) a x) (fun i => (a O * dot (hvec e) x) * vec_of (fvec e) i + combined_at l (shift a) x i))
    by (intros; simpl; ring).
  rewrite dot_plus, dot_scal. ring.
Qed.
Lemma functional_nil u a x : functional [] u a x = 0.
Proof. unfold functional. apply dot_zero. reflexivity. Qed.
Definition middles (l : list tie) (j : nat) : R := Q2R (middle (nth j l (Tie 0 0 0 0 false))).
Lemma mid_row_ok dq l u x : good dq (map middle l) = true -> dot (mid_row dq l u) x = IZR dq * functional l u (middles l) x.
Proof.
  intros G. apply good_ok in G as [D0 D1]. unfold mid_row.
  induction l as [|e l IH]; [rewrite functional_nil; simpl; ring|]. cbn [fold_right].
  rewrite dot_vadd, dot_scale, IH by (intros; apply D1; right; assumption).
  rewrite functional_cons, mult_IZR, scaled_ok by (try exact D0; apply D1; left; reflexivity).
  change (shift (middles (e :: l))) with (middles l). change (middles (e :: l) O) with (Q2R (middle e)). ring.
Qed.
Lemma spread_ok x u c l : 0 <= c -> forall rs a, length l = length rs -> all_between l a ->
  (forall t, In t (combine l rs) -> weighed u (fst t) = 0%Z \/ Q2R (radius (fst t)) = 0 /\ 0 <= Q2R (snd t) \/
     0 <= Q2R (snd t) /\ Rabs (dot (hvec (fst t)) x) <= Q2R (snd t) * sqrt c) ->
  Rabs (functional l u a x - functional l u (middles l) x)
    <= Q2R (FamilyChecker.spread (combine l rs) u) * sqrt c /\ 0 <= Q2R (FamilyChecker.spread (combine l rs) u).
Proof.
  intros Hc. pose proof (sqrt_pos c) as S0.
  induction l as [|e l IH]; intros [|t rs] a L B K; try discriminate L.
  - rewrite !functional_nil. simpl. rewrite Rminus_0_r, Rabs_R0, Q2R_0. split; lra.
  - destruct (IH rs (shift a) ltac:(injection L; auto) (fun j e0 E => B (S j) e0 E) ltac:(intros; apply K; right; assumption)) as [I1 I2].
    specialize (K (e, t) ltac:(left; reflexivity)). cbn [fst snd] in K. pose proof (B 0%nat e eq_refl) as Be. unfold between in Be.
    rewrite !functional_cons. change (shift (middles (e :: l))) with (middles l). change (middles (e :: l) O) with (Q2R (middle e)).
    set (v := functional l u (middles l) x) in *. set (y := functional l u (shift a) x) in *.
    unfold FamilyChecker.spread. cbn [combine fold_right fst snd]. fold (FamilyChecker.spread (combine l rs) u).
    rewrite Q2R_plus, !Q2R_mult. set (W := Q2R (FamilyChecker.spread (combine l rs) u)) in *.
    assert (Ef : Q2R (inject_Z (Z.abs (weighed u e))) = Rabs (IZR (weighed u e))).
    { unfold Q2R, inject_Z. simpl. rewrite Rinv_1, Rmult_1_r. apply abs_IZR. }
    rewrite Ef. set (f := IZR (weighed u e)) in *. set (h := dot (hvec e) x) in *. set (m := Q2R (middle e)). set (ra := Q2R (radius e)) in *.
    assert (Er : ra = (Q2R (hi e) - Q2R (lo e)) / 2) by (unfold ra, radius; rewrite Q2R_mult, Q2R_minus; unfold Q2R at 3; simpl; lra).
    assert (Em : m = (Q2R (hi e) + Q2R (lo e)) / 2) by (unfold m, middle; rewrite Q2R_mult, Q2R_plus; unfold Q2R at 3; simpl; lra).
    assert (D : Rabs ((a 0%nat - m) * (f * h)) <= ra * Rabs f * Q2R t * sqrt c /\ 0 <= ra * Rabs f * Q2R t).
    { pose proof (Rabs_pos f) as F0. destruct K as [K|[[K1 K2]|[K1 K2]]].
      - assert (f = 0) by (unfold f; rewrite K; reflexivity). rewrite H0, Rabs_R0. rewrite !Rmult_0_l, !Rmult_0_r, Rmult_0_l, Rabs_R0. lra.
      - rewrite K1. assert (a 0%nat - m = 0) by lra. rewrite H0, !Rmult_0_l, Rabs_R0. lra.
      - assert (R0 : 0 <= ra) by lra. assert (P0 : 0 <= ra * Rabs f) by (apply Rmult_le_pos; assumption).
        split; [|apply Rmult_le_pos; assumption]. rewrite !Rabs_mult.
        replace (ra * Rabs f * Q2R t * sqrt c) with (ra * (Rabs f * (Q2R t * sqrt c))) by ring.
        apply Rmult_le_compat; [apply Rabs_pos|apply Rmult_le_pos; apply Rabs_pos|apply Rabs_le; lra|].
        apply Rmult_le_compat_l; assumption. }
    destruct D as [D1 D2]. split; [|lra].
    replace (a 0%nat * (f * h) + y - (m * (f * h) + v)) with ((a 0%nat - m) * (f * h) + (y - v)) by ring.
    eapply Rle_trans; [apply Rabs_triang|]. rewrite Rmult_plus_distr_r. apply Rplus_le_compat; assumption.
Qed.
Definition sized_ties (b : lyapunov) (l : list tie) (rs : list Q) := map (fun t => (t, Qeq_bool (radius (fst t)) 0 && notneg (snd t) ||
  near (about b) (fst t) && check_size q r (hvec (fst t)) 1 (snd t))) (combine l rs).
Lemma functional_ok b l rs dq u a0 c0 x a bs : good dq (map middle l) = true -> length l = length rs ->
  check_functional q r dq l (sized_ties b l rs) u a0 c0 = true -> 0 <= a -> qbil P (xi p x) (xi p x) <= a -> all_between l bs ->
  sq (functional l u bs x) <= Q2R c0 * a.
Proof.
  intros C1 C2 C4 Ha Hv B. unfold check_functional in C4. cbv zeta in C4. apply andb_prop in C4 as [C4 C5]. apply andb_prop in C4 as [C3 C4].
  rewrite forallb_forall in C3. destruct (good_ok _ _ C1) as [D0 _].
  destruct (size_ok _ _ _ x a C4 D0 Ha Hv) as [A0 A1]. rewrite (mid_row_ok dq l u x C1) in A1.
  set (y0 := functional l u (middles l) x) in *. apply IZR_lt in D0. rewrite Rabs_mult, (Rabs_right (IZR dq)) in A1 by lra.
  apply (Rmult_le_reg_l (IZR dq)) in A1; [|exact D0].
  assert (Em : map fst (sized_ties b l rs) = combine l rs) by (unfold sized_ties; rewrite map_map; apply map_id). rewrite Em in C5.
  destruct (spread_ok x u a l Ha rs bs C2 B) as [S1 S2].
  { intros t Ht. assert (I : In (t, Qeq_bool (radius (fst t)) 0 && notneg (snd t) || near (about b) (fst t) && check_size q r (hvec (fst t)) 1 (snd t))
      (sized_ties b l rs)) by (unfold sized_ties; apply in_map_iff; exists t; split; [reflexivity|exact Ht]).
    specialize (C3 _ I). cbn [fst snd] in C3. apply orb_prop in C3 as [C3|C3]; [left; apply Z.eqb_eq; exact C3|]. right.
    apply orb_prop in C3 as [C3|C3]; apply andb_prop in C3 as [R0 R1].
    - left. apply Qeq_R in R0. rewrite Q2R_0 in R0. split; [exact R0|apply notneg_R; exact R1].
    - right. destruct (size_ok _ 1 _ x a R1 ltac:(lia) Ha Hv) as [T0 T1]. split; [exact T0|]. rewrite Rmult_1_l in T1. exact T1. }
  fold y0 in S1. set (W := Q2R (FamilyChecker.spread _ u)) in *. apply Qle_R in C5. rewrite Q2R_mult, Q2R_plus in C5. fold W in C5.
  set (k0 := Q2R a0) in *. pose proof (sqrt_pos a) as S0. pose proof (sqrt_sqrt a Ha) as Sa. set (y := functional l u bs x) in *.
  assert (K : Rabs y <= (k0 + W) * sqrt a).
  { replace y with (y0 + (y - y0)) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra. }
  apply Rabs_le_between in K. assert (P0 : 0 <= (k0 + W) * sqrt a) by (apply Rmult_le_pos; lra).
  eapply Rle_trans with (sq ((k0 + W) * sqrt a)); [unfold sq; nra|]. unfold sq.
  replace ((k0 + W) * sqrt a * ((k0 + W) * sqrt a)) with ((k0 + W) * (k0 + W) * (sqrt a * sqrt a)) by ring. rewrite Sa.
  apply Rmult_le_compat_r; assumption.
Qed.
Lemma inputs_ok b l roots : about b = p -> forallb (check_tie n) l = true -> check_inputs q r b l roots = true ->
  forall w x a, 0 <= a -> qbil P (xi p x) (xi p x) <= a -> admits l w ->
  (forall i, In i (its_agents p) -> sq (member l w x i) <= Q2R (nth i (inputs b) 0%Q) * a) /\
  forall m, In m (means b) -> sq (qdot (fst m) (member l w x)) <= Q2R (snd m) * a.
Proof.
  intros Ep HT HC w x a Ha Hv Hw. unfold check_inputs in HC. cbv zeta in HC. set (dq := common (map middle l)) in *.
  fold (sized_ties b l (fst roots)) in HC.
  apply andb_prop in HC as [HC C4]. apply andb_prop in HC as [HC C3]. apply andb_prop in HC as [C1 C2].
  apply Nat.eqb_eq in C2. rewrite forallb_forall in C3, C4. rewrite Ep in C3.
  destruct (member_ok n l HT w Hw) as [bs [B E]]. split.
  - intros i Hi. pose proof (functional_ok b l (fst roots) dq _ _ _ x a bs C1 C2 (C3 i Hi) Ha Hv B) as K.
    unfold functional in K. rewrite dot_unit, Rmult_1_l in K. rewrite E. exact K.
  - intros m Hm. destruct (In_nth _ _ m Hm) as [j [Hj Ej]].
    assert (I : In ((qn q + j)%nat, m) (combine (seq (qn q) (length (means b))) (means b))).
    { apply in_numbered; [rewrite <- Ej; apply nth_error_nth'|]; exact Hj. }
    specialize (C4 _ I). cbn [fst snd] in C4. set (d := common (fst m)) in *. apply andb_prop in C4 as [G C4].
    pose proof (functional_ok b l (fst roots) dq _ _ _ x a bs C1 C2 C4 Ha Hv B) as K. unfold functional in K.
    rewrite (dot_scaled d (fst m) G) in K. destruct (good_ok _ _ G) as [G0 _]. apply IZR_lt in G0.
    rewrite (qdot_ext (fst m) (member l w x) (combined_at l bs x)) by (intros; apply E).
    rewrite Q2R_mult in K. assert (Ed : Q2R (inject_Z (d * d)) = IZR d * IZR d) by (unfold Q2R, inject_Z; simpl; rewrite Rinv_1, Rmult_1_r; apply mult_IZR).
    rewrite Ed in K. unfold sq in *. set (y := qdot _ _) in *. apply (Rmult_le_reg_l (IZR d * IZR d)); [nra|]. lra.
Qed.
End Quotient.
