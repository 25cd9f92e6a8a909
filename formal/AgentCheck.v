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

(** an entry of [A_z], and of [b b' - r W - A_z W - W A_z'], as polynomials of [zeta]; at the cap of the gain [theta] is 0 *)
Definition pull_in (a : agents) : Q := rho2 (graph a) * kappa (graph a).
Definition chain (a : agents) (grows : bool) (i l : nat) : list Q :=
  padd (choose (S i =? l)%nat [1])
    (padd (choose (grows && (i =? l)%nat) (pscale (- (index i / pull_in a)) [1; - (2 * slope a); slope a * slope a]))
      (choose (S i =? degree a)%nat
        (padd [- nth l (damping a) 0] (repeat 0 (degree a - l) ++ [- nth l (plant a) 0])))).
Definition fall_entry (a : agents) (A : nat -> nat -> list Q) (i j : nat) : list Q :=
  padd [(if (S i =? degree a)%nat && (S j =? degree a)%nat then 1 else 0) - falls a * cell (W a) i j]
    (pscale (-1) (fold_right (fun l p => padd (padd (pscale (cell (W a) l j) (A i l)) (pscale (cell (W a) i l) (A j l))) p)
      [] (seq 0 (degree a)))).
Definition look (T : list (list (list Q))) (i j : nat) : list Q := nth j (nth i T []) [].
Definition fall_table (a : agents) (grows : bool) : list (list (list Q)) :=
  let A := table (degree a) (chain a grows) in table (degree a) (fun i j => map reduced (fall_entry a (look A) i j)).
(** nonnegative for all [zeta] from [low] to [high]: its Bernstein matrices are *)
Definition check_interval (split : splitting) (n m : nat) (T : list (list (list Q))) (low high : Q) : bool :=
  let B := map (map (fun p => map reduced (bernstein m (moved low (high - low) p)))) T in
  forallb (fun i => psd split n (map (map (fun p => nth i p 0)) B)) (seq 0 (S m)).
Fixpoint check_points (check : Q -> Q -> bool) (low : Q) (points : list Q) (last : Q) : bool :=
  match points with [] => Qeq_bool low last | p :: l => check low p && check_points check p l last end.
(** the gain at the begin, without a cap and with one *)
Definition begin_gain (a : agents) : Q := slope a + pull_in a / span (graph a).
Definition first_gain (a : agents) : Q := match cap a with None => begin_gain a | Some G => lesser (begin_gain a) G end.
Definition check_cap (split : splitting) (a : agents) : bool := match cap a with None => true | Some G =>
  psd split (degree a) (map (map (fun p => reduced (evaluate p (/ G)))) (fall_table a false)) end.
Definition check_decrease (split : splitting) (a : agents) (points : list Q) : bool :=
  let n := degree a in let m := Nat.max n 2 in let T := fall_table a true in
  forallb (forallb (fun p : list Q => (length p <=? S m)%nat)) T && check_cap split a &&
  match points with
  | low :: p :: l => Qle_bool low (match cap a with None => 0 | Some G => / G end) &&
      check_points (check_interval split n m T) low (p :: l) (/ begin_gain a)
  | _ => match cap a with None => false | Some G => Qle_bool G (begin_gain a) end end.
Definition row_times (n : nat) (r c : nat -> Q) : Q := qsum (map (fun l => r l * c l) (seq 0 n)).
Definition check_matrices (split : splitting) (a : agents) : bool :=
  let n := degree a in psd split n (W a) && forallb pos [coupling a; falls a] &&
  (notneg (slope a) && match cap a with None => true | Some G => pos G end) && (0 <? n)%nat &&
  square n (fun i j => Qeq_bool (cell (P a) i j) (cell (P a) j i) &&
    Qeq_bool (row_times n (cell (W a) i) (fun l => cell (P a) l j)) (if (i =? j)%nat then 1 else 0)) &&
  forallb (fun i => Qeq_bool (row_times n (cell (W a) i) (fun l => nth l (gains a) 0))
    (if (S i =? n)%nat then coupling a else 0)) (seq 0 n).
Definition check_coupling (a : agents) : bool := forallb (fun k => match nth_error (funcs (graph a)) k with
  | Some f => Qle_bool 1 (coupling a * rate f) | None => false end) (used a).

(** where they end *)
Definition check_agree (a : agents) : bool := negb (agree a) || match cap a with None => true | Some _ => false end &&
  (forallb zero_vec (dD (prepare (graph a))) || negb (Qle_bool (falls a * pull_in a) (2 * index (pred (degree a)))) &&
    existsb (fun k => match nth_error (funcs (graph a)) k with
      | Some f => match deviation f with Some _ => true | None => false end | None => false end) (used a)).
(** [q^m / m!] *)
Fixpoint part (q : Q) (m : nat) : Q := match m with O => 1 | S m' => q / index (S m') * part q m' end.
(** coefficients of a polynomial of [v], over [q], in which [(p + 1 + w v) P + v P'] is nearly 1: those of a series, rounded
    however, after number [j - 1], which is [b]; and how far from it. [D (p + 1)] and [D w] are the integers [P] and [W]. *)
Fixpoint powers_of (P W D j b : Z) (steps : nat) : list Z := match steps with O => [] | S s => if (b =? 0)%Z then [] else
  let v := ((P + D * j - 2 * (W * b)) / (2 * (P + D * j)))%Z in v :: powers_of P W D (j + 1) v s end.
Fixpoint misses (P W D j b : Z) (l : list Z) : Z := match l with [] => Z.abs (W * b)
  | v :: l' => (Z.abs ((P + D * j) * v + W * b) + misses P W D (j + 1) v l')%Z end.
(** [P] at 1, and how far from 1 it is *)
Definition far_q (p w : Q) : Q * Q :=
  let x := reduced (p + 1) in let y := reduced w in let P := (Qnum x * Zpos (Qden y))%Z in let W := (Qnum y * Zpos (Qden x))%Z in
  let D := (Zpos (Qden x) * Zpos (Qden y))%Z in let K := Z.to_nat (Z.abs (Qnum y) / Zpos (Qden y) + 1) in
  let b := (D * 2 ^ (256 + 2 * Z.of_nat K))%Z in let q := (P * 2 ^ (256 + 2 * Z.of_nat K))%Z in
  let l := powers_of P W D 1 b (20 * K + 400) in
  (inject_Z (fold_right Z.add 0%Z (b :: l)) / inject_Z q, inject_Z (misses P W D 1 b l) / inject_Z (D * q)).
Definition close_to (p : Q * Q) (q r : Q) : bool := Qle_bool (Qabs (fst p - q) + r) (snd p).
Definition entry_of (M : list (list (Q * Q))) (i l : nat) : Q * Q := nth l (nth i M []) (0, 0).
Definition check_rest (a : agents) (M : list (list (Q * Q))) : bool :=
  let f2 := nth 1 (damping a) 0 in let p := f2 * pull_in a in let w := (nth 1 (plant a) 0 + f2 * slope a) * span (graph a) in
  let m := span (graph a) * fst (far_q p w) in let e := snd (far_q p w) in
  (degree a =? 2)%nat && match cap a with None => true | Some _ => false end && Qeq_bool 0 (nth 0 (plant a) 0) &&
  Qeq_bool 0 (nth 0 (damping a) 0) && pos f2 && negb (Qle_bool 1 e) && close_to (entry_of M 0 0) 1 0 &&
  close_to (entry_of M 0 1) m (e / (1 - e) * Qabs m) && close_to (entry_of M 1 0) 0 0 && close_to (entry_of M 1 1) 0 0.
(** [e^(A T)] of agents that move by themselves: polynomials with integer vectors over [2^p] as coefficients, and how far
    they are from the equation; [D T A u], with [b = D T] and [g_l = - D T a_l] *)
Definition pushes (n : nat) (b : Z) (g u : list Z) : list Z := map (fun i => if (S i =? n)%nat
  then fold_right (fun l s => nth l g 0 * nth l u 0 + s)%Z 0%Z (seq 0 n) else (b * nth (S i) u 0)%Z) (seq 0 n).
Definition total_size (n : nat) (f : nat -> Z) : Z := fold_right (fun i s => Z.abs (f i) + s)%Z 0%Z (seq 0 n).
Fixpoint strays (n : nat) (b D : Z) (g : list Z) (j : Z) (u : list Z) (l : list (list Z)) : Z :=
  let w := pushes n b g u in match l with [] => total_size n (fun i => nth i w 0%Z)
  | v :: l' => (total_size n (fun i => D * j * nth i v 0 - nth i w 0) + strays n b D g (j + 1) v l')%Z end.
(** Taylor's, rounded *)
Fixpoint vectors (n : nat) (b D : Z) (g : list Z) (j : Z) (u : list Z) (steps : nat) : list (list Z) :=
  match steps with O => [] | S s => if forallb (Z.eqb 0) u then [] else
    let v := map (fun w => (2 * w + D * j) / (2 * (D * j)))%Z (pushes n b g u) in v :: vectors n b D g (j + 1) v s end.
Definition check_drag (a : agents) (M : list (list (Q * Q))) : bool :=
  let n := degree a in let T := span (graph a) in let own := map (fun l => - (T * nth l (plant a) 0)) (seq 0 n) in
  let D := common (T :: own) in let b := scaled D T in let g := map (scaled D) own in
  let y := T * (1 + qsum (map (fun l => Qabs (nth l (plant a) 0)) (seq 0 n))) + (1 # 2) in
  let K := Z.to_nat (Qnum y / Zpos (Qden y) + 1) in let p := (2 ^ (256 + 2 * Z.of_nat K))%Z in
  good D (T :: own) && forallb (Qeq_bool 0) (damping a) && Qle_bool y (index K) && forallb (fun l =>
    let u := map (fun i => if (l =? i)%nat then p else 0%Z) (seq 0 n) in let us := vectors n b D g 1 u (20 * K + 400) in
    let e := inject_Z (strays n b D g 1 u us * 3 ^ Z.of_nat K) / inject_Z (D * p) in
    forallb (fun i => close_to (entry_of M i l) (inject_Z (fold_right (fun v s => nth i v 0 + s)%Z 0%Z (u :: us)) / inject_Z p) e) (seq 0 n))
    (seq 0 n).
Definition check_common (a : agents) : bool := match drift a with None => true | Some M =>
  if forallb (Qeq_bool 0) (plant a ++ damping a) then square (degree a) (fun i l =>
    close_to (entry_of M i l) (if (i <=? l)%nat then part (span (graph a)) (l - i) else 0) 0)
  else if forallb (Qeq_bool 0) (damping a) then check_drag a M else check_rest a M end.
Fixpoint dotq (l x : list Q) : Q := match l, x with q :: l', v :: x' => reduced (q * v + dotq l' x') | _, _ => 0 end.
Definition ends_q (c : cert) (x : list Q) : list Q :=
  let vs := map (fun b : nat * (list Q * list Q) => (fst (snd b), dotq (snd (snd b)) x)) (balanced_comps (comps c)) in
  map (fun j => reduced (fold_right (fun (p : list Q * Q) s => nth j (fst p) 0 * snd p + s) 0 vs)) (seq 0 (order c)).
Definition less (x h : list Q) : list Q := map (fun p : Q * Q => fst p - snd p) (combine x h).
Definition placed_q (x : axis) (l : nat) : list Q := let y := nth l (begins x) [] in if (l =? 0)%nat then less y (offsets x) else y.
Definition check_axis (a : agents) (M : list (list (Q * Q))) (x : axis) : bool :=
  let n := degree a in let N := order (graph a) in
  let E := map (fun l => ends_q (graph a) (placed_q x l)) (seq 0 n) in
  (length (arrivals x) <=? n)%nat && (length (nth 0 (begins x) []) =? N)%nat && (length (offsets x) =? N)%nat &&
  forallb (fun i => forallb (fun j => let p := nth j (nth i (arrivals x) []) (0, 0) in
    close_to p ((if (i =? 0)%nat then nth j (offsets x) 0 else 0) + row_times n (fun l => fst (entry_of M i l)) (fun l => cell E l j))
      (row_times n (fun l => snd (entry_of M i l)) (fun l => Qabs (cell E l j))))
    (seq 0 N)) (seq 0 (length (arrivals x))).
Definition check_ends_of (a : agents) : bool := match drift a with None => true | Some M => forallb (check_axis a M) (axes a) end.

(** the input: by each function the square of what relative states take at most, over its value at the begin; that *)
Fixpoint powq (q : Q) (m : nat) : Q := match m with O => 1 | S m' => q * powq q m' end.
Definition begin_rows (a : agents) (x : axis) : list (list Q) :=
  let g := / first_gain a in
  map (fun i => map (fun q => reduced (q * powq g i)) (placed_q x i)) (seq 0 (degree a)).
Definition worth_q (a : agents) (F : Vec.mat) (m : Z) (rows : list (list Q)) : Q :=
  let n := degree a in let e := common (concat rows) in let zs := map (map (scaled e)) rows in
  let G := map (fun z => let l := Vec.lincomb z F in map (zdot l) zs) zs in
  qsum (map (fun i => qsum (map (fun j => reduced (cell (P a) i j *
    (inject_Z (nth j (nth i G []) 0%Z + nth i (nth j G []) 0%Z) / inject_Z (2 * m * (e * e))))) (seq 0 n))) (seq 0 n)).
Definition check_rows (N : nat) (rows : list (list Q)) : bool :=
  forallb (fun r : list Q => (length r =? N)%nat && good (common (concat rows)) r) rows.
Definition check_begins (a : agents) : bool := let N := order (graph a) in
  forallb (fun x => (length (offsets x) =? N)%nat && (length (nth 0 (begins x) []) =? N)%nat) (axes a) &&
  forallb (check_rows N) (map (begin_rows a) (axes a)).
(** over all coordinates of space *)
Definition worth_all (a : agents) (F : Vec.mat) (m : Z) : Q := qsum (map (worth_q a F m) (map (begin_rows a) (axes a))).
(** a bound of the gain, of which the power is never above what the decay leaves *)
Definition pace (a : agents) : option Q :=
  if Qle_bool (2 * index (degree a)) (falls a * pull_in a) then Some (first_gain a) else cap a.
(** what each function used proves of deviations: constants by agent, and its value at the begin *)
Definition deviating (a : agents) : list (list Q * Q) := flat_map (fun k => match nth_error (funcs (graph a)) k with None => [] | Some f =>
  match deviation f, form (order (graph a)) (dls (prepare (graph a))) (dL (prepare (graph a))) (ly f) with
  | Some (_, cs), Some (F, m) => [(cs, worth_all a F m)] | _, _ => [] end end) (used a).
(** a root that is as near for small numbers *)
Definition near_root (q : Q) : Q := let s := inject_Z (2 ^ Z.log2 (Zpos (Qden q) / Z.max 1 (Qnum q))) in root (q * (s * s)) / s.
(** agents that meet at rest, whose [eta e^(-f_2 s - a_2 t)] does not grow *)
Definition slows (a : agents) : bool := let f2 := nth 1 (damping a) 0 in
  (degree a =? 2)%nat && match cap a with None => true | Some _ => false end && Qeq_bool 0 (nth 0 (plant a) 0) &&
  Qeq_bool 0 (nth 0 (damping a) 0) && pos f2 && Qle_bool 1 (f2 * pull_in a) &&
  notneg (nth 1 (plant a) 0 + (f2 - / pull_in a) * begin_gain a) && Qle_bool (2 * index (degree a)) (falls a * pull_in a).
(** what feedback of the own state adds to the input of an agent, by each function that proves it *)
Definition own_parts (a : agents) (known : list (list Q * Q)) (j : nat) : list Q :=
  if forallb (Qeq_bool 0) (damping a) then [0] else if slows a then
    let f2 := nth 1 (damping a) 0 in let g := begin_gain a in
    let v := near_root (qsum (map (fun x => let q := nth j (ends_q (graph a) (placed_q x 1)) 0 in q * q) (axes a))) in
    map (fun p : list Q * Q => f2 * g * (g * near_root (nth j (fst p) 0 * cell (W a) 1 1 * snd p) + v)) known
  else [].
Definition check_tops (a : agents) : bool := match tops a, pace a with [], _ => true | _, None => false | l, Some g =>
  let c := graph a in let n := degree a in let d := prepare c in
  let added := match kind c with Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => mu1 * index (length (axes a)) end in
  let known := flat_map (fun k => match nth_error (funcs c) k with None => [] | Some f =>
    match bounds_of c d f, form (order c) (dls d) (dL d) (ly f) with
    | Some (_, cs, _), Some (F, m) =>
        [(cs, reduced (powq g (2 * n) * (coupling a * nth (pred n) (gains a) 0) * worth_all a F m))]
    | _, _ => [] end end) (used a) in
  let away := if forallb (Qeq_bool 0) (damping a) then [] else deviating a in
  fits (order c) (dL d) && good (common (start c)) (start c) && check_begins a &&
  forallb (fun j => let most := nth j l 0 - added - qsum (map (fun x => Qabs (nth 0 (plant a) 0 * nth j (offsets x) 0)) (axes a)) in
    existsb (fun own => let rest := most - own in
      Qle_bool 0 rest && existsb (fun p : list Q * Q => Qle_bool (nth j (fst p) 0 * snd p) (rest * rest)) known) (own_parts a away j))
    (seq 0 (order c)) end.

(** what is left at the deadline under a cap, which the gain reaches [w] before it: [e^y <= T/w] if the clock goes that far *)
Definition check_left (a : agents) : bool := match left_over a, cap a with None, _ => true | _, None => false | Some (q, rows), Some G =>
  let c := graph a in let n := degree a in
  let w := if Qle_bool G (begin_gain a) then span c else pull_in a / (G - slope a) in
  let y := reduced ((q - slope a * (span c - w) - G * w) / pull_in a) in let y := if notneg y then y else 0 in
  let b := twice_4 (floor (horner (reduced (falls a * q / 16)) 0 100)) in
  let known := deviating a in
  notneg q && negb (Qle_bool 1 (term (y / 16) 0 101)) && Qle_bool (twice_4 (ceil (above (y / 16)))) (span c / w) && check_begins a &&
  forallb (fun j => forallb (fun i => let x := nth i (nth j rows []) 0 in notneg x && existsb (fun p : list Q * Q =>
    Qle_bool (powq G (2 * i) * (nth j (fst p) 0 * cell (W a) i i * snd p)) (x * x * b)) known) (seq 0 n)) (seq 0 (order c)) end.
