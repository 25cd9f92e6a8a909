(** Double integrators of the cascade as a record, and what it claims: what must be read besides [AgentCertificate.v]. *)
Require Import ZArith QArith Qreals List Bool Reals.
From Coquelicot Require Import Coquelicot.
Require Import Certificate AgentCertificate.
Import ListNotations. Open Scope R_scope.

(** of [team] the graph, [slope], the functions used, [agree], [drift], [axes] and [tops] count, and [alpha] as its
    damping, not its gains; [firsts] bounds roots of the functions used at the begin, of positions and of what drives
    them; [stops]: velocities vanish at the deadline *)
Record cascade := Cascade { team : agents; firsts : list (Q * Q); stops : bool }.
Definition alpha c : R := at_ (damping (team c)) 1.
Definition lp c := lap (edges (graph (team c))).
Definition theta c t : R := sq (1 - Q2R (slope (team c)) / eta (team c) t) / k (graph (team c)).
(** [x 0] positions, [x 1] velocities: the input [d/dt(eta e) + alpha eta (eta e - v)], [e = - L (x - h)], written out *)
Definition steer c h (x : nat -> nat -> R) t j : R := let g := eta (team c) t in let e j := - lp c (placed h x 0) j in
  sq g * ((alpha c + theta c t) * e j - lp c (x 1%nat) j / g - alpha c * x 1%nat j / g).
(** as agents that fly, with this input *)
Definition tracks c h (X : R -> nat -> nat -> R) (S : R -> nat -> R) : Prop := let G := graph (team c) in slides G S /\
  (forall j, (j < order G)%nat -> S 0 j = 0) /\ forall t j, (j < order G)%nat -> t < deadline G -> (0 < t ->
   is_derive (fun u => X u 1%nat j - S u j) t (steer c h (X t) t j) /\
   is_derive (fun u => X u 0%nat j) t (X t 1%nat j)) /\ continuous (fun u => S (Rmax 0 u) j) t /\
  forall i, (i < 2)%nat -> continuous (fun u => X (Rmax 0 u) i j) t.
Definition launch_claim c : Prop := forall h x0, exists X S, tracks c h X S /\
  forall i j, (i < 2)%nat -> (j < order (graph (team c)))%nat -> X 0 i j = x0 i j.
(** how far velocities are from those that the protocol commands; how far that carries what falls at the rate [b] *)
Definition lag c h x t j : R := x 1%nat j + eta (team c) t * lp c (placed h x 0) j.
Definition carried c b t : R := let s := turns (team c) in
  RInt (fun r => exp (- (b * (s t - s r) + alpha c * s r))) 0 t.
(** the root of a function over coordinates of space; along all motions, and with the numbers of the file *)
Definition root c f m (x : nat -> nat -> R) : R := sqrt (sum m (fun i => V (edges (graph (team c))) (ly f) (x i))).
Definition course_claim c (f : func) : Prop := forall m h X S t,
  (forall i, (i < m)%nat -> tracks c (h i) (X i) (S i)) -> 0 <= t < deadline (graph (team c)) ->
  let b := Q2R (rate f) / 2 in let s := turns (team c) t in
  (forall i j, (i < m)%nat -> (j < order (graph (team c)))%nat ->
     lag c (h i) (X i t) t j = exp (- (alpha c * s)) * lag c (h i) (X i 0) 0 j) /\
  root c f m (fun i => placed (h i) (X i t) 0) <= exp (- (b * s)) * root c f m (fun i => placed (h i) (X i 0) 0) +
    root c f m (fun i => lag c (h i) (X i 0) 0) * carried c b t /\
  forall q cs x j, deviation f = Some (q, cs) -> (j < order (graph (team c)))%nat ->
    sq (x j - end_state (graph (team c)) x j) <= at_ cs j * V (edges (graph (team c))) (ly f) x.
Definition released c X S : Prop := forall x i, nth_error (axes (team c)) i = Some x ->
  tracks c (at_ (offsets x)) (X i) (S i) /\
  forall l j, (l < 2)%nat -> (j < order (graph (team c)))%nat -> X i 0 l j = at_ (nth l (begins x) []) j.
Definition roots_claim c (f : func) (p : Q * Q) : Prop := forall X S, released c X S -> let a := team c in
  root c f (length (axes a)) (fun i => placed (spot a i) (X i 0) 0) <= Q2R (fst p) /\
  root c f (length (axes a)) (fun i => lag c (spot a i) (X i 0) 0) <= Q2R (snd p).
(** at the deadline *)
Definition landing c : Prop := let a := team c in exists r, inside a r /\ forall h X S j, tracks c h X S ->
  (j < order (graph a))%nat -> let tends f y := filterlim f (at_left (deadline (graph a))) (locally y) in
  (agree a = true -> tends (fun t => away a h (X t) 0 j) 0) /\
  (drift a <> None -> tends (fun t => X t 0%nat j - away a h (X t) 0 j) (outcome a r h (X 0) 0 j)) /\
  (stops c = true -> tends (fun t => X t 1%nat j) 0).
(** the input, and what sliding variables take of it *)
Definition push_claim c : Prop := let a := team c in tops a <> [] -> forall X S t j, (j < order (graph a))%nat ->
  released c X S -> 0 <= t < deadline (graph a) -> over_space a (fun i => steer c (spot a i) (X i t) t j) +
    match kind (graph a) with Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => Q2R mu1 * INR (length (axes a)) end
    <= at_ (tops a) j.

Definition true_cascade c : Prop := let a := team c in true_certificate (graph a) /\ degree a = 2%nat /\ cap a = None /\
  0 < alpha c /\ launch_claim c /\ landing c /\ ends_claim a /\ push_claim c /\ forall i j,
  nth_error (used a) i = Some j -> exists f, nth_error (funcs (graph a)) j = Some f /\ course_claim c f /\
    forall p, nth_error (firsts c) i = Some p -> roots_claim c f p.
