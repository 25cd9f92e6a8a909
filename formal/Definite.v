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

(** * Half of a form: the rows of the upper triangle, [row_form r x] = x_0 (r_0 x_0 + 2 (r_1 x_1 + ...)) *)
Definition row_form (r : vec) (x : nat -> R) : R := x 0%nat * (2 * dot r x - IZR (hd 0%Z r) * x 0%nat).
Fixpoint half_form (H : mat) (x : nat -> R) : R :=
  match H with [] => 0 | r :: H' => row_form r x + half_form H' (shift x) end.
(** the upper triangle of [A + A'] *)
Fixpoint half (n : nat) (A : mat) : mat :=
  match n, A with
  | S n', r :: A' => ((2 * hd 0 r)%Z :: vadd (tl r) (map (hd 0%Z) A')) :: half n' (map (@tl Z) A')
  | _, _ => [] end.
Lemma dot_hd_tl l x : dot l x = IZR (hd 0%Z l) * x 0%nat + dot (tl l) (shift x).
Proof. destruct l as [|a l]; simpl; lra. Qed.
Lemma bil_columns A : forall x y, bil A x y = y 0%nat * dot (map (hd 0%Z) A) x + bil (map (@tl Z) A) x (shift y).
Proof. induction A as [|r A IH]; intros x y; simpl; [lra|]. rewrite IH, (dot_hd_tl r). lra. Qed.
Lemma half_ok n : forall A x, length A = n -> half_form (half n A) x = 2 * bil A x x.
Proof.
  induction n as [|n IH]; intros [|r A] x L; try discriminate L; [simpl; lra|]. cbn [half half_form bil].
  rewrite IH by (rewrite map_length; exact (f_equal pred L)). rewrite (bil_columns A (shift x) x), (dot_hd_tl r x).
  unfold row_form. cbn [hd dot]. rewrite dot_vadd, mult_IZR. ring.
Qed.
Fixpoint half_slack (H : mat) : vec :=
  match H with [] => [] | r :: H' =>
    (hd 0 r - size (tl r))%Z :: vadd (map (fun a => (- Z.abs a)%Z) (tl r)) (half_slack H') end.
Lemma dot_minus_abs l x : dot (map (fun a => (- Z.abs a)%Z) l) x = - dot (map Z.abs l) x.
Proof. revert x. induction l as [|a l IH]; intros x; simpl; [lra|]. rewrite IH, opp_IZR. lra. Qed.
Theorem half_slack_ok H : forall x, dot (half_slack H) (squares x) <= half_form H x.
Proof.
  induction H as [|r H IH]; intros x; simpl; [lra|]. rewrite dot_vadd, dot_minus_abs, minus_IZR. specialize (IH (shift x)).
  pose proof (row_size (tl r) (x 0%nat) (shift x)) as S. unfold row_form. rewrite (dot_hd_tl r).
  change (shift (squares x)) with (squares (shift x)). unfold squares at 1. lra.
Qed.

(** * Scaling by a diagonal *)
Fixpoint hmul (d l : vec) : vec := match d, l with a :: d', b :: l' => (a * b)%Z :: hmul d' l' | _, _ => [] end.
Fixpoint conj (d : vec) (H : mat) : mat :=
  match d, H with a :: d', r :: H' => scale a (hmul d r) :: conj d' H' | _, _ => [] end.
Definition times (d : vec) (z : nat -> R) : nat -> R := fun i => IZR (nth i d 0%Z) * z i.
Lemma dot_hmul d : forall l x, dot (hmul d l) x = dot l (times d x).
Proof.
  induction d as [|a d IH]; intros [|b l] x; simpl in *; try reflexivity.
  - rewrite (dot_zero l) by (intros [|i] _; unfold shift, times; simpl; lra). unfold times. simpl. lra.
  - rewrite IH, mult_IZR. change (times (a :: d) x 0%nat) with (IZR a * x 0%nat).
    rewrite (dot_ext l (times d (shift x)) (shift (times (a :: d) x))); [ring|]. intros. reflexivity.
Qed.
Lemma row_hd_scale a l : hd 0%Z (scale a l) = (a * hd 0 l)%Z.
Proof. unfold scale. destruct (Z.eqb_spec a 0) as [->|_]; [reflexivity|]. destruct l as [|b l]; simpl; lia. Qed.
Lemma half_zero H : half_form H (fun _ => 0) = 0.
Proof. induction H as [|r H IH]; simpl; [reflexivity|]. change (shift (fun _ : nat => 0)) with (fun _ : nat => 0). rewrite IH. unfold row_form. ring. Qed.
Lemma half_ext H : forall x y, (forall i, x i = y i) -> half_form H x = half_form H y.
Proof.
  induction H as [|r H IH]; intros x y E; simpl; [reflexivity|].
  rewrite (IH (shift x) (shift y)) by (intros i; apply E). unfold row_form. rewrite (dot_ext r x y) by auto. rewrite E. reflexivity.
Qed.
Lemma half_conj d : forall H x, half_form (conj d H) x = half_form H (times d x).
Proof.
  induction d as [|a d IH]; intros [|r H] x; cbn [conj half_form]; try reflexivity.
  - symmetry. transitivity (half_form (r :: H) (fun _ => 0)); [|apply half_zero].
    apply (half_ext (r :: H)). intros [|i]; unfold times; simpl; lra.
  - rewrite IH, (half_ext H (times d (shift x)) (shift (times (a :: d) x))) by reflexivity. f_equal.
    unfold row_form. rewrite dot_scale, dot_hmul, row_hd_scale.
    assert (E : hd 0%Z (hmul (a :: d) r) = (a * hd 0 r)%Z) by (destruct r; simpl; lia).
    rewrite E, !mult_IZR. change (times (a :: d) x 0%nat) with (IZR a * x 0%nat). ring.
Qed.

(** * Finding a factor: an even diagonal, integer square roots, rounded divisions, and exactly what they leave *)
Definition half_bits (H : mat) : vec := map (fun r => (Z.log2 (hd 0 r) / 2)%Z) H.
(** bits of the roots, at least so many *)
Definition width (bits : Z) (H : mat) : Z := fold_right Z.max bits (half_bits H).
Definition even_scale (bits : Z) (H : mat) : vec := map (fun x => (2 ^ (width bits H - x))%Z) (half_bits H).
Fixpoint newton (n : nat) (a x : Z) : Z :=
  match n with O => x | S n' => let y := ((x + a / x) / 2)%Z in if (y <? x)%Z then newton n' a y else x end.
Definition isqrt (a : Z) : Z := if (0 <? a)%Z then newton 64 a (2 ^ (Z.log2 a / 2 + 1)) else 0%Z.
(** [r - y b] *)
Fixpoint less (y : Z) (r b : vec) : vec :=
  match r, b with x :: r', z :: b' => (x - y * z)%Z :: less y r' b' | [], _ => map (Z.mul (- y)) b | _, [] => r end.
(** [H] less the square of [b] *)
Fixpoint lower (b : vec) (H : mat) : mat :=
  match b with [] => H | y :: b' => less y (hd [] H) b :: lower b' (tl H) end.
(** rows of a factor, and rows of what is left: [c] is taken off the diagonal, for the roundings *)
Fixpoint chol (n : nat) (c : Z) (H : mat) : list (vec * vec) :=
  match n, H with
  | S n', (a :: b) :: H' =>
      let r := isqrt (a - c) in
      if (0 <? r)%Z then let b' := map (fun x => (x / r)%Z) b in
        (r :: b', (a - r * r)%Z :: less r b b') :: chol n' c (lower b' H')
      else map (pair []) H
  | _, _ => map (pair []) H
  end.
(** [u] by these rows, and what is left of it *)
Fixpoint solve (T : mat) (u : vec) : vec * vec :=
  match T with
  | [] => ([], u)
  | r :: T' => let y := (hd 0 u / hd 1 r)%Z in let v := less y u r in
      let s := solve T' (tl v) in (y :: fst s, hd 0%Z v :: snd s) end.

Lemma dot_less y r : forall b x, dot (less y r b) x = dot r x - IZR y * dot b x.
Proof.
  induction r as [|a r IH]; intros b x.
  - replace (less y [] b) with (map (Z.mul (- y)) b) by (destruct b; reflexivity). rewrite dot_map_mul, opp_IZR. simpl. lra.
  - destruct b as [|z b]; simpl; [lra|]. rewrite IH, minus_IZR, mult_IZR. lra.
Qed.
Lemma hd_less y r b : hd 0%Z (less y r b) = (hd 0 r - y * hd 0 b)%Z.
Proof. destruct r as [|a r], b as [|z b]; simpl; lia. Qed.
Lemma half_lower b : forall H x, half_form (lower b H) x = half_form H x - dot b x * dot b x.
Proof.
  induction b as [|y b IH]; intros H x; cbn [lower half_form]; [simpl; lra|].
  rewrite IH. assert (E : half_form H x = row_form (hd [] H) x + half_form (tl H) (shift x)).
  { destruct H as [|r H]; simpl; [unfold row_form; simpl; lra|reflexivity]. }
  rewrite E. unfold row_form. rewrite dot_less, hd_less, minus_IZR, mult_IZR. simpl. ring.
Qed.
(** sums of squares of rows, the first of all variables, the next of all but the first *)
Fixpoint sumsq (T : mat) (z : nat -> R) : R :=
  match T with [] => 0 | r :: T' => dot r z * dot r z + sumsq T' (shift z) end.
Lemma chol_ok n c : forall H x, half_form H x = sumsq (map fst (chol n c H)) x + half_form (map snd (chol n c H)) x.
Proof.
  assert (D : forall H x, half_form H x = sumsq (map fst (map (pair []) H)) x + half_form (map snd (map (pair (@nil Z)) H)) x).
  { induction H as [|r H IH]; intros x; simpl; [lra|]. rewrite IH. lra. }
  induction n as [|n IH]; intros [|[|a b] H] x; try apply D. cbn [chol]. cbv zeta.
  destruct (0 <? isqrt (a - c))%Z; [|apply D]. set (r := isqrt (a - c)). set (b' := map _ b).
  cbn [map fst snd half_form sumsq]. specialize (IH (lower b' H) (shift x)). rewrite half_lower in IH.
  unfold row_form. cbn [hd]. cbn [dot]. rewrite dot_less, minus_IZR, mult_IZR. lra.
Qed.
(** the sum of these multiples of the rows *)
Fixpoint combined (y : vec) (T : mat) (z : nat -> R) : R :=
  match y, T with a :: y', r :: T' => IZR a * dot r z + combined y' T' (shift z) | _, _ => 0 end.
Lemma solve_ok T : forall u z, dot u z = combined (fst (solve T u)) T z + dot (snd (solve T u)) z.
Proof.
  induction T as [|r T IH]; intros u z; cbn [solve fst snd combined]; [lra|]. cbv zeta. cbn [fst snd combined dot].
  set (y := (hd 0 u / hd 1 r)%Z). specialize (IH (tl (less y u r)) (shift z)).
  pose proof (dot_less y u r z) as E. rewrite (dot_hd_tl (less y u r)) in E. lra.
Qed.

(** * The test *)
Record factor := Factor { fD : vec; fT : mat; fe : vec; fs : Z }.
Definition try_factor (bits : Z) (A : mat) : option factor :=
  let n := length A in
  let H := half n A in
  let d := even_scale bits H in
  let B := conj d H in
  let l := chol n (4 * Z.of_nat n * isqrt (fold_right (fun r a => Z.max (hd 0 r) a) 1 B))%Z B in
  let e := half_slack (map snd l) in
  if (length d =? n)%nat && forallb (Z.ltb 0) d && forallb (fun r : vec => (length r <=? n)%nat) A
     && (length e =? n)%nat && forallb (Z.ltb 0) e
  then Some (Factor d (map fst l) e (2 ^ (3 * width bits H))%Z) else None.
(** what was taken off the diagonal changes no bound by more than [2^-60] of itself, about *)
Definition fine (f : factor) : bool :=
  let m := fold_right Z.max 0%Z (fe f) in forallb (fun r => (m * 2 ^ 60 <=? hd 0 r * hd 0 r)%Z) (fT f).
(** the first factor that is fine, or the last one *)
Fixpoint finest (l : list Z) (A : mat) (last : option factor) : option factor :=
  match l with [] => last | bits :: l' =>
    match try_factor bits A with Some f => if fine f then Some f else finest l' A (Some f) | None => finest l' A last end end.
Definition factorise (A : mat) : option factor := finest [100; 300; 1000; 4000]%Z A None.

Definition size2 (l : vec) : Z := fold_right (fun a s => (a * a + s)%Z) 0%Z l.
(** [q (d'x)^2 <= p x'A x], for the factor of [A] *)
Definition bounded (f : factor) (d : vec) (p q : Z) : bool :=
  let s := solve (fT f) (vadd (repeat 0%Z (length (fD f))) (map (Z.mul (fs f)) (hmul (fD f) d))) in
  let m := fold_right Z.min (hd 1%Z (fe f)) (fe f) in
  (0 <? q)%Z && (0 <? m)%Z && (0 <? fs f)%Z && (length d <=? length (fD f))%nat && (length (snd s) <=? length (fe f))%nat
  && (2 * q * (m * size2 (fst s) + size2 (snd s)) <=? p * (m * (fs f * fs f)))%Z.

Definition factor_of (A : mat) (f : factor) : Prop :=
  forallb (Z.ltb 0) (fe f) = true /\ length (fe f) = length A /\ length (fD f) = length A /\
  forall x, exists z, (forall i, (i < length A)%nat -> x i = times (fD f) z i) /\
    sumsq (fT f) z + dot (fe f) (squares z) <= 2 * bil A x x.

Lemma sumsq_pos T : forall z, 0 <= sumsq T z.
Proof. induction T as [|r T IH]; intros z; simpl; [lra|]. specialize (IH (shift z)). nra. Qed.
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
  unfold try_factor. cbv zeta. set (n := length A). set (d := even_scale bits (half n A)). set (B := conj d (half n A)).
  set (c := (4 * Z.of_nat n * _)%Z). set (l := chol n c B). set (e := half_slack (map snd l)).
  match goal with |- (if ?c then _ else _) = _ -> _ => destruct c eqn:H; [|discriminate] end. intros [= <-].
  apply andb_prop in H as [H He]. apply andb_prop in H as [H Le]. apply andb_prop in H as [H Hr].
  apply andb_prop in H as [Ld Hd]. apply Nat.eqb_eq in Le, Ld. rewrite forallb_forall in Hd, Hr.
  repeat split; simpl; auto. intros x. exists (fun i => x i / IZR (nth i d 0%Z)). set (z := fun i => _).
  assert (P : forall i, (i < n)%nat -> times d z i = x i).
  { intros i Hi. assert (0 < IZR (nth i d 0%Z)).
    { apply IZR_lt. apply Z.ltb_lt. apply Hd. apply nth_In. lia. } unfold times, z. field. lra. }
  split; [intros i Hi; symmetry; apply P; assumption|].
  assert (RL : rows_le n A) by (apply Forall_forall; intros r Hr'; apply Nat.leb_le; auto).
  pose proof (half_slack_ok (map snd l) z) as S. fold e in S. pose proof (chol_ok n c B z) as C. fold l in C.
  unfold B in C. rewrite half_conj, half_ok in C by reflexivity.
  rewrite (bil_ext_l A _ x) in C by exact P. rewrite (bil_ext_r A n _ _ x RL) in C by exact P. lra.
Qed.
Lemma finest_ok A f l : forall last, (last = Some f -> factor_of A f) -> finest l A last = Some f -> factor_of A f.
Proof.
  induction l as [|bits l IH]; intros last L H; [exact (L H)|]. cbn [finest] in H.
  destruct (try_factor bits A) as [g|] eqn:E; [|exact (IH _ L H)].
  assert (G : Some g = Some f -> factor_of A f) by (intros [= <-]; eapply try_factor_ok; eassumption).
  destruct (fine g); [exact (G H)|exact (IH _ G H)].
Qed.
Theorem factorise_ok A f : factorise A = Some f -> factor_of A f.
Proof. apply finest_ok. discriminate. Qed.
Theorem factor_pos A f : factor_of A f -> pos_def A.
Proof.
  intros [He [Le [_ H]]] x. destruct (H x) as [z [Hz K]]. pose proof (sumsq_pos (fT f) z) as P.
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
Lemma cauchy_rows y : forall T z, combined y T z * combined y T z <= IZR (size2 y) * sumsq T z.
Proof.
  induction y as [|a y IH]; intros [|r T] z; simpl; try (pose proof (size2_pos (a :: y)) as P; simpl in P); try lra;
    try (pose proof (sumsq_pos T (shift z)); nra).
  fold (size2 y). rewrite plus_IZR, mult_IZR.
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
  intros [He [Le [Ld H]]] B x. unfold bounded in B. revert B. set (u := vadd _ _). cbv zeta.
  set (y := fst (solve (fT f) u)). set (r := snd (solve (fT f) u)). set (m := fold_right Z.min _ _). intros B.
  apply andb_prop in B as [B K]. apply andb_prop in B as [B Lr]. apply andb_prop in B as [B L].
  apply andb_prop in B as [B Hs]. apply andb_prop in B as [Hq Hm].
  apply Z.ltb_lt in Hm, Hs, Hq. apply Nat.leb_le in Lr, L. apply Z.leb_le in K.
  destruct (H x) as [z [Hz S]]. apply IZR_lt in Hm, Hs, Hq. apply IZR_le in K.
  rewrite !mult_IZR, plus_IZR, !mult_IZR in K.
  assert (U : dot u z = IZR (fs f) * dot d x).
  { unfold u. rewrite dot_vadd, dot_repeat0, Rplus_0_l, dot_map_mul, dot_hmul. f_equal. apply dot_ext. intros i Hi.
    rewrite Hz by lia. reflexivity. }
  pose proof (solve_ok (fT f) u z) as V. fold y r in V.
  pose proof (cauchy_rows y (fT f) z) as C1.
  pose proof (cauchy_slack (IZR m) r Hm (fe f) z Lr ltac:(intros a Ha; apply IZR_le; apply least_ok; assumption)) as C2.
  destruct (dot_squares_pos _ He z) as [P0 _]. pose proof (sumsq_pos (fT f) z) as P1.
  set (W := dot (fe f) (squares z)) in *. set (Y := IZR (size2 y)) in *. set (r2 := IZR (size2 r)) in *.
  pose proof (size2_pos y) as Yp. pose proof (size2_pos r) as rp. fold Y in Yp. fold r2 in rp.
  assert (Im : 0 < / IZR m) by (apply Rinv_0_lt_compat; assumption).
  assert (Rm : 0 <= r2 / IZR m) by (unfold Rdiv; apply Rmult_le_pos; lra).
  assert (J : dot u z * dot u z <= (Y + r2 / IZR m) * (sumsq (fT f) z + W)).
  { rewrite V. apply join; try assumption. replace (r2 / IZR m * W) with (r2 * (W / IZR m)) by (field; lra). exact C2. }
  set (a := bil A x x) in *. set (s := IZR (fs f)) in *.
  assert (G : dot u z * dot u z <= (Y + r2 / IZR m) * (2 * a)) by (eapply Rle_trans; [exact J|apply Rmult_le_compat_l; lra]).
  assert (F : 2 * IZR q * (Y + r2 / IZR m) <= IZR p * (s * s)).
  { apply (Rmult_le_reg_l (IZR m)); [assumption|].
    replace (IZR m * (2 * IZR q * (Y + r2 / IZR m))) with (2 * IZR q * (IZR m * Y + r2)) by (field; lra). lra. }
  rewrite U in G. assert (A0 : 0 <= a) by lra. apply (Rmult_le_reg_l (s * s)); [nra|].
  replace (s * s * (IZR q * (dot d x * dot d x))) with (IZR q * (s * dot d x * (s * dot d x))) by ring.
  eapply Rle_trans; [apply Rmult_le_compat_l; [lra|exact G]|].
  replace (IZR q * ((Y + r2 / IZR m) * (2 * a))) with (2 * IZR q * (Y + r2 / IZR m) * a) by ring.
  replace (s * s * (IZR p * a)) with (IZR p * (s * s) * a) by ring. apply Rmult_le_compat_r; assumption.
Qed.
