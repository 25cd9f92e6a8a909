(** The executable check of agents of order n, beside that of their graph. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals.
Import ListNotations.
Require Import Certificate Checker AgentCertificate AgentForms.
Open Scope Q_scope.

(** whoever factors: a matrix as a sum of squares, its coefficients and rows *)
Definition splitting := list (list Q) -> list (Q * list Q).
Definition reduced (q : Q) : Q := let g := Z.gcd (Qnum q) (Zpos (Qden q)) in
  let r := (Qnum q / g)%Z # Z.to_pos (Zpos (Qden q) / g) in if Qeq_bool r q then r else q.
Definition table (n : nat) (f : nat -> nat -> list Q) : list (list (list Q)) :=
  map (fun i => map (f i) (seq 0 n)) (seq 0 n).
Definition choose (b : bool) (p : list Q) : list Q := if b then p else [].

(** an entry of [A_z], and of [b b' - r W - A_z W - W A_z'], as polynomials of [zeta] *)
Definition pull_in (a : agents) : Q := rho2 (graph a) * kappa (graph a).
Definition chain (a : agents) (i l : nat) : list Q :=
  padd (choose (S i =? l)%nat [1])
    (padd (choose (i =? l)%nat (pscale (- (index i / pull_in a)) [1; - (2 * slope a); slope a * slope a]))
      (choose (S i =? degree a)%nat
        (padd [- nth l (damping a) 0] (repeat 0 (degree a - l) ++ [- nth l (plant a) 0])))).
Definition fall_entry (a : agents) (A : nat -> nat -> list Q) (i j : nat) : list Q :=
  padd [(if (S i =? degree a)%nat && (S j =? degree a)%nat then 1 else 0) - falls a * cell (W a) i j]
    (pscale (-1) (fold_right (fun l p => padd (padd (pscale (cell (W a) l j) (A i l)) (pscale (cell (W a) i l) (A j l))) p)
      [] (seq 0 (degree a)))).
Definition look (T : list (list (list Q))) (i j : nat) : list Q := nth j (nth i T []) [].
Definition fall_table (a : agents) : list (list (list Q)) :=
  let A := table (degree a) (chain a) in table (degree a) (fun i j => map reduced (fall_entry a (look A) i j)).
(** nonnegative for all [zeta] from [low] to [high]: its Bernstein matrices are *)
Definition check_interval (split : splitting) (n m : nat) (T : list (list (list Q))) (low high : Q) : bool :=
  let B := map (map (fun p => map reduced (bernstein m (moved low (high - low) p)))) T in
  forallb (fun i => psd split n (map (map (fun p => nth i p 0)) B)) (seq 0 (S m)).
Fixpoint check_points (check : Q -> Q -> bool) (low : Q) (points : list Q) (last : Q) : bool :=
  match points with [] => Qeq_bool low last | p :: l => check low p && check_points check p l last end.
Definition check_decrease (split : splitting) (a : agents) (points : list Q) : bool :=
  let n := degree a in let m := Nat.max n 2 in let T := fall_table a in
  forallb (forallb (fun p : list Q => (length p <=? S m)%nat)) T &&
  match points with
  | low :: p :: l => Qle_bool low 0 && check_points (check_interval split n m T) low (p :: l) (/ (slope a + pull_in a / span (graph a)))
  | _ => false end.
Definition row_times (n : nat) (r c : nat -> Q) : Q := qsum (map (fun l => r l * c l) (seq 0 n)).
Definition check_matrices (split : splitting) (a : agents) : bool :=
  let n := degree a in psd split n (W a) && forallb pos [coupling a; falls a] && notneg (slope a) && (0 <? n)%nat &&
  square n (fun i j => Qeq_bool (cell (P a) i j) (cell (P a) j i) &&
    Qeq_bool (row_times n (cell (W a) i) (fun l => cell (P a) l j)) (if (i =? j)%nat then 1 else 0)) &&
  forallb (fun i => Qeq_bool (row_times n (cell (W a) i) (fun l => nth l (gains a) 0))
    (if (S i =? n)%nat then coupling a else 0)) (seq 0 n).
Definition check_coupling (a : agents) : bool := forallb (fun k => match nth_error (funcs (graph a)) k with
  | Some f => Qle_bool 1 (coupling a * rate f) | None => false end) (used a).

(** where they end *)
Definition check_agree (a : agents) : bool := negb (agree a) ||
  (negb (Qle_bool (falls a * pull_in a) (2 * index (pred (degree a)))) && existsb (fun k => match nth_error (funcs (graph a)) k with
    | Some f => match deviation f with Some _ => true | None => false end | None => false end) (used a)).
(** [q^m / m!] *)
Fixpoint part (q : Q) (m : nat) : Q := match m with O => 1 | S m' => q / index (S m') * part q m' end.
Definition check_common (a : agents) : bool := match drift a with None => true | Some M =>
  forallb (Qeq_bool 0) (plant a ++ damping a) && square (degree a) (fun i l =>
    Qeq_bool (cell M i l) (if (i <=? l)%nat then part (span (graph a)) (l - i) else 0)) end.
Fixpoint dotq (l x : list Q) : Q := match l, x with q :: l', v :: x' => reduced (q * v + dotq l' x') | _, _ => 0 end.
Definition ends_q (c : cert) (x : list Q) : list Q :=
  let vs := map (fun b : nat * (list Q * list Q) => (fst (snd b), dotq (snd (snd b)) x)) (balanced_comps (comps c)) in
  map (fun j => reduced (fold_right (fun (p : list Q * Q) s => nth j (fst p) 0 * snd p + s) 0 vs)) (seq 0 (order c)).
Definition less (x h : list Q) : list Q := map (fun p : Q * Q => fst p - snd p) (combine x h).
Definition placed_q (x : axis) (l : nat) : list Q := let y := nth l (begins x) [] in if (l =? 0)%nat then less y (offsets x) else y.
Definition check_axis (a : agents) (M : list (list Q)) (x : axis) : bool :=
  let n := degree a in let N := order (graph a) in
  let E := map (fun l => ends_q (graph a) (placed_q x l)) (seq 0 n) in
  (length (arrivals x) <=? n)%nat && (length (nth 0 (begins x) []) =? N)%nat && (length (offsets x) =? N)%nat &&
  forallb (fun i => forallb (fun j => let p := nth j (nth i (arrivals x) []) (0, 0) in
    Qle_bool (Qabs (fst p - ((if (i =? 0)%nat then nth j (offsets x) 0 else 0) + row_times n (cell M i) (fun l => cell E l j)))) (snd p))
    (seq 0 N)) (seq 0 (length (arrivals x))).
Definition check_ends_of (a : agents) : bool := match drift a with None => true | Some M => forallb (check_axis a M) (axes a) end.

(** the input: by each function the square of what relative states take at most, over its value at the begin; that *)
Fixpoint powq (q : Q) (m : nat) : Q := match m with O => 1 | S m' => q * powq q m' end.
Definition begin_rows (a : agents) (x : axis) : list (list Q) :=
  let g := / (slope a + pull_in a / span (graph a)) in
  map (fun i => map (fun q => reduced (q * powq g i)) (placed_q x i)) (seq 0 (degree a)).
Definition worth_q (a : agents) (F : Vec.mat) (m : Z) (rows : list (list Q)) : Q :=
  let n := degree a in let e := common (concat rows) in let zs := map (map (scaled e)) rows in
  let G := map (fun z => let l := Vec.lincomb z F in map (zdot l) zs) zs in
  qsum (map (fun i => qsum (map (fun j => reduced (cell (P a) i j *
    (inject_Z (nth j (nth i G []) 0%Z + nth i (nth j G []) 0%Z) / inject_Z (2 * m * (e * e))))) (seq 0 n))) (seq 0 n)).
Definition check_rows (N : nat) (rows : list (list Q)) : bool :=
  forallb (fun r : list Q => (length r =? N)%nat && good (common (concat rows)) r) rows.
Definition check_tops (a : agents) : bool := match tops a with [] => true | l =>
  let c := graph a in let n := degree a in let d := prepare c in let rows := map (begin_rows a) (axes a) in
  let g := slope a + pull_in a / span c in
  let added := match kind c with Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => mu1 * index (length (axes a)) end in
  let known := flat_map (fun k => match nth_error (funcs c) k with None => [] | Some f =>
    match bounds_of c d f, form (order c) (dls d) (dL d) (ly f) with
    | Some (_, cs, _), Some (F, m) => [(cs, reduced (powq g (2 * n) * (coupling a * nth (pred n) (gains a) 0) *
        qsum (map (worth_q a F m) rows)))]
    | _, _ => [] end end) (used a) in
  forallb (Qeq_bool 0) (damping a) && Qle_bool (2 * index n) (falls a * pull_in a) && fits (order c) (dL d) && good (common (start c)) (start c) &&
  forallb (fun x => (length (offsets x) =? order c)%nat && (length (nth 0 (begins x) []) =? order c)%nat) (axes a) &&
  forallb (check_rows (order c)) rows &&
  forallb (fun j => let rest := nth j l 0 - added - qsum (map (fun x => Qabs (nth 0 (plant a) 0 * nth j (offsets x) 0)) (axes a)) in
    Qle_bool 0 rest && existsb (fun p : list Q * Q => Qle_bool (nth j (fst p) 0 * snd p) (rest * rest)) known) (seq 0 (order c)) end.
