(** Agents of order n as a record, and what it claims: what must be read besides [Certificate.v]. *)
Require Import ZArith QArith Qreals List Bool Reals.
From Coquelicot Require Import Coquelicot.
Require Import Certificate.
Import ListNotations. Open Scope R_scope.

(** one coordinate of space: the offsets by agent; by derivative and agent where the agents begin, and where they end *)
Record axis := Axis { offsets : list Q; begins : list (list Q); arrivals : list (list (Q * Q)) }.
(** [x^(n) + a_n x^(n-1) + .. + a_1 x = u] of every node of [graph], under the protocol of it but for [slope], which
    takes the place of [rho1], and [cap], which the gain does not exceed; which functions of [graph] are used, and whether
    all agree at the deadline; [drift] takes the common motion there from time 0, by middles and radii; [tops] bounds the
    inputs by agent; [left_over] is how far the clock goes at least, and by agent and derivative what is left at the
    deadline under a cap *)
Record agents := Agents { graph : cert; degree : nat; slope : Q; cap : option Q; plant : list Q; damping : list Q;
  gains : list Q; W : list (list Q); P : list (list Q); coupling : Q; falls : Q; used : list nat; agree : bool;
  drift : option (list (list (Q * Q))); axes : list axis; tops : list Q; left_over : option (Q * list (list Q)) }.

Definition at_ (l : list Q) (i : nat) : R := Q2R (nth i l 0%Q).
Definition sum (n : nat) (f : nat -> R) : R := fold_right (fun i a => f i + a) 0 (seq 0 n).
Definition double (n : nat) (A : list (list Q)) (G : nat -> nat -> R) : R :=
  sum n (fun i => sum n (fun j => at_ (nth i A []) j * G i j)).
(** the gain, and its integral from 0: the clock *)
Definition eta (a : agents) t : R := let g := gain (deadline (graph a)) (Q2R (slope a)) (k (graph a)) t in
  match cap a with None => g | Some G => Rmin g (Q2R G) end.
Definition turns (a : agents) t : R := RInt (eta a) 0 t.
(** [x i j] is derivative [i] of agent [j]; less its offset [h j]; by powers of the gain *)
Definition placed (h : nat -> R) (x : nat -> nat -> R) i j : R := x i j - if (i =? 0)%nat then h j else 0.
Definition y a (h : nat -> R) x t i j : R := placed h x i j / eta a t ^ i.
Definition control a h x t j : R := at_ (plant a) 0 * h j - eta a t ^ degree a * sum (degree a) (fun i =>
  at_ (gains a) i * lap (edges (graph a)) (y a h x t i) j + at_ (damping a) i * y a h x t i j).
(** On [0, T) derivatives are derivatives, and the highest less the sliding variable, which begins at 0, obeys the
    equation where [t > 0]; all are continuous. *)
Definition flies a h (X : R -> nat -> nat -> R) (S : R -> nat -> R) : Prop := slides (graph a) S /\
  (forall j, (j < order (graph a))%nat -> S 0 j = 0) /\
  forall t j, (j < order (graph a))%nat -> t < deadline (graph a) -> (0 < t ->
   is_derive (fun u => X u (pred (degree a)) j - S u j) t
     (control a h (X t) t j - sum (degree a) (fun i => at_ (plant a) i * X t i j)) /\
   forall i, (i < pred (degree a))%nat -> is_derive (fun u => X u i j) t (X t (1 + i)%nat j)) /\
  continuous (fun u => S (Rmax 0 u) j) t /\ forall i, (i < degree a)%nat -> continuous (fun u => X (Rmax 0 u) i j) t.
(** from every state, and for all offsets, a motion starts: nothing that is said of all is void *)
Definition existence_claim (a : agents) : Prop := forall h x0, exists X S, flies a h X S /\
  forall i j, (i < degree a)%nat -> (j < order (graph a))%nat -> X 0 i j = x0 i j.
(** the function of two states of which [V] is that of one; of all derivatives *)
Definition pair es m (x z : nat -> R) : R := (V es m (fun j => x j + z j) - V es m (fun j => x j - z j)) / 4.
Definition value a (f : func) (x : nat -> nat -> R) : R :=
  double (degree a) (P a) (fun i j => pair (edges (graph a)) (ly f) (x i) (x j)).

(** [W] is positive definite, [P] its inverse, and the gains are the last row of it times [coupling] *)
Definition definite (a : agents) : Prop := (forall x, 0 <= double (degree a) (W a) (fun i j => x i * x j)) /\
  forall i, (i < degree a)%nat ->
    sum (degree a) (fun l => at_ (nth i (W a) []) l * at_ (gains a) l) =
      (if (1 + i =? degree a)%nat then Q2R (coupling a) else 0) /\ forall j, (j < degree a)%nat ->
    sum (degree a) (fun l => at_ (nth i (W a) []) l * at_ (nth l (P a) []) j) = if (i =? j)%nat then 1 else 0.
(** how far derivative [i] of agent [j] is from the common motion *)
Definition away a h x i j : R := placed h x i j - end_state (graph a) (placed h x i) j.
(** along every motion: [V] falls, and so does what parts every derivative of every agent from the common motion *)
Definition agent_claim (a : agents) (f : func) : Prop := forall h X S t, flies a h X S ->
  0 <= t < deadline (graph a) -> let v := exp (- (Q2R (falls a) * turns a t)) * value a f (y a h (X 0) 0) in
  value a f (y a h (X t) t) <= v /\ forall b cs i j, deviation f = Some (b, cs) -> (i < degree a)%nat ->
    (j < order (graph a))%nat -> sq (away a h (X t) i j) <= sq (eta a t ^ i) * (at_ cs j * at_ (nth i (W a) []) i * v).
(** at the deadline, if there is no cap, all derivatives of all agents are those of the common motion; where that is, by
    a matrix that [drift] encloses *)
Definition outcome a r h x i j : R := (if (i =? 0)%nat then h j else 0) +
  sum (degree a) (fun l => r i l * end_state (graph a) (placed h x l) j).
Definition inside a (r : nat -> nat -> R) : Prop := forall M i l, drift a = Some M -> (i < degree a)%nat ->
  (l < degree a)%nat -> let p := nth l (nth i M []) (0%Q, 0%Q) in Rabs (Q2R (fst p) - r i l) <= Q2R (snd p).
Definition agreement (a : agents) : Prop := exists r, inside a r /\ forall h X S i j, flies a h X S ->
  (i < degree a)%nat -> (j < order (graph a))%nat ->
  let tends f y := filterlim f (at_left (deadline (graph a))) (locally y) in
  (agree a = true -> tends (fun t => away a h (X t) i j) 0) /\
  (drift a <> None -> tends (fun t => X t i j - away a h (X t) i j) (outcome a r h (X 0) i j)).
(** the intervals of the final states hold these *)
Definition ends_claim (a : agents) : Prop := forall r x i j, drift a <> None -> inside a r -> In x (axes a) ->
  (i < length (arrivals x))%nat -> (j < order (graph a))%nat -> let p := nth j (nth i (arrivals x) []) (0%Q, 0%Q) in
  Rabs (Q2R (fst p) - outcome a r (at_ (offsets x)) (fun l => at_ (nth l (begins x) [])) i j) <= Q2R (snd p).
(** by coordinate of space, motions from the states of the file on; the Euclidean norm over space *)
Definition begun a (X : nat -> R -> nat -> nat -> R) (S : nat -> R -> nat -> R) : Prop := forall x c,
  nth_error (axes a) c = Some x -> flies a (at_ (offsets x)) (X c) (S c) /\
  forall i j, (i < degree a)%nat -> (j < order (graph a))%nat -> X c 0 i j = at_ (nth i (begins x) []) j.
Definition spot a c : nat -> R := at_ (offsets (nth c (axes a) (Axis [] [] []))).
Definition over_space a (f : nat -> R) : R := sqrt (sum (length (axes a)) (fun c => sq (f c))).
(** the input, and what sliding variables take of it *)
Definition tops_claim (a : agents) : Prop := tops a <> [] -> forall X S t j, (j < order (graph a))%nat -> begun a X S ->
  0 <= t < deadline (graph a) -> over_space a (fun c => control a (spot a c) (X c t) t j) + match kind (graph a) with
    Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => Q2R mu1 * INR (length (axes a)) end <= at_ (tops a) j.
(** from some instant on the clock, and what is left, are as near as one likes to these *)
Definition left_claim (a : agents) : Prop := forall q rows e, left_over a = Some (q, rows) -> 0 < e ->
  let nearly := at_left (deadline (graph a)) in nearly (fun t => Q2R q - e <= turns a t) /\
  forall X S i j, (i < degree a)%nat -> (j < order (graph a))%nat -> begun a X S ->
    nearly (fun t => over_space a (fun c => away a (spot a c) (X c t) i j) <= at_ (nth j rows []) i + e).

Definition true_agents (a : agents) : Prop := true_certificate (graph a) /\ definite a /\ agreement a /\
  ends_claim a /\ tops_claim a /\ left_claim a /\ existence_claim a /\ forall j, In j (used a) ->
  exists f, nth_error (funcs (graph a)) j = Some f /\ agent_claim a f.
