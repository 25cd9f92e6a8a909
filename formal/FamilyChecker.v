(** The executable check of a family: quadratic functions of what is left to the states at rest, for all members. *)
Require Import ZArith QArith Qabs List Bool.
Import ListNotations.
Require Import Vec Definite Graph Certificate Checker Table Wide FamilyCertificate.
Open Scope Z_scope.

(** * One weight: [|w|] in [[lo, hi]] times [f h'] *)
Definition positive (e : tie) : bool := Qle_bool 0 (bottom e).
Definition sign_of (e : tie) : Z := if positive e then 1 else -1.
Definition lo (e : tie) : Q := if positive e then bottom e else (- top e)%Q.
Definition hi (e : tie) : Q := if positive e then top e else (- bottom e)%Q.
Definition middle (e : tie) : Q := ((lo e + hi e) * (1 # 2))%Q.
Definition radius (e : tie) : Q := ((hi e - lo e) * (1 # 2))%Q.
Definition hvec (e : tie) : vec := vadd (unit (head e) 1) (unit (tail e) (- sign_of e)).
Definition fvec (e : tie) : vec := if mutual e then hvec e else unit (head e) 1.
Definition check_tie (n : nat) (e : tie) : bool :=
  (head e <? n)%nat && (tail e <? n)%nat && Qle_bool 0 (lo e) && Qle_bool (lo e) (hi e).

(** * The decrease of a form for all weights of a mode *)
Definition grad (F : mat) (f : vec) : vec := vadd (lincomb f F) (map (fun r => zdot r f) F).
(** with a multiplier, or at the smallest size: which does if no other is possible, or if what comes on top is a square *)
Definition check_term (n : nat) (F : mat) (t : tie * option Q) : bool :=
  let e := fst t in let G := grad F (fvec e) in (length G <=? n)%nat && match snd t with
  | Some tau => notneg tau
  | None => Qeq_bool (lo e) (hi e) || (let c := nth (head e) G 0 in (0 <=? c) && zero_vec (vadd G (scale (- c) (hvec e)))) end.
Fixpoint build (dq : Z) (F : mat) (k : nat) (l : list (tie * option Q)) : mat :=
  match l with
  | [] => []
  | (e, None) :: l' => madd (outer (hvec e) (scale (scaled dq (lo e)) (grad F (fvec e)))) (build dq F k l')
  | (e, Some tau) :: l' => let G := grad F (fvec e) in let t := scaled dq tau in
      madd (madd (outer (hvec e) (vadd (scale (scaled dq (middle e)) G) (scale (- t) (hvec e))))
        (outer (unit k 1) (vadd (scale (scaled dq (radius e)) G) (unit k t)))) (build dq F (S k) l') end.
Definition terms (l : list (tie * option Q)) : list Q :=
  flat_map (fun t => match snd t with None => [lo (fst t)] | Some tau => [middle (fst t); radius (fst t); tau] end) l.
Definition taus (l : list (tie * option Q)) : nat := length (filter (fun t => match snd t with Some _ => true | None => false end) l).
Definition check_decay (n : nat) (sw : Z) (fw : kernel) (F : mat) (b : Q) (l : list (tie * option Q)) : bool :=
  let dq := common (b :: terms l) in
  good dq (b :: terms l) && forallb (check_term n F) l &&
  nonneg (n + taus l) sw fw (madd (build dq F n l) (mscale (- scaled dq b) F)).

(** * Forms of what is left to the states at rest *)
Definition crow (sw : Z) (B : list (nat * list Q)) (i : nat) : vec :=
  vadd (unit i sw) (fold_right (fun b a => vadd (unit (fst b) (- scaled sw (nth i (snd b) 0%Q))) a) [] B).
Record quotient := Quotient { qn : nat; qsw : Z; qfw : kernel; qF : mat; qm : Z }.
Definition common_of (B : list (nat * list Q)) : Z := common (concat (map snd B)).
Definition kernel_of (n : nat) (P : part) : kernel := let sw := common_of (still P) in
  map (fun b => (fst b, map (scaled sw) (snd b))) (still P) ++
  map (fun i => (i, unit i sw)) (filter (fun i => negb (mem i (its_agents P))) (seq 0 n)).
Definition quotient_of (n : nat) (p : part) (P : list (list Q)) : quotient :=
  let sw := common_of (still p) in let d := common (concat P) in
  let C := map (crow sw (still p)) (seq 0 n) in
  Quotient n sw (kernel_of n p) (tmul C (mmul (map (map (scaled d)) P) C)) (d * (sw * sw)).
Definition check_quotient (p : part) (P : list (list Q)) (q : quotient) : bool :=
  let d := common (concat P) in
  forallb (good d) P && (0 <? d) && (0 <? qsw q) && forallb (fun b => good (qsw q) (snd b)) (still p) &&
  fits (qn q) (map (map (scaled d)) P) && fits (qn q) (qF q).
(** how large linear functions are: [(d'x)^2 <= a^2 V] *)
Definition check_size (q : quotient) (r : factor) (d : vec) (scale_ : Z) (a : Q) : bool :=
  notneg a && bounded_mod (qfw q) r d (Qnum a * Qnum a * (scale_ * scale_)) (Zpos (Qden a) * Zpos (Qden a) * qm q).
Definition near (P : part) (e : tie) : bool := mem (head e) (its_agents P) || mem (tail e) (its_agents P).
Definition weighed (u : vec) (e : tie) : Z := zdot u (fvec e).
(** the row [u'L] at the middle, times [dq]; how far it is from that *)
Definition mid_row (dq : Z) (l : list tie) (u : vec) : vec :=
  fold_right (fun e a => vadd (scale (scaled dq (middle e) * weighed u e) (hvec e)) a) [] l.
Definition spread (l : list (tie * Q)) (u : vec) : Q :=
  fold_right (fun t a => (radius (fst t) * inject_Z (Z.abs (weighed u (fst t))) * snd t + a)%Q) 0%Q l.
(** roots: of each weight; of each agent, then of each mean *)
Definition check_functional (q : quotient) (r : factor) (dq : Z) (l : list tie) (t : list ((tie * Q) * bool)) (u : vec) (a c : Q) : bool :=
  forallb (fun tb => (weighed u (fst (fst tb)) =? 0) || snd tb) t && check_size q r (mid_row dq l u) dq a &&
  (let s := (a + spread (map fst t) u)%Q in Qle_bool (s * s) c).
Definition check_inputs (q : quotient) (r : factor) (b : lyapunov) (l : list tie) (roots : list Q * list Q) : bool :=
  let dq := common (map middle l) in let P := about b in
  let t := map (fun t => (t, Qeq_bool (radius (fst t)) 0 && notneg (snd t) || near P (fst t) && check_size q r (hvec (fst t)) 1 (snd t)))
    (combine l (fst roots)) in
  good dq (map middle l) && (length l =? length (fst roots))%nat &&
  forallb (fun i => check_functional q r dq l t (unit i 1) (nth i (snd roots) 0%Q) (nth i (inputs b) 0%Q)) (its_agents P) &&
  forallb (fun km => let m := snd km in let d := common (fst m) in good d (fst m) &&
    check_functional q r dq l t (map (scaled d) (fst m)) (nth (fst km) (snd roots) 0%Q) (snd m * inject_Z (d * d)))
    (combine (seq (qn q) (length (means b))) (means b)).
Definition check_offs (q : quotient) (r : factor) (P : part) (cs : list Q) : bool :=
  forallb (fun i => let c := nth i cs 0%Q in notneg c &&
    bounded_mod (qfw q) r (crow (qsw q) (still P) i) (Qnum c * (qsw q * qsw q)) (Zpos (Qden c) * qm q)) (its_agents P).

(** * What is at rest in all members *)
Definition rest_vec (dl : Z) (l : list tie) (v : vec) : vec :=
  fold_right (fun e a => vadd (scale (scaled dl (lo e) * zdot (hvec e) v) (fvec e)) a) [] l.
Definition check_at_rest (sw : Z) (l : list tie) (v : list Q) : bool :=
  let vz := map (scaled sw) v in let dl := common (map lo l) in
  good sw v && good dl (map lo l) &&
  forallb (fun e => Qeq_bool (lo e) (hi e) || (zdot (hvec e) vz =? 0)) l && zero_vec (rest_vec dl l vz).

(** * Hints, which are not believed *)
(** the rate of each mode, with its multipliers; roots *)
Record hint := Hint { multipliers : list (Q * list (option Q)); roots : list (list Q * list Q) }.
Definition check_family_form (F : family) (b : lyapunov) (h : hint) (P : list (list Q)) : bool :=
  let p := about b in let q := quotient_of (order (frame F)) p P in
  let n := order (frame F) in
  check_quotient p P q && (length (multipliers h) =? length (modes F))%nat && (length (roots h) =? length (modes F))%nat &&
  forallb (fun mt => let l := ties (fst mt) in let rate := fst (snd mt) in
    (length l =? length (snd (snd mt)))%nat && Qle_bool (decay b) rate &&
    check_decay n (qsw q) (qfw q) (qF q) rate (combine l (snd (snd mt)))) (combine (modes F) (multipliers h)) &&
  match factor_mod n (qsw q) (qfw q) (qF q) with
  | Some r => check_offs q r p (offs b) &&
      forallb (fun mr => check_inputs q r b (ties (fst mr)) (snd mr)) (combine (modes F) (roots h))
  | None => false end.
(** * Rows *)
Definition unmoved (F : family) (i : nat) : bool :=
  forallb (fun m => forallb (fun e => negb (head e =? i)%nat && negb (mutual e && (tail e =? i)%nat)) (ties m)) (modes F).
(** the least that the weights of a mode draw agent [i], times [d]; the most that they move it *)
Definition entry (d : list Q) (i : nat) : Q := nth i d 0%Q.
Definition worst (e : tie) (a : Q) : Q := ((if Qle_bool 0 a then lo e else hi e) * a)%Q.
Definition row_sum (l : list tie) (g : tie -> nat -> nat -> Q) (i : nat) : Q :=
  fold_right (fun e a => Qred ((if (head e =? i)%nat then g e (head e) (tail e) else 0) +
    (if mutual e && (tail e =? i)%nat then g e (tail e) (head e) else 0) + a))%Q 0%Q l.
Definition drawn (d : list Q) (e : tie) (t s : nat) : Q := worst e (entry d t - entry d s).
Definition row_moved (d : list Q) (e : tie) (t s : nat) : Q := (hi e * (entry d t + entry d s))%Q.
Definition check_rows_of (F : family) (b : lyapunov) (d : list Q) : bool :=
  let P := about b in let sw := common_of (still P) in let pivots := map fst (still P) in
  (match means b with [] => true | _ => false end) && (0 <? sw) && forallb (fun v => good sw (snd v)) (still P) &&
  forallb (fun m => forallb (fun e => Bool.eqb (mem (head e) (its_agents P)) (mem (tail e) (its_agents P))) (ties m) &&
    forallb (fun v => check_at_rest sw (ties m) (snd v)) (still P)) (modes F) &&
  forallb (fun i => if mem i pivots then unmoved F i && zero_vec (crow sw (still P) i) && Qeq_bool (entry d i) 0
    else pos (entry d i) && forallb (fun m => Qle_bool (decay b * entry d i) (2 * row_sum (ties m) (drawn d) i)) (modes F)) (its_agents P) &&
  forallb (fun i => Qle_bool (entry d i * entry d i) (nth i (offs b) 0%Q) && forallb (fun m =>
    let u := row_sum (ties m) (row_moved d) i in Qle_bool (u * u) (nth i (inputs b) 0%Q)) (modes F)) (its_agents P).
Definition check_bound (F : family) (b : lyapunov) (h : hint) : bool :=
  forallb (fun i => (i <? order (frame F))%nat) (its_agents (about b)) &&
  forallb (fun v => mem (fst v) (its_agents (about b))) (still (about b)) &&
  match by_ b with Form P => check_family_form F b h P | Rows d => check_rows_of F b d | Squares _ => false end.

(** * Modes and parts *)
Definition same_edge (e f : edge) : bool := (tgt e =? tgt f)%nat && (src e =? src f)%nat && (Qnum (wt e) =? Qnum (wt f)) && (Zpos (Qden (wt e)) =? Zpos (Qden (wt f))).
Fixpoint same_edges (l m : list edge) : bool :=
  match l, m with [], [] => true | e :: l', f :: m' => same_edge e f && same_edges l' m' | _, _ => false end.
Definition check_mode (F : family) (m : mode) : bool :=
  let c := mandatory m in
  forallb (check_tie (order (frame F))) (ties m) && same_edges (edges c) (smallest (ties m)) &&
  (order c =? order (frame F))%nat && wide_structure c && wide_claims c.
Definition every_edge (F : family) : list edge := flat_map (fun e => there e 1%Q) (flat_map ties (modes F)).
Definition check_part (F : family) (P : part) : bool :=
  let n := order (frame F) in let es := every_edge F in let C := its_agents P in
  let R := reached n (by_source (es ++ map swap es)) [hd O C] in
  (match C with [] => false | _ => true end) && forallb (fun i => seen i R) C &&
  forallb (fun e => Bool.eqb (mem (src e) C) (mem (tgt e) C)) es &&
  match becomes P with Depends => true | _ =>
    forallb (fun m => (length (filter is_balanced (owned m P)) =? length (still P))%nat &&
      forallb (fun b => check_at_rest (common_of (still P)) (ties m) (snd b)) (still P)) (modes F) end &&
  match becomes P with
  | Depends => true
  | Stability => match still P with [] => true | _ => false end
  | Consensus => match still P with [(_, v)] => forallb (fun i => Qeq_bool (nth i v 0%Q * nth i v 0%Q) 1) C | _ => false end
  | Interval => negb (length (still P) =? 0)%nat && forallb (fun m => match owned m P with [_] => true | _ => false end) (modes F)
  | Containment => negb (length (still P) =? 0)%nat && existsb (fun m => match owned m P with _ :: _ :: _ => true | _ => false end) (modes F) end.
(** columns of the basis are 1 at their own pivots, 0 at the others *)
Fixpoint distinct (l : list nat) : bool := match l with [] => true | i :: l' => negb (mem i l') && distinct l' end.
Definition check_pivots (F : family) (P : part) : bool := let C := its_agents P in
  forallb (fun i => (i <? order (frame F))%nat) C && match becomes P with Depends => true | _ =>
  distinct (map fst (still P)) && forallb (fun b => mem (fst b) C &&
    forallb (fun b' => Qeq_bool (nth (fst b') (snd b) 0%Q) (if (fst b =? fst b')%nat then 1%Q else 0%Q)) (still P)) (still P) end.

(** * A state at rest in one member that moves in another *)
(** what is believed to prove it, by numbers of modes: one has more balanced closed components than the other; or a state
    near [middle], within [off], moves, in a mandatory graph or by a weight that may change *)
Inductive why := Counts (one other : nat) | Moves (one other : nat) (by_weight : option nat) (middle_ off : list Q).
Definition heads (m : mode) (P : part) : list comp := filter is_balanced (owned m P).
Definition check_counts (P : part) (m m' : mode) : bool := let B := heads m P in let top D := hd O (nodes D) in
  (length (heads m' P) <? length B)%nat && distinct (map top B) &&
  forallb (fun D => forallb (fun D' => (top D =? top D')%nat || negb (mem (top D') (nodes D))) B) B.
Definition row_of (es : list edge) (g : edge -> Q) (i : nat) : Q :=
  fold_right (fun e a => if (tgt e =? i)%nat then Qred (g e + a) else a)%Q 0%Q es.
Definition moved (x : list Q) (e : edge) : Q := (Qabs (wt e) * entry x (tgt e) - wt e * entry x (src e))%Q.
Definition drawn_in (r : list Q) (e : edge) : Q := (Qabs (wt e) * (entry r (tgt e) - entry r (src e)))%Q.
Definition blurred (r : list Q) (e : edge) : Q := (Qabs (wt e) * (entry r (tgt e) + entry r (src e)))%Q.
Definition leads (m : mode) (i : nat) : bool := existsb (fun D => mem i (nodes D)) (comps (mandatory m)).
Definition less (a b : Q) : bool := negb (Qle_bool b a).
Definition check_state (P : part) (m : mode) (x r : list Q) : bool := let es := edges (mandatory m) in
  forallb (fun i => (negb (leads m i) || Qeq_bool (entry r i) 0) &&
    Qle_bool (Qabs (row_of es (moved x) i)) (row_of es (drawn_in r) i)) (its_agents P).
Definition check_moved (P : part) (m : mode) (by_weight : option nat) (x r : list Q) : bool := match by_weight with
  | None => let es := edges (mandatory m) in
      existsb (fun i => less (row_of es (blurred r) i) (Qabs (row_of es (moved x) i))) (its_agents P)
  | Some j => match nth_error (ties m) j with None => false | Some e =>
      negb (head e =? tail e)%nat && mem (head e) (its_agents P) && less (lo e) (hi e) &&
      less (entry r (head e) + entry r (tail e)) (Qabs (entry x (head e) - inject_Z (sign_of e) * entry x (tail e))) end end.
Definition check_depends (F : family) (P : part) (w : option why) : bool := match becomes P, w with
  | Depends, Some (Counts a b) => match nth_error (modes F) a, nth_error (modes F) b with
      | Some m, Some m' => check_counts P m m' | _, _ => false end
  | Depends, Some (Moves a b j x r) => match nth_error (modes F) a, nth_error (modes F) b with
      | Some m, Some m' => check_state P m x r && check_moved P m' j x r | _, _ => false end
  | Depends, None => false | _, _ => true end.
Definition check_frame (F : family) : bool :=
  let c := frame F in negb (length (modes F) =? 0)%nat && check_protocol c && check_sliding_input c && check_reaching c &&
  (match edges c with [] => true | _ => false end) &&
  forallb (fun i => existsb (fun P => mem i (its_agents P)) (parts F)) (seq 0 (order c)).

(** * From the initial state *)
(** no sliding variable moves *)
Definition at_first (F : family) : bool := forallb (fun q => Qeq_bool q 0) (sliding (frame F)).
Definition start_at (F : family) (i : nat) : Q := nth i (start (frame F)) 0%Q.
Definition left_at (F : family) (P : part) (i : nat) : Q :=
  Qred (start_at F i - fold_right (fun b a => nth i (snd b) 0 * start_at F (fst b) + a) 0 (still P))%Q.
Fixpoint dotQ (l : list Q) (x : nat -> Q) (i : nat) : Q := match l with [] => 0%Q | a :: l' => Qred (a * x i + dotQ l' x (S i)) end.
Fixpoint bilQ (A : list (list Q)) (x : nat -> Q) (i : nat) : Q :=
  match A with [] => 0%Q | r :: A' => Qred (x i * dotQ r x O + bilQ A' x (S i)) end.
Definition larger (q a : Q) : Q := if Qle_bool a q then q else a.
Definition share (F : family) (P : part) (d : list Q) (i : nat) : Q :=
  if pos (entry d i) then let q := (left_at F P i / entry d i)%Q in Qred (q * q) else 0%Q.
Definition value_at (F : family) (b : lyapunov) : option Q := let P := about b in match by_ b with
  | Form A => Some (bilQ A (fun i => nth i (map (left_at F P) (seq 0 (order (frame F)))) 0%Q) O)
  | Rows d => Some (fold_right (fun i a => larger (share F P d i) a) 0%Q (its_agents P))
  | Squares _ => None end.

(** * The input *)
Definition fast (F : family) (b : lyapunov) : bool := let c := frame F in Qle_bool 2 (rho2 c * kappa c * decay b).
Definition check_stays (F : family) : bool := negb (stays F) || forallb (fun i => unmoved F i ||
  existsb (fun b => fast F b && mem i (its_agents (about b))) (bounds F)) (seq 0 (order (frame F))).
Definition check_peak (F : family) (i : nat) (peak : Q) : bool := let c := frame F in (i <? order c)%nat && (notneg peak && (unmoved F i ||
  existsb (fun b => fast F b && mem i (its_agents (about b)) && match value_at F b with
    | Some v => let g := (rho1 c + rho2 c * kappa c * / span c)%Q in Qle_bool (g * g * (nth i (inputs b) 0%Q * v)) (peak * peak)
    | None => false end) (bounds F))).
(** without what the sliding mode adds to an input at rest *)
Definition nominal_peak (F : family) (peak : Q) : Q := match kind (frame F) with Nominal _ => peak | SlidingMode _ _ mu1 _ _ _ => (peak - mu1)%Q end.
Definition check_peaks (F : family) : bool := match peaks F with [] => true | l => at_first F &&
  forallb (fun p => check_peak F (fst p) (nominal_peak F (snd p))) (combine (seq 0 (length l)) l) end.

Definition check_family (F : family) (hs : list hint) (ws : list (option why)) : bool :=
  check_frame F && forallb (check_mode F) (modes F) && forallb (check_part F) (parts F) && forallb (check_pivots F) (parts F) &&
  (length (parts F) =? length ws)%nat && forallb (fun pw => check_depends F (fst pw) (snd pw)) (combine (parts F) ws) &&
  ((length (bounds F) =? length hs)%nat && forallb (fun bh => check_bound F (fst bh) (snd bh)) (combine (bounds F) hs)) &&
  check_stays F && check_peaks F.
