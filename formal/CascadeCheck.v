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
