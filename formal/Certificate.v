(** The certificate as a record, and what it claims: all that must be read to believe the theorem of [Main.v]. *)
Require Import ZArith QArith Qreals List Bool Reals. From Coquelicot Require Import Coquelicot.
Import ListNotations. Open Scope R_scope.

(** * Signed digraphs *)
(** Information flows from [src] to [tgt]: the target listens. *)
Record edge := Edge { tgt : nat; src : nat; wt : Q }. Definition mem i l := existsb (Nat.eqb i) l.
(** (L x)_i = sum over edges into i of |w| x_i - w x_src *)
Definition lap_edge i x e := if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * x i - Q2R (wt e) * x (src e) else 0.
Definition lap (es : list edge) (x : nat -> R) (i : nat) : R := fold_right (fun e a => lap_edge i x e + a) 0 es.
Inductive path (es : list edge) : nat -> nat -> Prop :=
| path_refl i : path es i i | path_step i e : In e es -> path es i (src e) -> path es i (tgt e).
(** connected if directions are ignored *)
Definition linked (es : list edge) := path (es ++ map (fun e => Edge (src e) (tgt e) (wt e)) es).
(** a strong component that listens to nobody else *)
Definition closed_component es (C : nat -> Prop) := (exists i, C i) /\
  (forall e, In e es -> C (tgt e) -> C (src e)) /\ (forall i j, C i -> C j -> path es i j).
Definition balanced es (C : list nat) (g : nat -> Z) : Prop := (forall i, In i C -> g i = 1 \/ g i = -1)%Z /\
  forall e, In e es -> In (src e) C -> In (tgt e) C -> (0 < wt e * inject_Z (g (tgt e) * g (src e)))%Q.

(** * Motions *)
Definition gain T rho1 k t := rho1 + k / (T - t). Definition clock T rho1 k t := rho1 * t + k * ln (T / (T - t)).
(** on [0, T): the state [X] and the sliding variables [S] are continuous, and [(X - S)' = - gain(t) L X] where [t > 0];
    what stands left of 0 does not matter *)
Definition motion (n : nat) (Lf : (nat -> R) -> nat -> R) (T rho1 k : R) (X S : R -> nat -> R) : Prop :=
  (forall t i, 0 < t < T -> (i < n)%nat -> is_derive (fun u => X u i - S u i) t (- (gain T rho1 k t * Lf (X t) i))) /\
  forall t i, t < T -> (i < n)%nat -> continuous (fun u => X (Rmax 0 u) i) t /\ continuous (fun u => S (Rmax 0 u) i) t.
(** from [t0] on all sliding variables are 0 *)
Definition quiet n T (S : R -> nat -> R) t0 := 0 <= t0 < T /\ forall t i, t0 <= t < T -> (i < n)%nat -> S t i = 0.

(** * The record *)
(** camps, or a negative cycle: edges (source, target) *)
Inductive balance := Gauge (g : list Z) | Cycle (c : list (nat * nat)).
(** a closed component; of a balanced one its weights in the final states, and its left null vector *)
Record comp := Comp { nodes : list nat; camps : balance; share : list Q; null : list Q }.
(** [V = E' P E], [E = L x]; or [V = eps' diag(p) eps], [eps = x - (p'Gx / p'1) G1]; or [V = E' diag(p) E] *)
Inductive lyap := InE (P : list (list Q)) | InEps (p : list Q) (g : list Z) | Weighted (p : list Q).
(** with the deviation of the norm and of each agent, and the constants of each agent's input *)
Record func := Func { ly : lyap; diagonal : bool; rate : Q; lowest : Q; highest : Q; overshoot : Q;
  deviation : option (Q * list Q); constants : option (list Q) }.
(** [S(x) > m |x|^2] for [x] on some nodes, [S(x) = sum_i gamma_i x_i^2] where [gamma_i] is given, else
    [2 sum_i w_i x_i (L x)_i]: the matrix whose least eigenvalue the paper's rate takes; weights of [upto] times a factor *)
Record margin := Margin { on : list nat; weights : list Q; gammas : list (option Q); least : Q; upto : list nat }.
(** the upper bound on the rate, and what proves it of a strong component: a form and where it is negative; its trace *)
Inductive reason := ByForm (H : list (list Q)) (y : list Q) | ByTrace.
Record upper := Upper { bound : Q; inside : list nat; because : reason }.
(** a weak component: [row] 1, 2, 3 if one closed component is all of it, if there is one, if there are several *)
Record piece := Piece { members : list nat; row : nat; some_balanced : bool; undirected : bool; cooperative : bool;
  whole : balance }.
(** what the input takes at most from the initial state, and what proves it: a Lyapunov function, and the instant up to
    which pieces of the time are added up; two forms, how they fall, and where the gain is compared with them; functions
    and instants, by agent and for the norm *)
Inductive effort := PathLength (most : Q) (way : nat * Q) | EnergyBy (most : Q) (way : nat * Q) | Energy (most : Q)
  (W0 W1 : list (list Q)) (m0 m1 p : Q) | Peak (each : list Q) (norm : Q) (ways : list (nat * Q)) (last : nat * Q).
Inductive protocol := Nominal (T : Q) | SlidingMode (T_r T_s mu1 mu2 mu3 delta : Q).
(** final states are middle and radius; of many nodes they are [enclosed], and no weights tell them; a leader group is its
    weights, 0 elsewhere, and its rate; [sliding_input] bounds what the sliding mode adds to the input, by agent;
    [reaching] are instants [z = ln(T_r/(T_r - t))]; efforts may be of a box of initial states, a center and radii;
    [degenerate], if stated, are the numbers, from 1 on, of the balanced closed components that end at 0 *)
Record cert := Cert { order : nat; edges : list edge; kind : protocol; rho1 : Q; rho2 : Q; kappa : Q;
  comps : list comp; pieces : list piece; all_balanced : balance; sign_symmetric : bool; funcs : list func;
  start : list Q; sliding : list Q; final : list (Q * Q); enclosed : bool; margins : list margin;
  leaders : list (list Q * Q); upper_bound : option upper; proved : option Q; best_diagonal : option Q;
  best_overshoot : option Q; bounded_input : bool; reaching : list (option Q); sliding_input : list Q;
  efforts : list effort; degenerate : option (list nat); start_box : option (list Q * list Q) }.

(** * Words *)
Definition shift (x : nat -> R) : nat -> R := fun i => x (S i).
Fixpoint qdot l (x : nat -> R) : R := match l with [] => 0 | a :: l' => Q2R a * x O + qdot l' (shift x) end.
Fixpoint qbil A (x y : nat -> R) : R := match A with [] => 0 | r :: A' => x O * qdot r y + qbil A' (shift x) y end.
Definition sq (x : R) := x * x. Definition sgn (g : list Z) (i : nat) : R := IZR (nth i g 0%Z).
Definition norm2 (n : nat) (x : nat -> R) : R := fold_right (fun i a => sq (x i) + a) 0 (seq 0 n).
Definition mean (p : list Q) (g : list Z) (x : nat -> R) : R := qdot p (fun i => sgn g i * x i) / qdot p (fun _ => 1).
(** the coordinates of a Lyapunov function, and its value *)
Definition coords (es : list edge) (m : lyap) (x : nat -> R) : nat -> R :=
  match m with InE _ | Weighted _ => lap es x | InEps p g => fun i => x i - mean p g x * sgn g i end.
Definition V (es : list edge) (m : lyap) (x : nat -> R) : R := let z := coords es m x in
  match m with InE P => qbil P z z | InEps p _ | Weighted p => qdot p (fun i => sq (z i)) end.
(** the final state [Q x]: sum over balanced closed components of the weight on agent [i] times the value *)
Definition is_balanced (C : comp) : bool := match camps C with Gauge _ => true | Cycle _ => false end.
Definition balanced_comps cs := map (fun C => (hd O (nodes C), (share C, null C))) (filter is_balanced cs).
Definition end_state (c : cert) (x : nat -> R) (i : nat) : R :=
  fold_right (fun b a => Q2R (nth i (fst (snd b)) 0%Q) * qdot (snd (snd b)) x + a) 0 (balanced_comps (comps c)).

Definition deadline c := match kind c with Nominal T => Q2R T | SlidingMode T_r T_s _ _ _ _ => Q2R T_r + Q2R T_s end.
Definition k c := Q2R (rho2 c) * Q2R (kappa c). Definition s c t := clock (deadline c) (Q2R (rho1 c)) (k c) t.
(** what draws a sliding variable to 0, besides [mu1] against the disturbance; and what stays of it *)
Definition pull c T_r mu2 mu3 t := Q2R mu2 + if Rlt_dec t (Q2R T_r) then Q2R mu3 * Q2R (kappa c) / (Q2R T_r - t) else 0.
Definition psi c T_r mu2 mu3 t := exp (- (Q2R mu2 * t)) * Rpower ((Q2R T_r - t) / Q2R T_r) (Q2R mu3 * Q2R (kappa c)).
(** Where a sliding variable is not 0, its right derivatives in size are within [delta] of [- mu1 - pull |S|]: so all
    solutions of Filippov do, whatever the disturbance within [delta]. Of the nominal protocol it is 0. *)
Definition slides (c : cert) (S : R -> nat -> R) : Prop := match kind c with Nominal _ => forall t i, S t i = 0
  | SlidingMode T_r _ mu1 mu2 mu3 delta => forall t i e, 0 <= t < deadline c -> (i < order c)%nat -> S t i <> 0 ->
      0 < e -> exists eta, 0 < eta /\ forall h, 0 < h < eta -> Rabs (Rabs (S (t + h) i) -
        (Rabs (S t i) - h * (Q2R mu1 + pull c T_r mu2 mu3 t * Rabs (S t i)))) <= h * (Q2R delta + e) end.
(** what the sliding mode adds to an input, in size *)
Definition added c (S : R -> nat -> R) t i := match kind c with Nominal _ => 0
  | SlidingMode T_r _ mu1 mu2 mu3 _ => Q2R mu1 + pull c T_r mu2 mu3 t * Rabs (S t i) end.
Definition moves c X S : Prop := motion (order c) (lap (edges c)) (deadline c) (Q2R (rho1 c)) (k c) X S /\ slides c S.
Definition moves_from c (X S : R -> nat -> R) (t0 : R) : Prop := moves c X S /\ quiet (order c) (deadline c) S t0.

(** * What it claims *)
(** from every state, and from all values of the sliding variables, a motion starts: nothing that is said of all is void *)
Definition existence (c : cert) : Prop := forall x0 s0, (forall T i, kind c = Nominal T -> s0 i = 0) ->
  exists X S, moves c X S /\ forall i, (i < order c)%nat -> X 0 i = x0 i /\ S 0 i = s0 i.
Definition balance_claim (es : list edge) (C : list nat) (b : balance) : Prop :=
  match b with Gauge g => balanced es C (fun i => nth i g 0%Z) | Cycle _ => forall g, ~ balanced es C g end.
(** closed components are these, and there are no others; camps and negative cycles are those of the edges *)
Definition structure (c : cert) : Prop := (forall C, In C (comps c) -> closed_component (edges c)
     (fun i => In i (nodes C))) /\ (forall D, closed_component (edges c) D -> (forall i, D i -> (i < order c)%nat) ->
     exists C, In C (comps c) /\ forall i, D i <-> In i (nodes C)) /\
  (forall C, In C (comps c) -> balance_claim (edges c) (nodes C) (camps C)).
(** balanced components end at [c_k] or [-c_k] by camps, unbalanced ones at 0; where final states are [enclosed] there are
    no weights, [end_state] is 0, and [limit_claim] says this instead *)
Definition behaviour (c : cert) : Prop := forall x C i, In C (comps c) -> In i (nodes C) ->
  end_state c x i = match camps C with Gauge g => sgn g i * qdot (null C) x | Cycle _ => 0 end.
(** the hypotheses of the theorem and of the corollaries, by weak component; nobody ends beyond the largest [|c_k|] of its
    own: all at 0 where no closed component is balanced *)
Definition own (c : cert) (P : piece) : list comp := filter (fun C => mem (hd O (nodes C)) (members P)) (comps c).
Definition piece_claim (c : cert) (P : piece) : Prop := (forall i j, In i (members P) ->
     (In j (members P) <-> linked (edges c) i j)) /\ own c P <> [] /\ row P = match own c P with
    | [C] => if forallb (fun i => mem i (nodes C)) (members P) then 1%nat else 2%nat | _ => 3%nat end /\
  some_balanced P = existsb is_balanced (own c P) /\ (undirected P = true <-> forall e, In e (edges c) ->
     In (tgt e) (members P) -> exists f, In f (edges c) /\ src f = tgt e /\ tgt f = src e /\ (wt f == wt e)%Q) /\
  (cooperative P = true <-> forall e, In e (edges c) -> In (tgt e) (members P) -> (0 < wt e)%Q) /\
  balance_claim (edges c) (members P) (whole P) /\ forall x M i, 0 <= M ->
    (forall C, In C (own c P) -> is_balanced C = true -> Rabs (qdot (null C) x) <= M) ->
    In i (members P) -> (i < order c)%nat -> Rabs (end_state c x i) <= M.
Definition claims (c : cert) : Prop := (forall P, In P (pieces c) -> piece_claim c P) /\
  (forall i, (i < order c)%nat -> exists P, In P (pieces c) /\ In i (members P)) /\
  balance_claim (edges c) (seq 0 (order c)) (all_balanced c) /\
  (sign_symmetric c = true <-> forall e f, In e (edges c) -> In f (edges c) -> src f = tgt e -> tgt f = src e ->
     (0 < wt e * wt f)%Q).
(** the intervals of the final state hold [Q (X(0) - sigma(0))]; the balanced components whose value is 0 are these *)
Definition begin (c : cert) (j : nat) : R := Q2R (nth j (start c) 0%Q) - Q2R (nth j (sliding c) 0%Q).
Definition within (c : cert) (y : nat -> R) : Prop := forall i, (i < length (final c))%nat -> (i < order c)%nat ->
  let p := nth i (final c) (0%Q, 0%Q) in Rabs (Q2R (fst p) - y i) <= Q2R (snd p).
Definition final_claim (c : cert) : Prop := enclosed c = false -> within c (end_state c (begin c)) /\
  forall l i, degenerate c = Some l -> (In i l <-> exists j C, i = S j /\ nth_error (comps c) j = Some C /\
    is_balanced C = true /\ qdot (null C) (begin c) = 0).
(** Proposition 1: whatever the disturbance, sliding variables shrink by [psi] and are 0 from [T_r] on; from the file's
    initial values on they are 0 from their reaching times on; what they add to the input at most *)
Definition sliding_claim (c : cert) : Prop := match kind c with Nominal _ => True
  | SlidingMode T_r _ _ mu2 mu3 _ => forall X S, moves c X S -> quiet (order c) (deadline c) S (Q2R T_r) /\
      forall t i, 0 <= t < Q2R T_r -> (i < order c)%nat -> Rabs (S t i) <= psi c T_r mu2 mu3 t * Rabs (S 0 i) /\
        (S 0 i = Q2R (nth i (sliding c) 0%Q) -> ((i < length (sliding_input c))%nat ->
           added c S t i <= Q2R (nth i (sliding_input c) 0%Q)) /\
         forall z, nth i (reaching c) None = Some z -> Q2R T_r * (1 - exp (- Q2R z)) <= t -> S t i = 0) end.
(** what one Lyapunov function proves, along every motion *)
Definition decay_claim c f : Prop := forall X S t0 t, moves_from c X S t0 -> let q := exp (- (Q2R (rate f) *
  (s c t - s c t0))) in let V := V (edges c) (ly f) in let N x := norm2 (order c) (coords (edges c) (ly f) x) in
  let off i := X t i - end_state c (fun j => X 0 j - S 0 j) i in t0 <= t < deadline c -> V (X t) <= q * V (X t0) /\
  N (X t) <= Q2R (overshoot f) * (q * N (X t0)) /\ (forall a cs, deviation f = Some (a, cs) -> norm2 (order c) off <=
  Q2R a * (q * V (X t0)) /\ forall i, (i < order c)%nat -> sq (off i) <= Q2R (nth i cs 0%Q) * (q * V (X t0))) /\
  forall cs i, constants f = Some cs -> (i < order c)%nat -> sq (lap (edges c) (X t) i) <= Q2R (nth i cs 0%Q) * V (X t).
(** and of which matrices: the ends of the spectrum of [P], on the nodes that listen to somebody *)
Definition function_claim (c : cert) (f : func) : Prop := decay_claim c f /\ 0 < Q2R (lowest f) /\ forall P z,
  ly f = InE P -> (forall i, ~ In i (map tgt (edges c)) -> z i = 0) -> let N := norm2 (order c) z in
  Q2R (lowest f) * N <= qbil P z z <= Q2R (highest f) * N.
(** the inequalities of the paper's own function *)
Definition margin_form (es : list edge) (n : nat) (m : margin) (r : R) (x : nat -> R) : R :=
  fold_right (fun i a => match nth i (gammas m) None with Some g => Q2R g * sq (x i) | None =>
    2 * (Q2R (nth i (weights m) 0%Q) * if mem i (upto m) then r else 1) * (x i * lap es x i) end + a) 0 (seq 0 n).
Definition margin_claim (c : cert) (m : margin) : Prop := forall x j, (forall i, (i < order c)%nat -> ~ In i (on m) ->
  x i = 0) -> (j < order c)%nat -> x j <> 0 -> let S r := margin_form (edges c) (order c) m r x in
  Q2R (least m) * norm2 (order c) x < S 1 /\ (Q2R (least m) = 0 -> forall r, 0 < r <= 1 -> 0 < S r).
Definition leader_claim c l : Prop := forall X S t0 t, moves_from c X S t0 -> t0 <= t < deadline c -> let W x :=
  qdot (fst l) (fun i => sq (lap (edges c) x i)) in W (X t) <= exp (- (Q2R (snd l) * (s c t - s c t0))) * W (X t0).
(** where nothing moves: components by camps, and nobody beyond the largest value of a balanced one of its own *)
Definition at_rest (c : cert) (y : nat -> R) : Prop := (forall i, (i < order c)%nat -> lap (edges c) y i = 0) /\
  (forall C i, In C (comps c) -> In i (nodes C) -> let h := hd O (nodes C) in
    match camps C with Gauge g => y i = sgn g i * (sgn g h * y h) | Cycle _ => y i = 0 end) /\
  forall P M i, In P (pieces c) -> In i (members P) -> (i < order c)%nat -> 0 <= M ->
    (forall C, In C (own c P) -> is_balanced C = true -> Rabs (y (hd O (nodes C))) <= M) -> Rabs (y i) <= M.
(** the end is reached at the deadline *)
Definition limit_claim (c : cert) : Prop := forall X S, moves c X S -> exists y, (forall i, (i < order c)%nat ->
  filterlim (fun t => X t i) (at_left (deadline c)) (locally (y i))) /\ let x0 j := X 0 j - S 0 j in if enclosed c then
  at_rest c y /\ ((forall j, (j < order c)%nat -> x0 j = begin c j) -> within c y) else y = end_state c x0.
(** the nominal part of the input; it stays bounded *)
Definition input c (X : R -> nat -> R) t i : R := - (gain (deadline c) (Q2R (rho1 c)) (k c) t * lap (edges c) (X t) i).
Definition input_claim (c : cert) : Prop := bounded_input c = true -> forall X S t0, moves_from c X S t0 ->
  exists K, forall t i, t0 <= t < deadline c -> (i < order c)%nat -> Rabs (input c X t i) <= K.
(** the length of its path, its energy, and how large the whole input gets, from the initial values of the file *)
Definition begins c i x := match start_box c with None => x = Q2R (nth i (start c) 0%Q)
  | Some (a, r) => Rabs (x - Q2R (nth i a 0%Q)) <= Q2R (nth i r 0%Q) end.
Definition effort_claim (c : cert) (e : effort) : Prop := forall X S t, moves c X S -> 0 <= t < deadline c ->
  (forall i, (i < order c)%nat -> begins c i (X 0 i) /\ S 0 i = Q2R (nth i (sliding c) 0%Q)) ->
  let I f q := ex_RInt f 0 t /\ RInt f 0 t <= Q2R q in let N u := norm2 (order c) (input c X u) in
  let whole i := Rabs (input c X t i) + added c S t i in match e with PathLength q _ => I (fun u => sqrt (N u)) q
  | EnergyBy q _ | Energy q _ _ _ _ _ => I N q | Peak qs q _ _ => sqrt (norm2 (order c) whole) <= Q2R q /\
    forall i, (i < order c)%nat -> whole i <= Q2R (nth i qs 0%Q) end.
(** the rates that are stated are the largest ones *)
Definition largest (l : list Q) (r : option Q) : Prop := match r with None => forall a, In a l -> (a <= 0)%Q
  | Some q => (0 < q)%Q /\ (exists a, In a l /\ (a == q)%Q) /\ forall a, In a l -> (a <= q)%Q end.
Definition rates_claim (c : cert) : Prop := largest (map rate (funcs c)) (proved c) /\
  largest (map rate (filter diagonal (funcs c))) (best_diagonal c) /\ forall q o, proved c = Some q ->
    best_overshoot c = Some o -> (exists f, In f (funcs c) /\ (rate f == q)%Q /\ (overshoot f == o)%Q) /\
    forall f, In f (funcs c) -> (rate f == q)%Q -> (o <= overshoot f)%Q.
(** no quadratic form of the state that vanishes only where nothing moves decays faster than the upper bound *)
Definition upper_claim (c : cert) (u : upper) : Prop := forall (F : (nat -> R) -> (nat -> R) -> R) (b : R),
  (forall x y, F x y = F y x) -> (forall a x y z, F (fun i => a * x i + y i) z = a * F x z + F y z) ->
  (forall x, 0 <= F x x) -> (forall x, F x x = 0 -> forall i, (i < order c)%nat -> lap (edges c) x i = 0) ->
  (forall x, b * F x x <= 2 * F x (lap (edges c) x)) -> b <= Q2R (bound u).

Definition true_certificate (c : cert) : Prop :=
  structure c /\ behaviour c /\ claims c /\ final_claim c /\ (forall f, In f (funcs c) -> function_claim c f) /\
  limit_claim c /\ input_claim c /\ rates_claim c /\ sliding_claim c /\ existence c /\
  (forall m, In m (margins c) -> margin_claim c m) /\ (forall l, In l (leaders c) -> leader_claim c l) /\
  (forall u, upper_bound c = Some u -> upper_claim c u) /\ forall e, In e (efforts c) -> effort_claim c e.
