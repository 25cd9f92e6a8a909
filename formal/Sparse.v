(** Leader groups of many nodes, each proved by a sparse factor [R] that stands in the document. With [z = B c], [B] a basis of
    all [z] that occur, and [c_i = s_i x_k], [k] the place of node [i] among those eliminated,

        z'Sz = kappa |R'x|^2 + x'E x,

    and [x'E x >= 0] if the diagonal of [E] dominates, with weights. Nothing is proved of how [R], [s], weights or order are
    found, and lists of entries need not be in order: what they mean are sums. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Table Dominance Group.
Open Scope R_scope.

(** * Sparse rows: places with integers *)
Definition row := list (nat * Z).
Fixpoint along (l : row) (x : nat -> R) : R := match l with [] => 0 | (i, v) :: l' => IZR v * x i + along l' x end.
Definition times_row (y : Z) (l : row) : row := map (fun e => (fst e, (y * snd e)%Z)) l.
(** [a + y b] *)
Fixpoint add_row (y : Z) (a : row) : row -> row :=
  match a with
  | [] => times_row y
  | (i, v) :: a' => fix go (b : row) : row := match b with
    | [] => a
    | (j, w) :: b' => match Nat.compare i j with
      | Eq => (i, v + y * w)%Z :: add_row y a' b'
      | Lt => (i, v) :: add_row y a' b
      | Gt => (j, y * w)%Z :: go b' end end end.
Definition rows := M.t row.
Definition at_ (m : rows) (i : nat) : row := match M.find i m with Some l => l | None => [] end.
Definition add_at (i : nat) (y : Z) (b : row) (m : rows) : rows := M.add i (add_row y (at_ m i) b) m.
Definition none : rows := M.empty row.
(** [sum_a x_a (row_a x)] *)
Definition form_of (n : nat) (m : nat -> row) (x : nat -> R) : R := fsum (seq 0 n) (fun a => x a * along (m a) x).

Lemma along_times y l x : along (times_row y l) x = IZR y * along l x.
Proof. induction l as [|[i v] l IH]; simpl; [ring|]. fold (times_row y l). rewrite IH, mult_IZR. ring. Qed.
Lemma along_add y a : forall b x, along (add_row y a b) x = along a x + IZR y * along b x.
Proof.
  induction a as [|[i v] a IH]; intros b x.
  - change (add_row y [] b) with (times_row y b). rewrite along_times. simpl. ring.
  - induction b as [|[j w] b IHb]; [simpl; ring|]. cbn [add_row]. destruct (Nat.compare_spec i j) as [E|E|E].
    + subst j. cbn [along]. rewrite IH, plus_IZR, mult_IZR. ring.
    + cbn [along]. rewrite IH. cbn [along]. ring.
    + change (along ((j, (y * w)%Z) :: add_row y ((i, v) :: a) b) x = along ((i, v) :: a) x + IZR y * along ((j, w) :: b) x).
      cbn [along]. rewrite IHb, mult_IZR. cbn [along]. ring.
Qed.
Lemma at_none i : at_ none i = [].
Proof. unfold at_, none. rewrite Table.F.empty_o. reflexivity. Qed.
Lemma at_set i l m j : at_ (M.add i l m) j = if (i =? j)%nat then l else at_ m j.
Proof.
  unfold at_. rewrite Table.F.add_o. destruct (OrderedTypeEx.Nat_as_OT.eq_dec i j) as [->|N]; [rewrite Nat.eqb_refl; reflexivity|].
  destruct (Nat.eqb_spec i j); [contradiction|reflexivity].
Qed.
Lemma along_at i y b m j x : along (at_ (add_at i y b m) j) x = along (at_ m j) x + if (i =? j)%nat then IZR y * along b x else 0.
Proof. unfold add_at. rewrite at_set. destruct (Nat.eqb_spec i j) as [->|_]; [apply along_add|ring]. Qed.

(** * Sums of squares of columns, and what they leave *)
Section Places.
Variables (n : nat) (x : nat -> R).
Hypothesis Hx : forall a, (n <= a)%nat -> x a = 0.
Lemma pick a v : fsum (seq 0 n) (fun i => x i * if (a =? i)%nat then v else 0) = x a * v.
Proof.
  destruct (Nat.lt_ge_cases a n) as [L|L].
  - rewrite <- (fsum_at n 0 a (fun i => x i * v)) by lia. apply fsum_ext. intros i _. destruct (a =? i)%nat; ring.
  - rewrite (Hx a L), Rmult_0_l. rewrite (fsum_ext _ _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|].
    intros i Hi. apply in_seq in Hi. destruct (Nat.eqb_spec a i); [lia|ring].
Qed.
Lemma form_add a y b m : form_of n (at_ (add_at a y b m)) x = form_of n (at_ m) x + x a * (IZR y * along b x).
Proof.
  unfold form_of. rewrite <- (pick a (IZR y * along b x)), <- fsum_plus. apply fsum_ext. intros i _. rewrite along_at. ring.
Qed.
Lemma form_none : form_of n (at_ none) x = 0.
Proof.
  unfold form_of. rewrite (fsum_ext _ _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|]. intros i _. rewrite at_none. simpl. ring.
Qed.
(** the square of [l], with [twice] its double: each entry times itself and twice what follows *)
Fixpoint add_square (l twice : row) (m : rows) : rows :=
  match l, twice with (a, r) :: l', _ :: t' => add_square l' t' (add_at a r ((a, r) :: t') m) | _, _ => m end.
Lemma square_ok l : forall m, form_of n (at_ (add_square l (times_row 2 l) m)) x = form_of n (at_ m) x + along l x * along l x.
Proof.
  induction l as [|[a r] l IH]; intros m; cbn [times_row map add_square]; [simpl; ring|]. fold (times_row 2 l).
  rewrite IH, form_add. cbn [along]. rewrite along_times. ring.
Qed.
Definition squares_of (R : list row) : rows := fold_left (fun m l => add_square l (times_row 2 l) m) R none.
Lemma squares_ok R : 0 <= form_of n (at_ (squares_of R)) x.
Proof.
  unfold squares_of. assert (G : forall m, 0 <= form_of n (at_ m) x -> 0 <= form_of n (at_ (fold_left (fun m l => add_square l (times_row 2 l) m) R m)) x).
  { induction R as [|l R IH]; intros m H; simpl; [exact H|]. apply IH. rewrite square_ok. pose proof (Rle_0_sqr (along l x)) as S. unfold Rsqr in S. lra. }
  apply G. rewrite form_none. lra.
Qed.

(** entries left of the diagonal move to the right of it *)
Definition left_of (a : nat) (e : nat * Z) : bool := match Nat.compare (fst e) a with Lt => true | _ => false end.
Definition move_row (a : nat) (l : row) (m : rows) : rows :=
  fold_right (fun e m => M.add (fst e) ((a, snd e) :: at_ m (fst e)) m) m (filter (left_of a) l).
Definition moved (f : nat -> row) : rows := fold_right (fun a m => move_row a (f a) m) none (seq 0 n).
Definition folded (f : nat -> row) (low : rows) (a : nat) : row := add_row 1 (filter (fun e => negb (left_of a e)) (f a)) (at_ low a).
Lemma move_ok a l m : form_of n (at_ (move_row a l m)) x = form_of n (at_ m) x + x a * along (filter (left_of a) l) x.
Proof.
  unfold move_row. induction (filter (left_of a) l) as [|[j v] k IH]; cbn [fold_right along fst snd]; [ring|].
  match goal with |- form_of n (at_ (M.add j _ ?m')) x = _ => set (q := m') in * end.
  assert (E : form_of n (at_ (M.add j ((a, v) :: at_ q j) q)) x = form_of n (at_ q) x + x j * (IZR v * x a)).
  { unfold form_of. rewrite <- (pick j (IZR v * x a)), <- fsum_plus. apply fsum_ext. intros i _. rewrite at_set.
    destruct (Nat.eqb_spec j i) as [->|_]; cbn [along]; ring. }
  rewrite E, IH. ring.
Qed.
Lemma along_split P l : along l x = along (filter P l) x + along (filter (fun e => negb (P e)) l) x.
Proof. induction l as [|[i v] l IH]; simpl; [ring|]. rewrite IH. destruct (P (i, v)); simpl; ring. Qed.
Lemma folded_ok f : form_of n (folded f (moved f)) x = form_of n f x.
Proof.
  assert (Mv : form_of n (at_ (moved f)) x = fsum (seq 0 n) (fun a => x a * along (filter (left_of a) (f a)) x)).
  { unfold moved. induction (seq 0 n) as [|a l IH]; simpl; [apply form_none|]. rewrite move_ok, IH. ring. }
  transitivity (fsum (seq 0 n) (fun a => x a * along (filter (fun e => negb (left_of a e)) (f a)) x) + form_of n (at_ (moved f)) x).
  - unfold form_of. rewrite <- fsum_plus. apply fsum_ext. intros a _. unfold folded. rewrite along_add. ring.
  - rewrite Mv, <- fsum_plus. apply fsum_ext. intros a _. rewrite (along_split (left_of a) (f a)). ring.
Qed.
End Places.

(** twice what a row leaves of its diagonal, and what it takes from others *)
Definition spare_of (D : M.t Z) (a : nat) (da : Z) (e : nat * Z) (s : Z * M.t Z) : Z * M.t Z :=
  if (fst e =? a)%nat then (fst s + 2 * snd e * (da * da), snd s)%Z
  else let c := (Z.abs (snd e) * (da * get D (fst e)))%Z in (fst s - c, bump (fst e) (- c) (snd s))%Z.
Definition spare_row (D : M.t Z) (a : nat) (l : row) (m : M.t Z) : M.t Z :=
  let s := fold_right (spare_of D a (get D a)) (0%Z, m) l in bump a (fst s) (snd s).
Definition spares (n : nat) (D : M.t Z) (f : nat -> row) : M.t Z := fold_right (fun a m => spare_row D a (f a) m) (M.empty Z) (seq 0 n).
Section Spare.
Variables (n : nat) (D : M.t Z) (y : nat -> R).
Hypothesis Hy : forall a, (n <= a)%nat -> y a = 0.
Hypothesis HD : forall a, (0 <= get D a)%Z.
Let x (a : nat) := IZR (get D a) * y a.
Lemma total_any i v m : total n (bump i v m) (fun j => sq (y j)) = total n m (fun j => sq (y j)) + IZR v * sq (y i).
Proof.
  destruct (Nat.lt_ge_cases i n) as [L|L]; [apply total_bump; exact L|]. rewrite (Hy i L). unfold sq at 3. rewrite Rmult_0_l, Rmult_0_r, Rplus_0_r.
  unfold total. apply fsum_ext. intros j Hj. apply in_seq in Hj. rewrite get_bump. destruct (Nat.eqb_spec i j); [lia|reflexivity].
Qed.
Lemma spare_row_ok a l m : total n (spare_row D a l m) (fun j => sq (y j)) <= total n m (fun j => sq (y j)) + 2 * (x a * along l x).
Proof.
  unfold spare_row. cbv zeta. rewrite total_any.
  enough (G : let s := fold_right (spare_of D a (get D a)) (0%Z, m) l in
    total n (snd s) (fun j => sq (y j)) + IZR (fst s) * sq (y a) <= total n m (fun j => sq (y j)) + 2 * (x a * along l x)) by exact G.
  induction l as [|[j v] l IH]; cbn [fold_right along]; [simpl; lra|]. cbv zeta in IH |- *.
  set (s := fold_right _ _ l) in *. unfold spare_of. cbn [fst snd]. destruct (Nat.eqb_spec j a) as [->|N].
  - cbn [fst snd]. rewrite plus_IZR, !mult_IZR. unfold x at 2. unfold x at 1 in IH. unfold x at 1. unfold sq in *. lra.
  - cbn [fst snd]. rewrite total_any, minus_IZR, opp_IZR, !mult_IZR, abs_IZR.
    pose proof (cross (IZR v) (y a) (y j)) as C.
    pose proof (IZR_le _ _ (HD a)) as Da. pose proof (IZR_le _ _ (HD j)) as Dj.
    assert (B : 0 <= IZR (get D a) * IZR (get D j)) by (apply Rmult_le_pos; assumption).
    apply (Rmult_le_compat_l _ _ _ B) in C. unfold x at 2. unfold x at 1. unfold x at 1 in IH. unfold sq in *. lra.
Qed.
Lemma spares_ok f : total n (spares n D f) (fun j => sq (y j)) <= 2 * form_of n f x.
Proof.
  unfold spares, form_of. induction (seq 0 n) as [|a l IH]; simpl; [rewrite total_empty; lra|].
  pose proof (spare_row_ok a (f a) (fold_right (fun a m => spare_row D a (f a) m) (M.empty Z) l)) as S. lra.
Qed.
End Spare.
(** [T - kappa G], each row formed once *)
Definition less_rows (n : nat) (T : rows) (kappa : Z) (G : rows) : rows :=
  fold_right (fun a m => M.add a (add_row (- kappa) (at_ T a) (at_ G a)) m) none (seq 0 n).
Lemma less_ok n T kappa G x : form_of n (at_ (less_rows n T kappa G)) x = form_of n (at_ T) x - IZR kappa * form_of n (at_ G) x.
Proof.
  assert (A : forall a, (a < n)%nat -> at_ (less_rows n T kappa G) a = add_row (- kappa) (at_ T a) (at_ G a)).
  { intros a Ha. unfold less_rows. assert (I : In a (seq 0 n)) by (apply in_seq; lia). induction (seq 0 n) as [|b l IH]; [destruct I|].
    cbn [fold_right]. rewrite at_set. destruct (Nat.eqb_spec b a) as [->|N]; [reflexivity|]. destruct I as [I|I]; [contradiction|]. apply IH. exact I. }
  replace (form_of n (at_ T) x - IZR kappa * form_of n (at_ G) x) with (form_of n (at_ T) x + - IZR kappa * form_of n (at_ G) x) by ring.
  unfold form_of. rewrite <- fsum_scal, <- fsum_plus. apply fsum_ext. intros a Ha. apply in_seq in Ha.
  rewrite A by lia. rewrite along_add, opp_IZR. ring.
Qed.
(** [x'T x >= 0] *)
Definition nonnegative (n : nat) (T : rows) (kappa : Z) (R : list row) (d : list Z) : bool :=
  let D := table d in let f := at_ (less_rows n T kappa (squares_of R)) in
  let low := moved n f in let m := spares n D (folded f low) in
  (0 <=? kappa)%Z && (length d =? n)%nat && forallb (Z.ltb 0) d && forallb (fun a => 0 <=? get m a)%Z (seq 0 n).
Theorem nonnegative_ok n T kappa R d x : nonnegative n T kappa R d = true -> (forall a, (n <= a)%nat -> x a = 0) ->
  0 <= form_of n (at_ T) x.
Proof.
  intros H Hx. unfold nonnegative in H. cbv zeta in H. set (f := at_ (less_rows n T kappa (squares_of R))) in H.
  apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  apply Z.leb_le, IZR_le in H1. apply Nat.eqb_eq in H2. rewrite forallb_forall in H3, H4. set (D := table d) in *.
  assert (HD : forall a, (0 <= get D a)%Z).
  { intros a. unfold D. rewrite get_table. destruct (Nat.lt_ge_cases a (length d)) as [L|L].
    - specialize (H3 _ (nth_In d 0%Z L)). apply Z.ltb_lt in H3. lia.
    - rewrite nth_overflow by exact L. lia. }
  assert (HD' : forall a, (a < n)%nat -> 0 < IZR (get D a)).
  { intros a Ha. apply IZR_lt. unfold D. rewrite get_table. apply Z.ltb_lt. apply H3. apply nth_In. lia. }
  set (y := fun a => if (a <? n)%nat then x a / IZR (get D a) else 0).
  assert (Hy : forall a, (n <= a)%nat -> y a = 0) by (intros a Ha; unfold y; destruct (Nat.ltb_spec a n); [lia|reflexivity]).
  assert (Ex : forall a, IZR (get D a) * y a = x a).
  { intros a. unfold y. destruct (Nat.ltb_spec a n) as [L|L]; [|rewrite (Hx a L); ring]. pose proof (HD' a L). field. lra. }
  pose proof (spares_ok n D y Hy HD (folded f (moved n f))) as S. set (m := spares n D _) in *.
  assert (P : 0 <= total n m (fun j => sq (y j))).
  { unfold total. apply Rle_trans with (fsum (seq 0 n) (fun _ => 0 * 1)); [rewrite fsum_scal; lra|]. apply fsum_le. intros a Ha.
    specialize (H4 a Ha). apply Z.leb_le, IZR_le in H4. rewrite Rmult_0_l. apply Rmult_le_pos; [exact H4|apply sq_pos]. }
  assert (E : form_of n (folded f (moved n f)) (fun a => IZR (get D a) * y a) = form_of n (folded f (moved n f)) x).
  { assert (AE : forall l, along l (fun a => IZR (get D a) * y a) = along l x) by (induction l as [|[i v] l IH]; simpl; [reflexivity|rewrite IH, Ex; reflexivity]).
    unfold form_of. apply fsum_ext. intros a _. rewrite AE, Ex. reflexivity. }
  rewrite E, (folded_ok n x Hx) in S. pose proof (squares_ok n x Hx R) as Q.
  unfold f in S. rewrite less_ok in S. apply (Rmult_le_compat_l _ _ _ H1) in Q. rewrite Rmult_0_r in Q. lra.
Qed.
