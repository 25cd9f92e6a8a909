(** A certificate of a family as a record, and what it claims: with what [Certificate.v] says of graphs, motions,
    components and sliding variables all that must be read to believe the theorem of [FamilyMain.v]. *)
Require Import ZArith QArith Qreals List Bool Reals.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate. Open Scope R_scope.

(** * Families *)
(** a weight of the edge from [tail] to [head], between two numbers; if [mutual], of the reverse edge too: they change
    together *)
Record tie := Tie { head : nat; tail : nat; bottom : Q; top : Q; mutual : bool }.
(** a mode: its weights; and the graph of its mandatory edges, which cannot fail, at the smallest sizes *)
Record mode := Mode { ties : list tie; mandatory : cert }.
Definition heard t s w x i := if (t =? i)%nat then Rabs w * x t - w * x s else 0.
Definition pulls e w x i := heard (head e) (tail e) w x i + if mutual e then heard (tail e) (head e) w x i else 0.
(** [L x] with the weights [w], which the mode admits *)
Fixpoint member (l : list tie) (w : nat -> R) (x : nat -> R) (i : nat) : R :=
  match l with [] => 0 | e :: l' => pulls e (w O) x i + member l' (shift w) x i end.
Definition admits (l : list tie) (w : nat -> R) :=
  forall j e, nth_error l j = Some e -> Q2R (bottom e) <= w j <= Q2R (top e).
Definition there (e : tie) (w : Q) := Edge (head e) (tail e) w :: if mutual e then [Edge (tail e) (head e) w] else [].
Definition smallest (l : list tie) := flat_map (fun e => if Qlt_le_dec 0 (bottom e) then there e (bottom e)
  else if Qlt_le_dec (top e) 0 then there e (top e) else []) l.

(** * The record *)
(** what becomes of a part, nodes that edges join: all end at 0; at one value, up to signs; at multiples of it; between
    several *)
Inductive outcome := Stability | Consensus | Interval | Containment | Depends.
(** [still]: a basis of the states at rest, by columns, each with its pivot *)
Record part := Part { its_agents : list nat; becomes : outcome; still : list (nat * list Q) }.
(** [xi' P xi]; the largest [xi_k^2 / d_k^2]; the sum of the [p_k x_k^2] *)
Inductive shape := Form (P : list (list Q)) | Rows (d : list Q) | Squares (p : list Q).
Record lyapunov := Lyapunov { about : part; by_ : shape; decay : Q; inputs : list Q; offs : list Q;
  means : list (list Q * Q) }.
(** the agents [whom] stay between these ends, or are drawn there where they may be off by multiples of [extent] *)
Record box := Box { whom : list nat; extent : list Q; lower_end : list Q; upper_end : list Q; speed : Q }.
(** order, protocol, initial state and sliding variables are those of [frame] *)
Record family := Family { frame : cert; modes : list mode; parts : list part; bounds : list lyapunov;
  ends : list (option (Q * Q)); stays : bool; peaks : list Q; boxes : list box }.

(** * Motions *)
(** at [t] the state moves as the member of the mode [m] that has the weights [w] *)
Definition obeys (F : family) (X S : R -> nat -> R) t m w : Prop := let c := frame F in forall i, (i < order c)%nat ->
  is_derive (fun u => X u i - S u i) t (- (gain (deadline c) (Q2R (rho1 c)) (k c) t * member (ties m) w (X t) i)).
(** off a sequence of instants the state moves as some member of some mode: switches may be infinitely many, and
    arbitrarily close to each other; between them weights may change in any way *)
Definition switches (F : family) (X S : R -> nat -> R) : Prop := let c := frame F in slides c S /\
  (forall t i, t < deadline c -> (i < order c)%nat ->
     continuous (fun u => X (Rmax 0 u) i) t /\ continuous (fun u => S (Rmax 0 u) i) t) /\
  exists D : nat -> R, forall t, 0 < t < deadline c -> (forall j, t <> D j) ->
    exists m w, In m (modes F) /\ admits (ties m) w /\ obeys F X S t m w.
Definition switches_from F X S t0 := switches F X S /\ quiet (order (frame F)) (deadline (frame F)) S t0.

(** * What it claims *)
(** a signal is a mode and its weights at every instant, so that members change continuously off a sequence of instants:
    there are some, for there is a member; from every state, and all sliding variables, a motion starts under each of
    them, so nothing that follows is void *)
Definition existence_claim (F : family) : Prop := let c := frame F in
  (exists m w, In m (modes F) /\ admits (ties m) w) /\ forall m w (D : nat -> R) x0 s0,
  (forall t, In (m t) (modes F) /\ admits (ties (m t)) (w t)) ->
  (forall t x i, 0 < t < deadline c -> (forall j, t <> D j) -> continuous (fun u => member (ties (m u)) (w u) x i) t) ->
  (forall T i, kind c = Nominal T -> s0 i = 0) ->
  exists X S, switches F X S /\ (forall i, (i < order c)%nat -> X 0 i = x0 i /\ S 0 i = s0 i) /\
    forall t, 0 < t < deadline c -> (forall j, t <> D j) -> obeys F X S t (m t) (w t).
(** mandatory edges are those of the mode; their components are those listed *)
Definition mode_claim (F : family) (m : mode) : Prop := edges (mandatory m) = smallest (ties m) /\
  order (mandatory m) = order (frame F) /\ structure (mandatory m) /\ claims (mandatory m).
(** deviation from the states at rest *)
Definition xi (P : part) (x : nat -> R) (i : nat) : R :=
  x i - fold_right (fun b a => Q2R (nth i (snd b) 0%Q) * x (fst b) + a) 0 (still P).
Definition owned (m : mode) (P : part) := filter (fun C => mem (hd O (nodes C)) (its_agents P)) (comps (mandatory m)).
(** the basis is at rest in every member, and has as many columns as each mandatory graph balanced closed components; of
    a part that depends on the signal some motion stays where another member moves it: no states at rest in all members
    are reached by all motions *)
Definition part_claim (F : family) (P : part) : Prop :=
  (forall i j, In i (its_agents P) ->
    (In j (its_agents P) <-> linked (flat_map (fun e => there e 1%Q) (flat_map ties (modes F))) i j)) /\
  (becomes P <> Depends -> forall m, In m (modes F) -> length (filter is_balanced (owned m P)) = length (still P) /\
     forall w p v i, admits (ties m) w -> In (p, v) (still P) -> In i (its_agents P) ->
       member (ties m) w (fun j => Q2R (nth j v 0%Q)) i = 0) /\
  match becomes P with Stability => still P = []
  | Consensus => exists p v, still P = [(p, v)] /\ forall i, In i (its_agents P) -> sq (Q2R (nth i v 0%Q)) = 1
  | Interval => still P <> [] /\ forall m, In m (modes F) -> exists C, owned m P = [C]
  | Containment => still P <> [] /\ exists m C C' l, In m (modes F) /\ owned m P = C :: C' :: l
  | Depends => exists q m w i, switches F (fun _ => q) (fun _ _ => 0) /\ In m (modes F) /\ admits (ties m) w /\
      In i (its_agents P) /\ member (ties m) w q i <> 0 end.
(** the common kernel theorem: every motion has a limit, which is at rest in every member; with constants of the family
    alone it nears it exponentially by the clock, however the signal switches *)
Definition kernel_claim (F : family) (P : part) : Prop := let c := frame F in becomes P <> Depends ->
  exists K r, 0 < r /\ forall X S, switches F X S -> exists y, (forall i, In i (its_agents P) -> xi P y i = 0 /\
    filterlim (fun t => X t i) (at_left (deadline c)) (locally (y i))) /\ forall t0 t M i, switches_from F X S t0 ->
    t0 <= t < deadline c -> In i (its_agents P) -> (forall j, In j (its_agents P) -> Rabs (xi P (X t0) j) <= M) ->
    Rabs (X t i - y i) <= K * exp (- (r * (s c t - s c t0))) * M.
(** the function is at most [a] *)
Definition below (b : lyapunov) (a : R) (x : nat -> R) : Prop := let z := xi (about b) x in match by_ b with
  | Form P => qbil P z z <= a | Squares p => qdot p (fun i => sq (x i)) <= a
  | Rows d => forall i, In i (its_agents (about b)) -> sq (z i) <= a * sq (Q2R (nth i d 0%Q)) end.
(** it decays along every motion, bounds what agents and means are moved and what is left to the states at rest *)
Definition bound_claim (F : family) (b : lyapunov) : Prop := let c := frame F in
  (forall X S t0 t a, switches_from F X S t0 -> t0 <= t < deadline c -> 0 <= a -> below b a (X t0) ->
     below b (exp (- (Q2R (decay b) * (s c t - s c t0))) * a) (X t)) /\
  (forall x a i, 0 <= a -> below b a x -> In i (its_agents (about b)) ->
     sq (xi (about b) x i) <= Q2R (nth i (offs b) 0%Q) * a /\
     forall m w, In m (modes F) -> admits (ties m) w -> sq (member (ties m) w x i) <= Q2R (nth i (inputs b) 0%Q) * a) /\
  (forall x a q, 0 <= a -> below b a x -> In q (means b) -> forall m w, In m (modes F) -> admits (ties m) w ->
     sq (qdot (fst q) (member (ties m) w x)) <= Q2R (snd q) * a).
(** from the initial state and the sliding variables of the file on: where agents end, the boxes, the whole input *)
Definition starts (F : family) X S := switches F X S /\ forall i, (i < order (frame F))%nat ->
  X 0 i = Q2R (nth i (start (frame F)) 0%Q) /\ S 0 i = Q2R (nth i (sliding (frame F)) 0%Q).
Definition ends_claim (F : family) : Prop := forall X S i m r, starts F X S -> nth i (ends F) None = Some (m, r) ->
  exists y, filterlim (fun t => X t i) (at_left (deadline (frame F))) (locally y) /\ Rabs (y - Q2R m) <= Q2R r.
Definition inputs_claim (F : family) : Prop := let c := frame F in
  let u m w X t i := gain (deadline c) (Q2R (rho1 c)) (k c) t * member (ties m) w (X t) i in
  (stays F = true -> forall X S t0, switches_from F X S t0 -> exists K, forall t i m w, t0 <= t < deadline c ->
     (i < order c)%nat -> In m (modes F) -> admits (ties m) w -> Rabs (u m w X t i) <= K) /\
  forall X S t i m w, starts F X S -> 0 <= t < deadline c -> (i < length (peaks F))%nat ->
    In m (modes F) -> admits (ties m) w -> Rabs (u m w X t i) + added c S t i <= Q2R (nth i (peaks F) 0%Q).
(** at the deadline agents are in their box, since [s] grows beyond all bounds *)
Definition box_claim (F : family) (b : box) : Prop := forall X S t a, let at_ l i := Q2R (nth i l 0%Q) in
  let at_most a x i := at_ (lower_end b) i - a * at_ (extent b) i <= x <= at_ (upper_end b) i + a * at_ (extent b) i in
  starts F X S -> 0 <= t < deadline (frame F) -> 0 <= a ->
  (forall i, In i (whom b) -> 0 < at_ (extent b) i -> at_most a (X 0 i) i) ->
  forall i, In i (whom b) -> at_most (exp (- (Q2R (speed b) / 2 * s (frame F) t)) * a) (X t i) i.
(** sliding variables do not hear the graph: what is said of them is what holds without edges, of [X = S] *)
Definition true_family (F : family) : Prop := (forall m, In m (modes F) -> mode_claim F m) /\
  (forall P, In P (parts F) -> part_claim F P /\ kernel_claim F P) /\
  (forall i, (i < order (frame F))%nat -> exists P, In P (parts F) /\ In i (its_agents P)) /\
  (edges (frame F) = [] /\ sliding_claim (frame F)) /\ (forall b, In b (bounds F) -> bound_claim F b) /\
  ends_claim F /\ inputs_claim F /\ (forall b, In b (boxes F) -> box_claim F b) /\ existence_claim F.
