(** The executable check of the cascade, beside that of its graph. *)
Require Import ZArith QArith Qabs List Bool.
Import ListNotations.
Require Import Certificate Checker AgentCertificate AgentForms AgentCheck CascadeCertificate.
Open Scope Q_scope.

Definition uses (c : cascade) (p : func -> bool) : bool := let a := team c in
  existsb (fun k => match nth_error (funcs (graph a)) k with Some f => p f | None => false end) (used a).
(** states against which the Laplacian can be told from the coordinates of a function *)
Definition tells (d : data) (f : func) : bool := match ly f with
  | InE _ => true | InEps _ g => forallb (fun r => (zdot r g =? 0)%Z) (dL d) | Weighted _ => false end.
Definition check_law (c : cascade) : bool := let a := team c in let G := graph a in
  (degree a =? 2)%nat && match cap a with None => true | Some _ => false end && notneg (slope a) && pos (nth 1 (damping a) 0) &&
  forallb (fun k => match nth_error (funcs G) k with Some f => pos (rate f) | None => false end) (used a) &&
  match drift a with None => true | Some M => check_rest a M && Qeq_bool 0 (nth 1 (plant a) 0) end.
(** all agree, velocities vanish *)
Definition check_agreed (c : cascade) : bool := negb (agree (team c)) ||
  uses c (fun f => match deviation f with Some _ => true | None => false end).
Definition check_stops (c : cascade) : bool := negb (stops c) ||
  uses c (fun f => negb (Qle_bool (rate f * pull_in (team c)) 2) && tells (prepare (graph (team c))) f).

(** a function of one row of numbers by agent; positions less offsets, and how far velocities are from the commanded ones *)
Definition plain (a : agents) : agents := Agents (graph a) 1 (slope a) None [] [] [] [] [[1]] 0 0 [] false None [] [] None.
Definition value_q (a : agents) (F : Vec.mat) (m : Z) (row : list Q) : Q := worth_q (plain a) F m [row].
Definition pulled (d : data) (x : list Q) : list Q := let e := common x in let z := map (scaled e) x in
  map (fun r => reduced (inject_Z (zdot r z) / inject_Z (dls d * e))) (dL d).
Definition place_row (x : axis) : list Q := map reduced (placed_q x 0).
Definition added_rows (g : Q) (v x : list Q) : list Q := map (fun p : Q * Q => reduced (fst p + g * snd p)) (combine v x).
Definition lag_row (a : agents) (x : axis) : list Q :=
  added_rows (begin_gain a) (nth 1 (begins x) []) (pulled (prepare (graph a)) (place_row x)).
Definition check_shape (a : agents) : bool := let N := order (graph a) in forallb (fun x => (length (offsets x) =? N)%nat &&
  (length (nth 0 (begins x) []) =? N)%nat && (length (nth 1 (begins x) []) =? N)%nat && check_rows N [place_row x]) (axes a).
(** [r] is not below the root of the value of all rows *)
Definition check_root (a : agents) (F : Vec.mat) (m : Z) (rows : list (list Q)) (r : Q) : bool := notneg r &&
  forallb (fun row => check_rows (order (graph a)) [row]) rows && Qle_bool (qsum (map (value_q a F m) rows)) (r * r).
Definition check_roots (c : cascade) : bool := let a := team c in let G := graph a in let d := prepare G in
  match firsts c with [] => true | _ => check_shape a && forallb (fun p : nat * (Q * Q) => match nth_error (funcs G) (fst p) with
    | None => false
    | Some f => match form (order G) (dls d) (dL d) (ly f) with
      | None => false
      | Some (F, m) => check_root a F m (map place_row (axes a)) (fst (snd p)) &&
          check_root a F m (map (lag_row a) (axes a)) (snd (snd p)) end end) (combine (used a) (firsts c)) end.

(** the input: of each function used a root of the value of [X' + (alpha + theta) X] at the begin, and roots of the
    constants of the agents' inputs; of each agent its speed at the begin *)
Record thrusts := Thrusts { of_functions : list (Q * list Q); speeds : list Q }.
Definition alpha_q (a : agents) : Q := nth 1 (damping a) 0.
Definition theta_q (a : agents) : Q := let z := 1 - slope a / begin_gain a in z * z / pull_in a.
Definition mixed_row (a : agents) (x : axis) : list Q := let g := begin_gain a in
  map (fun q => reduced (/ g * q)) (added_rows ((alpha_q a + theta_q a) * g) (nth 1 (begins x) []) (place_row x)).
Definition larger (p q : Q) : Q := if Qle_bool p q then q else p.
Definition factor_q (a : agents) (f : func) : Q := let i := / pull_in a in
  larger 1 ((alpha_q a - i + alpha_q a) / (alpha_q a - i + (rate f / 2 - 2 * i))).
Definition share_of (a : agents) (p : (nat * (Q * Q)) * (Q * list Q)) : list (list Q) := let G := graph a in let d := prepare G in
  let (r, cs) := snd p in match nth_error (funcs G) (fst (fst p)) with None => [] | Some f =>
    match form (order G) (dls d) (dL d) (ly f), bounds_of G d f with Some (F, m), Some (_, es, _) =>
      let K := factor_q a f * begin_gain a * begin_gain a * (r + (/ pull_in a - theta_q a) * fst (snd (fst p))) in
      if Qle_bool 4 (rate f * pull_in a) && negb (Qle_bool (alpha_q a * pull_in a + rate f * pull_in a) 5) &&
         check_root a F m (map (mixed_row a) (axes a)) r &&
         forallb (fun j => let q := nth j cs 0 in notneg q && Qle_bool (nth j es 0) (q * q)) (seq 0 (order G))
      then [map (fun q => q * K) cs] else [] | _, _ => [] end end.
Definition check_push (c : cascade) (h : thrusts) : bool := let a := team c in let G := graph a in let d := prepare G in
  match tops a with [] => true | l =>
  let known := flat_map (share_of a) (combine (combine (used a) (firsts c)) (of_functions h)) in
  let added := match kind G with Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => mu1 * index (length (axes a)) end in
  fits (order G) (dL d) && good (common (start G)) (start G) && check_shape a && Qle_bool 1 (alpha_q a * pull_in a) &&
  forallb (fun j => let v := nth j (speeds h) 0 in notneg v &&
    Qle_bool (qsum (map (fun x => let y := nth j (nth 1 (begins x) []) 0 in y * y) (axes a))) (v * v) &&
    existsb (fun cs => Qle_bool (nth j cs 0 + alpha_q a * begin_gain a * v + added) (nth j l 0)) known) (seq 0 (order G)) end.
