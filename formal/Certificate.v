(** The certificate as a record, and what it claims. To believe the theorem of [Main.v] one must read this file,
    [edge], [lap], [path], [closed], [strong], [closed_component], [balanced] of [Graph.v], and [gain], [clock],
    [motion], [quiet] of [Flow.v]; nothing else. *)
Require Import ZArith QArith Qreals List Bool Reals Lra.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Graph Flow.
Open Scope R_scope.

(** * The record *)
Inductive witness :=
| Bal (g : list Z) (w v : list Q)      (* camps, weights of this component in the final states, left null vector *)
| Unbal (c : list (nat * nat)).        (* negative cycle: edges (source, target) *)
Record comp := Comp { nodes : list nat; wit : witness }.
Inductive lyap :=
| InE (P : list (list Q))              (* V = E' P E, E = L x *)
| InEps (p : list Q) (g : list Z).     (* V = eps' diag(p) eps, eps = x - (p'Gx / p'1) G1 *)
Record func := Func {
  ly : lyap; diagonal : bool; rate : Q; lowest : Q; highest : Q; overshoot : Q;
  deviation : option (Q * list Q);     (* of the norm, of each agent *)
  constants : option (list Q) }.       (* of each agent's input *)
(** [S(x) > m |x|^2] for [x] on some nodes, [S(x) = sum_i gamma_i x_i^2] where [gamma_i] is given, else
    [2 sum_i w_i x_i (L x)_i]: the matrix whose least eigenvalue the paper's rate takes; the weights of [upto] times a factor *)
Record margin := Margin { on : list nat; weights : list Q; gammas : list (option Q); least : Q; upto : list nat }.
(** the upper bound on the rate, and what proves it of a strong component: a form, and where that is negative; its trace *)
Inductive reason := ByForm (H : list (list Q)) (y : list Q) | ByTrace.
Record upper := Upper { bound : Q; inside : list nat; because : reason }.
Inductive balance := Gauge (g : list Z) | Cycle (c : list (nat * nat)).
(** a weak component: [row] 1, 2, 3 if one closed component is all of it, if there is one, if there are several *)
Record piece := Piece { members : list nat; row : nat; some_balanced : bool; undirected : bool; cooperative : bool;
  whole : balance }.
Inductive protocol :=
| Nominal (T : Q)
| SlidingMode (T_r T_s mu1 mu2 mu3 delta : Q).
Record cert := Cert {
  order : nat; edges : list edge; kind : protocol; rho1 : Q; rho2 : Q; kappa : Q;
  comps : list comp; pieces : list piece; all_balanced : balance; sign_symmetric : bool; funcs : list func; start : list Q; sliding : list Q; final : list (Q * Q); (* middle, radius *)
  margins : list margin;
  upper_bound : option upper;
  leaders : list (list Q * Q);         (* weights of a leader group, 0 elsewhere; its rate *)
  proved : option Q; best_diagonal : option Q; best_overshoot : option Q; bounded_input : bool }.

(** * Words *)
Fixpoint qdot (l : list Q) (x : nat -> R) : R :=
  match l with [] => 0 | a :: l' => Q2R a * x 0%nat + qdot l' (shift x) end.
Fixpoint qbil (A : list (list Q)) (x y : nat -> R) : R :=
  match A with [] => 0 | r :: A' => x 0%nat * qdot r y + qbil A' (shift x) y end.
Definition sq (x : R) := x * x.
Definition norm2 (n : nat) (x : nat -> R) : R := fold_right (fun i a => sq (x i) + a) 0 (seq 0 n).
Definition sgn (g : list Z) (i : nat) : R := IZR (nth i g 0%Z).
Definition signs (g : list Z) : nat -> Z := fun i => nth i g 0%Z.
Definition mean (p : list Q) (g : list Z) (x : nat -> R) : R := qdot p (fun i => sgn g i * x i) / qdot p (fun _ => 1).
(** the coordinates of a Lyapunov function, and its value *)
Definition coords (es : list edge) (m : lyap) (x : nat -> R) : nat -> R :=
  match m with InE _ => lap es x | InEps p g => fun i => x i - mean p g x * sgn g i end.
Definition V (es : list edge) (m : lyap) (x : nat -> R) : R :=
  match m with
  | InE P => qbil P (coords es m x) (coords es m x)
  | InEps p g => qdot p (fun i => sq (coords es m x i))
  end.
(** the final state [Q x]: sum over balanced closed components of the weight on agent [i] times the value *)
Definition balanced_comps (cs : list comp) : list (nat * (list Q * list Q)) :=
  flat_map (fun C => match wit C with Bal _ w v => [(hd O (nodes C), (w, v))] | Unbal _ => [] end) cs.
Definition end_state (c : cert) (x : nat -> R) (i : nat) : R :=
  fold_right (fun b a => Q2R (nth i (fst (snd b)) 0%Q) * qdot (snd (snd b)) x + a) 0 (balanced_comps (comps c)).

Definition deadline (c : cert) : R :=
  match kind c with Nominal T => Q2R T | SlidingMode T_r T_s _ _ _ _ => Q2R T_r + Q2R T_s end.
Definition k (c : cert) : R := Q2R (rho2 c) * Q2R (kappa c).
Definition s (c : cert) (t : R) : R := clock (deadline c) (Q2R (rho1 c)) (k c) t.
(** [X] moves by the protocol, with sliding variables [S] that are 0 from [t0] on; of the nominal protocol always. *)
Definition moves (c : cert) (X S : R -> nat -> R) (t0 : R) : Prop :=
  motion (order c) (lap (edges c)) (deadline c) (Q2R (rho1 c)) (k c) X S /\ quiet (order c) (deadline c) S t0 /\
  match kind c with Nominal _ => forall t i, S t i = 0 | SlidingMode _ _ _ _ _ _ => True end.

(** * What it claims *)
(** closed components are these, and there are no others; camps and negative cycles are those of the edges *)
Definition structure (c : cert) : Prop :=
  (forall C, In C (comps c) -> closed_component (edges c) (fun i => In i (nodes C))) /\
  (forall D, closed_component (edges c) D -> (forall i, D i -> (i < order c)%nat) ->
     exists C, In C (comps c) /\ forall i, D i <-> In i (nodes C)) /\
  (forall C, In C (comps c) -> match wit C with
     | Bal g _ _ => balanced (edges c) (nodes C) (signs g)
     | Unbal _ => forall g, ~ balanced (edges c) (nodes C) g end).
(** balanced components end at [c_k] or [-c_k] by camps, unbalanced ones at 0 *)
Definition behaviour (c : cert) : Prop := forall x,
  (forall C g w v, In C (comps c) -> wit C = Bal g w v ->
     forall i, In i (nodes C) -> end_state c x i = sgn g i * qdot v x) /\
  (forall C cy, In C (comps c) -> wit C = Unbal cy -> forall i, In i (nodes C) -> end_state c x i = 0).
(** the hypotheses of the theorem and of the corollaries, by weak component; nobody ends beyond the largest [|c_k|] of its
    own: all at 0 where no closed component is balanced *)
Definition balance_claim (es : list edge) (C : list nat) (b : balance) : Prop :=
  match b with Gauge g => balanced es C (signs g) | Cycle _ => forall g, ~ balanced es C g end.
Definition own (c : cert) (P : piece) : list comp := filter (fun C => mem (hd O (nodes C)) (members P)) (comps c).
Definition is_balanced (C : comp) : bool := match wit C with Bal _ _ _ => true | Unbal _ => false end.
Definition piece_claim (c : cert) (P : piece) : Prop :=
  (exists i, In i (members P)) /\ (forall i j, In i (members P) -> (In j (members P) <-> linked (edges c) i j)) /\
  match row P, own c P with
  | 1%nat, [C] => forall i, In i (members P) -> In i (nodes C)
  | 2%nat, [C] => exists i, In i (members P) /\ ~ In i (nodes C)
  | 3%nat, _ :: _ :: _ => True
  | _, _ => False end /\
  some_balanced P = existsb is_balanced (own c P) /\
  (undirected P = true <-> forall e, In e (edges c) -> In (tgt e) (members P) ->
     exists f, In f (edges c) /\ src f = tgt e /\ tgt f = src e /\ (wt f == wt e)%Q) /\
  (cooperative P = true <-> forall e, In e (edges c) -> In (tgt e) (members P) -> (0 < wt e)%Q) /\
  balance_claim (edges c) (members P) (whole P) /\
  forall x M, 0 <= M -> (forall C g w v, In C (own c P) -> wit C = Bal g w v -> Rabs (qdot v x) <= M) ->
    forall i, In i (members P) -> (i < order c)%nat -> Rabs (end_state c x i) <= M.
Definition claims (c : cert) : Prop := (forall P, In P (pieces c) -> piece_claim c P) /\
  (forall i, (i < order c)%nat -> exists P, In P (pieces c) /\ In i (members P)) /\
  balance_claim (edges c) (seq 0 (order c)) (all_balanced c) /\
  (sign_symmetric c = true <-> forall e f, In e (edges c) -> In f (edges c) -> src f = tgt e -> tgt f = src e ->
     (0 < wt e * wt f)%Q).
(** the intervals of the final state hold [Q (X(0) - sigma(0))] *)
Definition begin (c : cert) (j : nat) : R := Q2R (nth j (start c) 0%Q) - Q2R (nth j (sliding c) 0%Q).
Definition final_claim (c : cert) : Prop := forall i, (i < length (final c))%nat -> (i < order c)%nat ->
  Rabs (Q2R (fst (nth i (final c) (0%Q, 0%Q))) - end_state c (begin c) i) <= Q2R (snd (nth i (final c) (0%Q, 0%Q))).
(** what one Lyapunov function proves, along every motion *)
Definition function_claim (c : cert) (f : func) : Prop := forall X S t0, moves c X S t0 ->
  forall t, t0 <= t < deadline c ->
  let q := exp (- (Q2R (rate f) * (s c t - s c t0))) in
  let off i := X t i - end_state c (fun j => X 0 j - S 0 j) i in
  V (edges c) (ly f) (X t) <= q * V (edges c) (ly f) (X t0) /\
  norm2 (order c) (coords (edges c) (ly f) (X t))
    <= Q2R (overshoot f) * (q * norm2 (order c) (coords (edges c) (ly f) (X t0))) /\
  match deviation f with
  | Some (a, cs) => norm2 (order c) off <= Q2R a * (q * V (edges c) (ly f) (X t0)) /\
      forall i, (i < order c)%nat -> sq (off i) <= Q2R (nth i cs 0%Q) * (q * V (edges c) (ly f) (X t0))
  | None => True end /\
  match constants f with
  | Some cs => forall i, (i < order c)%nat ->
      sq (lap (edges c) (X t) i) <= Q2R (nth i cs 0%Q) * V (edges c) (ly f) (X t)
  | None => True end.
(** the inequalities of the paper's own function *)
Definition margin_form (es : list edge) (n : nat) (m : margin) (r : R) (x : nat -> R) : R :=
  fold_right (fun i a => match nth i (gammas m) None with
    | Some g => Q2R g * sq (x i)
    | None => 2 * (Q2R (nth i (weights m) 0%Q) * if mem i (upto m) then r else 1) * (x i * lap es x i) end + a) 0 (seq 0 n).
Definition margin_claim (c : cert) (m : margin) : Prop := forall x, (forall i, (i < order c)%nat -> ~ In i (on m) -> x i = 0) ->
  let S r := margin_form (edges c) (order c) m r x in
  Q2R (least m) * norm2 (order c) x <= S 1 /\
  (Q2R (least m) * norm2 (order c) x = S 1 -> forall i, (i < order c)%nat -> x i = 0) /\
  (Q2R (least m) = 0 -> forall r, 0 < r <= 1 -> 0 <= S r /\ (S r = 0 -> forall i, (i < order c)%nat -> x i = 0)).
Definition leader_claim (c : cert) (l : list Q * Q) : Prop := forall X S t0, moves c X S t0 ->
  forall t, t0 <= t < deadline c ->
  let W x := qdot (fst l) (fun i => sq (lap (edges c) x i)) in
  W (X t) <= exp (- (Q2R (snd l) * (s c t - s c t0))) * W (X t0).
(** the end is reached at the deadline *)
Definition limit_claim (c : cert) : Prop := forall X S t0, moves c X S t0 -> forall i, (i < order c)%nat ->
  filterlim (fun t => X t i) (at_left (deadline c)) (locally (end_state c (fun j => X 0 j - S 0 j) i)).
(** the input stays bounded *)
Definition input_claim (c : cert) : Prop := bounded_input c = true -> forall X S t0, moves c X S t0 ->
  exists K, forall t i, t0 <= t < deadline c -> (i < order c)%nat ->
    Rabs (gain (deadline c) (Q2R (rho1 c)) (k c) t * lap (edges c) (X t) i) <= K.
(** the rates that are stated are the largest ones *)
Definition largest (l : list Q) (r : option Q) : Prop :=
  match r with
  | Some q => (0 < q)%Q /\ (exists a, In a l /\ (a == q)%Q) /\ forall a, In a l -> (a <= q)%Q
  | None => forall a, In a l -> (a <= 0)%Q end.
Definition rates_claim (c : cert) : Prop :=
  largest (map rate (funcs c)) (proved c) /\
  largest (map rate (filter diagonal (funcs c))) (best_diagonal c) /\
  forall q o, proved c = Some q -> best_overshoot c = Some o ->
    (exists f, In f (funcs c) /\ (rate f == q)%Q /\ (overshoot f == o)%Q) /\
    forall f, In f (funcs c) -> (rate f == q)%Q -> (o <= overshoot f)%Q.

(** no quadratic form of the state that vanishes only where nothing moves decays faster than the upper bound *)
Definition upper_claim (c : cert) (u : upper) : Prop := forall (F : (nat -> R) -> (nat -> R) -> R) (b : R),
  (forall x y, F x y = F y x) -> (forall x y z, F (fun i => x i + y i) z = F x z + F y z) ->
  (forall a x z, F (fun i => a * x i) z = a * F x z) ->
  (forall x, 0 <= F x x) -> (forall x, F x x = 0 -> forall i, (i < order c)%nat -> lap (edges c) x i = 0) ->
  (forall x, b * F x x <= 2 * F x (lap (edges c) x)) -> b <= Q2R (bound u).

Definition true_certificate (c : cert) : Prop :=
  structure c /\ behaviour c /\ claims c /\ final_claim c /\ (forall f, In f (funcs c) -> function_claim c f) /\
  limit_claim c /\ input_claim c /\ rates_claim c /\
  (forall m, In m (margins c) -> margin_claim c m) /\ (forall l, In l (leaders c) -> leader_claim c l) /\
  (forall u, upper_bound c = Some u -> upper_claim c u).
