(** Positive definite integer forms, by a rounded Cholesky factor. With [x = D z], [E = D A D - R'R] and
    [e_i = 2 E_ii - sum_(j <> i) (|E_ij| + |E_ji|)]

        2 x'A x  >=  2 |R z|^2 + sum_i e_i z_i^2,

    so [A] is positive definite if all [e_i > 0], and [(d'x)^2 <= c x'A x] if moreover, with [s D d = R'y + r],
    [|y|^2 + 2 |r|^2 / min e <= c s^2]. [D], [R], [y] may be any integers: nothing is proved of how they are found. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
Import ListNotations.
Require Import Certificate Vec.
Open Scope R_scope.

Definition pos_def (A : mat) : Prop :=
  forall x, 0 <= bil A x x /\ (bil A x x = 0 -> forall i, (i < length A)%nat -> x i = 0).
Definition squares (x : nat -> R) : nat -> R := fun i => x i * x i.

(** * The form of a matrix against its diagonal: Gershgorin, by rows and columns *)
Fixpoint diag (i : nat) (A : mat) : vec := match A with [] => [] | r :: A' => nth i r 0%Z :: diag (S i) A' end.
Fixpoint off (i : nat) (A : mat) : mat :=
  match A with [] => [] | r :: A' => vadd r (unit i (- nth i r 0%Z)) :: off (S i) A' end.
Definition size (r : vec) : Z := fold_right (fun a s => (Z.abs a + s)%Z) 0%Z r.
Definition columns (A : mat) : vec := fold_right (fun r a => vadd (map Z.abs r) a) [] A.
Definition slack (A : mat) : vec :=
  let O := off 0 A in vadd (map (Z.mul 2) (diag 0 A)) (map (Z.mul (-1)) (vadd (map size O) (columns O))).

Lemma bil_diag_off A : forall k x y,
  bil A x y = dot (diag k A) (fun i => x i * y (k + i)%nat) + bil (off k A) x y.
Proof.
  induction A as [|r A IH]; intros k x y; simpl; [lra|].
  rewrite (IH (S k) (shift x) y), dot_vadd, dot_unit, opp_IZR, Nat.add_0_r.
  assert (E : dot (diag (S k) A) (fun i => shift x i * y (S k + i)%nat)
    = dot (diag (S k) A) (shift (fun i => x i * y (k + i)%nat))).
  { apply dot_ext. intros. unfold shift. f_equal. f_equal. lia. }
  rewrite E. ring.
Qed.
Lemma cross a c x : - (Rabs a * (c * c + x * x)) <= 2 * (c * (a * x)).
Proof.
  pose proof (Rle_0_sqr (c + x)). pose proof (Rle_0_sqr (c - x)). unfold Rsqr in *.
  destruct (Rcase_abs a) as [N|N]; [rewrite (Rabs_left a N)|rewrite (Rabs_right a N)]; nra.
Qed.
Lemma row_size r : forall c x, - (IZR (size r) * (c * c) + dot (map Z.abs r) (squares x)) <= 2 * (c * dot r x).
Proof.
  induction r as [|a r IH]; intros c x; simpl; [lra|]. fold (size r). rewrite plus_IZR, abs_IZR.
  specialize (IH c (shift x)). pose proof (cross (IZR a) c (x 0%nat)) as C. unfold squares, shift in *. lra.
Qed.
Lemma off_size A : forall x y,
  - (dot (map size A) (squares x) + dot (columns A) (squares y)) <= 2 * bil A x y.
Proof.
  induction A as [|r A IH]; intros x y; simpl; [lra|]. fold (columns A). rewrite dot_vadd.
  specialize (IH (shift x) y). pose proof (row_size r (x 0%nat) y) as C. unfold squares, shift in *. lra.
Qed.
Theorem slack_ok A x : dot (slack A) (squares x) <= 2 * bil A x x.
Proof.
  unfold slack. rewrite dot_vadd, !dot_map_mul, dot_vadd, (bil_diag_off A 0).
  pose proof (off_size (off 0 A) x x) as C. unfold squares in *. simpl. lra.
Qed.

(** * Scaling by a diagonal: [conj D A = D A D] *)
Fixpoint hmul (d l : vec) : vec := match d, l with a :: d', b :: l' => (a * b)%Z :: hmul d' l' | _, _ => [] end.
Fixpoint conj_rows (d0 d : vec) (A : mat) : mat :=
  match d, A with a :: d', r :: A' => scale a (hmul d0 r) :: conj_rows d0 d' A' | _, _ => [] end.
Definition conj (d : vec) (A : mat) : mat := conj_rows d d A.
Definition times (d : vec) (z : nat -> R) : nat -> R := fun i => IZR (nth i d 0%Z) * z i.

Lemma dot_hmul d : forall l x, (length l <= length d)%nat -> dot (hmul d l) x = dot l (times d x).
Proof.
  induction d as [|a d IH]; intros [|b l] x H; simpl in *; try reflexivity; try lia.
  rewrite IH, mult_IZR by lia. change (times (a :: d) x 0%nat) with (IZR a * x 0%nat).
  rewrite (dot_ext l (times d (shift x)) (shift (times (a :: d) x))); [ring|]. intros. reflexivity.
Qed.
Lemma bil_conj d0 d : forall A x y, length A = length d -> rows_le (length d0) A ->
  bil (conj_rows d0 d A) x y = bil A (times d x) (times d0 y).
Proof.
  induction d as [|a d IH]; intros [|r A] x y H F; simpl in *; try reflexivity; try lia.
  inversion F; subst. rewrite dot_scale, dot_hmul by assumption. rewrite (IH A (shift x) y) by (auto; lia).
  change (times (a :: d) x 0%nat) with (IZR a * x 0%nat).
  rewrite (bil_ext_l A (times d (shift x)) (shift (times (a :: d) x))); [ring|]. intros. reflexivity.
Qed.

(** * Finding a factor: an even diagonal, integer square roots, rounded divisions; nothing here need be right *)
Definition even_scale (bits : Z) (A : mat) : vec :=
  let e := map (fun a => (Z.log2 a / 2)%Z) (diag 0 A) in
  let m := fold_right Z.max bits e in map (fun x => (2 ^ (m - x))%Z) e.
Fixpoint newton (n : nat) (a x : Z) : Z :=
  match n with O => x | S n' => let y := ((x + a / x) / 2)%Z in if (y <? x)%Z then newton n' a y else x end.
Definition isqrt (a : Z) : Z := if (0 <? a)%Z then newton 64 a (2 ^ (Z.log2 a / 2 + 1)) else 0%Z.
Fixpoint less (y : Z) (r b : vec) : vec := match r, b with x :: r', z :: b' => (x - y * z)%Z :: less y r' b' | _, _ => r end.
Fixpoint lower (b : vec) (c : vec) (rows : mat) : mat :=
  match c, rows with y :: c', r :: rows' => less y (tl r) b :: lower b c' rows' | _, _ => [] end.
Fixpoint chol (n : nat) (A : mat) : mat :=
  match n, A with
  | S n', (a :: b) :: rows =>
      let r := isqrt a in
      if (0 <? r)%Z then let b' := map (fun x => (x / r)%Z) b in (r :: b') :: chol n' (lower b' b' rows) else []
  | _, _ => []
  end.
Fixpoint lessen (i : nat) (c : Z) (A : mat) : mat :=
  match A with [] => [] | r :: A' => vadd r (unit i (- c)) :: lessen (S i) c A' end.
Fixpoint pad (k : nat) (T : mat) : mat := match T with [] => [] | r :: T' => (repeat 0%Z k ++ r) :: pad (S k) T' end.
Fixpoint solve (T : mat) (u : vec) : vec :=
  match T, u with (p :: b) :: T', x :: u' => let y := (x / p)%Z in y :: solve T' (less y u' b) | _, _ => [] end.

(** * The test *)
Record factor := Factor { fD : vec; fR : mat; fT : mat; fe : vec; fs : Z }.
Definition try_factor (bits : Z) (A : mat) : option factor :=
  let n := length A in
  let d := even_scale bits A in
  let B := conj d A in
  let T := chol n (lessen 0 (4 * Z.of_nat n * isqrt (fold_right Z.max 1%Z (diag 0 B)))%Z B) in
  let R := pad 0 T in
  let e := slack (madd B (mscale (-1) (tmul R R))) in
  if (length d =? n)%nat && forallb (Z.ltb 0) d && forallb (fun r : vec => (length r <=? n)%nat) A
     && (length e =? n)%nat && forallb (Z.ltb 0) e
  then Some (Factor d R T e (2 ^ (3 * bits))%Z) else None.
Definition factorise (A : mat) : option factor :=
  match try_factor 100 A with Some f => Some f | None =>
  match try_factor 300 A with Some f => Some f | None =>
  match try_factor 1000 A with Some f => Some f | None => try_factor 4000 A end end end.

Definition size2 (l : vec) : Z := fold_right (fun a s => (a * a + s)%Z) 0%Z l.
(** [q (d'x)^2 <= p x'A x], for the factor of [A] *)
Definition bounded (f : factor) (d : vec) (p q : Z) : bool :=
  let u := vadd (repeat 0%Z (length (fD f))) (map (Z.mul (fs f)) (hmul (fD f) d)) in
  let y := solve (fT f) u in
  let r := vadd u (map (Z.mul (-1)) (lincomb y (fR f))) in
  let m := fold_right Z.min (hd 1%Z (fe f)) (fe f) in
  (0 <? q)%Z && (0 <? m)%Z && (0 <? fs f)%Z && (length d <=? length (fD f))%nat && (length r <=? length (fe f))%nat
  && (q * (m * size2 y + 2 * size2 r) <=? p * (m * (fs f * fs f)))%Z.

Definition sumsq (A : mat) (z : nat -> R) : R := fold_right (fun r a => dot r z * dot r z + a) 0 A.
Definition factor_of (A : mat) (f : factor) : Prop :=
  forallb (Z.ltb 0) (fe f) = true /\ length (fe f) = length A /\ length (fD f) = length A /\
  forall x, exists z, (forall i, (i < length A)%nat -> x i = times (fD f) z i) /\
    2 * sumsq (fR f) z + dot (fe f) (squares z) <= 2 * bil A x x.

Lemma bil_gram R : forall x, bil (tmul R R) x x = sumsq R x.
Proof. induction R as [|r R IH]; intros x; simpl; [reflexivity|]. rewrite bil_madd, bil_outer, IH. reflexivity. Qed.
Lemma sumsq_pos R z : 0 <= sumsq R z.
Proof. induction R as [|r R IH]; simpl; [lra|]. nra. Qed.
Lemma dot_squares_pos e : forallb (Z.ltb 0) e = true -> forall z,
  0 <= dot e (squares z) /\ (dot e (squares z) = 0 -> forall i, (i < length e)%nat -> z i = 0).
Proof.
  induction e as [|a e IH]; intros H z; simpl.
  - split; [lra|]. intros _ i Hi. lia.
  - simpl in H. apply andb_prop in H as [Ha H]. apply Z.ltb_lt in Ha. apply IZR_lt in Ha.
    destruct (IH H (shift z)) as [P0 P1]. change (shift (squares z)) with (squares (shift z)).
    assert (Q0 : 0 <= IZR a * squares z 0%nat) by (unfold squares; nra). split; [lra|].
    intros E [|i] Hi.
    + assert (E0 : IZR a * squares z 0%nat = 0) by lra. unfold squares in E0.
      apply Rmult_integral in E0 as [E0|E0]; [lra|]. apply Rmult_integral in E0 as [E0|E0]; exact E0.
    + apply (P1 ltac:(lra) i). lia.
Qed.
Theorem try_factor_ok bits A f : try_factor bits A = Some f -> factor_of A f.
Proof.
  unfold try_factor. set (n := length A). set (d := even_scale bits A). set (B := conj d A). cbv zeta.
  set (T := chol _ _). set (R := pad 0 T). set (e := slack _).
  match goal with |- (if ?c then _ else _) = _ -> _ => destruct c eqn:H; [|discriminate] end. intros [= <-].
  apply andb_prop in H as [H He]. apply andb_prop in H as [H Le]. apply andb_prop in H as [H Hr].
  apply andb_prop in H as [Ld Hd]. apply Nat.eqb_eq in Le, Ld. rewrite forallb_forall in Hd, Hr.
  repeat split; simpl; auto. intros x. exists (fun i => x i / IZR (nth i d 0%Z)). set (z := fun i => _).
  assert (P : forall i, (i < n)%nat -> times d z i = x i).
  { intros i Hi. assert (0 < IZR (nth i d 0%Z)).
    { apply IZR_lt. apply Z.ltb_lt. apply Hd. apply nth_In. lia. } unfold times, z. field. lra. }
  split; [intros i Hi; symmetry; apply P; assumption|].
  assert (RL : rows_le n A) by (apply Forall_forall; intros r Hr'; apply Nat.leb_le; auto).
  pose proof (slack_ok (madd B (mscale (-1) (tmul R R))) z) as S. fold e in S.
  rewrite bil_madd, bil_mscale, bil_gram in S. unfold B, conj in S.
  rewrite bil_conj in S by (auto; rewrite Ld; exact RL).
  rewrite (bil_ext_l A _ x) in S by exact P. rewrite (bil_ext_r A n _ _ x RL) in S by exact P. lra.
Qed.
Theorem factorise_ok A f : factorise A = Some f -> factor_of A f.
Proof.
  unfold factorise. intros H.
  repeat match type of H with match ?t with _ => _ end = _ =>
    destruct t eqn:?E; [injection H as <-; eapply try_factor_ok; eassumption|] end.
  eapply try_factor_ok; eassumption.
Qed.
Theorem factor_pos A f : factor_of A f -> pos_def A.
Proof.
  intros [He [Le [_ H]]] x. destruct (H x) as [z [Hz K]]. pose proof (sumsq_pos (fR f) z) as P.
  destruct (dot_squares_pos _ He z) as [P0 P1]. split; [lra|]. intros E i Hi. rewrite Hz by assumption.
  unfold times. rewrite (P1 ltac:(lra) i) by lia. ring.
Qed.

Lemma dot_repeat0 n : forall x, dot (repeat 0%Z n) x = 0.
Proof. induction n as [|n IH]; intros; simpl; [reflexivity|]. rewrite IH. lra. Qed.

(** * Cauchy and Schwarz *)
Lemma twice t U W : 0 <= U -> 0 <= W -> t * t <= U * W -> 2 * t <= U + W.
Proof.
  intros HU HW H. destruct (Rle_lt_dec (2 * t) (U + W)) as [L|L]; [exact L|].
  assert ((U + W) * (U + W) < 2 * t * (2 * t)) by (apply Rmult_le_0_lt_compat; lra).
  pose proof (Rle_0_sqr (U - W)) as S. unfold Rsqr in S. lra.
Qed.
Lemma join a b Y S Y' S' : 0 <= Y -> 0 <= S -> 0 <= Y' -> 0 <= S' -> a * a <= Y * S -> b * b <= Y' * S' ->
  (a + b) * (a + b) <= (Y + Y') * (S + S').
Proof.
  intros HY HS HY' HS' Ha Hb.
  assert (K : 2 * (a * b) <= Y * S' + Y' * S).
  { apply twice; [apply Rmult_le_pos; assumption|apply Rmult_le_pos; assumption|].
    replace (a * b * (a * b)) with (a * a * (b * b)) by ring.
    replace (Y * S' * (Y' * S)) with (Y * S * (Y' * S')) by ring.
    apply Rmult_le_compat; nra. }
  nra.
Qed.
Lemma size2_pos l : 0 <= IZR (size2 l).
Proof. apply IZR_le. induction l as [|a l IH]; simpl; [lia|]. fold (size2 l). nia. Qed.
Lemma cauchy_rows y : forall R z, dot y (app R z) * dot y (app R z) <= IZR (size2 y) * sumsq R z.
Proof.
  induction y as [|a y IH]; intros R z; simpl; [lra|]. fold (size2 y). rewrite plus_IZR, mult_IZR.
  destruct R as [|r R].
  - rewrite (dot_zero y) by (intros i _; unfold shift, app; reflexivity). unfold app. simpl. lra.
  - simpl. change (shift (app (r :: R) z)) with (app R z). unfold app at 1 3. simpl.
    apply join; try nra; [apply size2_pos|apply sumsq_pos|apply IH].
Qed.
Lemma cauchy_slack m r : 0 < m -> forall e z, (length r <= length e)%nat -> (forall a, In a e -> m <= IZR a) ->
  dot r z * dot r z <= IZR (size2 r) * (dot e (squares z) / m).
Proof.
  intros Hm. induction r as [|a r IH]; intros [|w e] z L H; simpl in *; try lra; try lia.
  fold (size2 r). rewrite plus_IZR, mult_IZR. change (shift (squares z)) with (squares (shift z)).
  assert (W : m <= IZR w) by (apply H; left; reflexivity).
  assert (K : dot r (shift z) * dot r (shift z) <= IZR (size2 r) * (dot e (squares (shift z)) / m))
    by (apply IH; [lia|intros; apply H; right; assumption]).
  assert (S : 0 <= dot e (squares (shift z)) / m).
  { apply Rmult_le_pos; [|left; apply Rinv_0_lt_compat; assumption].
    clear - H Hm. assert (H' : forall a, In a e -> m <= IZR a) by (intros; apply H; right; assumption). clear H.
    revert z. induction e as [|b e IH]; intros z; simpl; [lra|].
    assert (m <= IZR b) by (apply H'; left; reflexivity).
    specialize (IH ltac:(intros; apply H'; right; assumption) (shift z)).
    change (shift (squares (shift z))) with (squares (shift (shift z))).
    unfold squares at 1, shift at 1 2. nra. }
  assert (E : (IZR w * squares z 0%nat + dot e (squares (shift z))) / m
    = IZR w / m * squares z 0%nat + dot e (squares (shift z)) / m) by (field; lra).
  rewrite E. assert (Wm : 1 <= IZR w / m).
  { apply (Rmult_le_reg_r m); [assumption|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
  assert (Z2 : 0 <= z 0%nat * z 0%nat) by nra. assert (A2 : 0 <= IZR a * IZR a) by nra.
  apply join; try assumption; [unfold squares; nra|apply size2_pos|].
  unfold squares. replace (IZR a * z 0%nat * (IZR a * z 0%nat)) with (IZR a * IZR a * (z 0%nat * z 0%nat)) by ring.
  apply Rmult_le_compat_l; nra.
Qed.
Lemma least_ok l : forall a m, In a l -> (fold_right Z.min m l <= a)%Z.
Proof. induction l as [|b l IH]; intros a m H; simpl in *; [contradiction|]. destruct H as [->|H]; [lia|]. specialize (IH a m H). lia. Qed.

Theorem bounded_ok A f d p q : factor_of A f -> bounded f d p q = true ->
  forall x, IZR q * (dot d x * dot d x) <= IZR p * bil A x x.
Proof.
  intros [He [Le [Ld H]]] B x. unfold bounded in B. revert B.
  set (u := vadd _ (map (Z.mul (fs f)) (hmul (fD f) d))). cbv zeta. set (y := solve (fT f) u).
  set (r := vadd u (map (Z.mul (-1)) (lincomb y (fR f)))). set (m := fold_right Z.min _ _). intros B.
  apply andb_prop in B as [B K]. apply andb_prop in B as [B Lr]. apply andb_prop in B as [B L].
  apply andb_prop in B as [B Hs]. apply andb_prop in B as [Hq Hm].
  apply Z.ltb_lt in Hm, Hs, Hq. apply Nat.leb_le in Lr, L. apply Z.leb_le in K.
  destruct (H x) as [z [Hz S]]. apply IZR_lt in Hm, Hs, Hq. apply IZR_le in K.
  rewrite !mult_IZR, plus_IZR, !mult_IZR in K.
  assert (U : dot u z = IZR (fs f) * dot d x).
  { unfold u. rewrite dot_vadd, dot_repeat0, Rplus_0_l, dot_map_mul, dot_hmul by assumption. f_equal. apply dot_ext. intros i Hi. rewrite Hz by lia. reflexivity. }
  assert (V : dot u z = dot y (app (fR f) z) + dot r z).
  { unfold r. rewrite dot_vadd, dot_map_mul, dot_lincomb. simpl. ring. }
  pose proof (cauchy_rows y (fR f) z) as C1.
  pose proof (cauchy_slack (IZR m) r Hm (fe f) z Lr ltac:(intros a Ha; apply IZR_le; apply least_ok; assumption)) as C2.
  destruct (dot_squares_pos _ He z) as [P0 _]. pose proof (sumsq_pos (fR f) z) as P1.
  set (W := dot (fe f) (squares z)) in *. set (Y := IZR (size2 y)) in *. set (r2 := IZR (size2 r)) in *.
  pose proof (size2_pos y) as Yp. pose proof (size2_pos r) as rp. fold Y in Yp. fold r2 in rp.
  assert (Im : 0 < / IZR m) by (apply Rinv_0_lt_compat; assumption).
  assert (J : dot u z * dot u z <= (Y + 2 * r2 / IZR m) * (sumsq (fR f) z + W / 2)).
  { rewrite V. apply join; try assumption; try lra.
    unfold Rdiv. apply Rmult_le_pos; lra. }
  set (a := bil A x x) in *. assert (A0 : 0 <= a) by lra. set (s := IZR (fs f)) in *.
  assert (Rm : 0 <= 2 * r2 / IZR m) by (unfold Rdiv; apply Rmult_le_pos; lra).
  assert (F : IZR q * (Y + 2 * r2 / IZR m) <= IZR p * (s * s)).
  { apply (Rmult_le_reg_l (IZR m)); [assumption|].
    replace (IZR m * (IZR q * (Y + 2 * r2 / IZR m))) with (IZR q * (IZR m * Y + 2 * r2)) by (field; lra). lra. }
  assert (G : dot u z * dot u z <= (Y + 2 * r2 / IZR m) * a)
    by (eapply Rle_trans; [exact J|apply Rmult_le_compat_l; lra]).
  rewrite U in G. apply (Rmult_le_reg_l (s * s)); [nra|].
  replace (s * s * (IZR q * (dot d x * dot d x))) with (IZR q * (s * dot d x * (s * dot d x))) by ring.
  eapply Rle_trans; [apply Rmult_le_compat_l; [lra|exact G]|].
  replace (IZR q * ((Y + 2 * r2 / IZR m) * a)) with (IZR q * (Y + 2 * r2 / IZR m) * a) by ring.
  replace (s * s * (IZR p * a)) with (IZR p * (s * s) * a) by ring. apply Rmult_le_compat_r; assumption.
Qed.
