(* The Lyapunov function of the theorem's row (sections 10 and 14 of FORMAT.md), and the inequalities that prove its
   rate: as [margin]s and groups of leaders, which the theorem speaks of. *)
open Checker
open Json
open Document
module Z = Number.Z

type t = {
  coordinates : string; weights : (int * q) list; own_rate : q option; section : string -> Json.t;
  inequalities : margin list; groups : (q list * q) list;
  any_rho : bool (* said of every positive rho; not checked *) }

(* what the row is of: closed components from 1 on with their nodes and whether they are balanced *)
type setting = { n : int; edges : edge list; closed : (int * int list * bool) list; followers : int list; theorem : string }

let row s =
  let kind = (Char.code s.theorem.[0] - Char.code '1') mod 3 + 1 and balanced = s.theorem.[2] = '1' in
  let groups = List.filter (fun (_, own, _) -> List.length own > 1) s.closed in
  let first (_, own, _) = own in
  if s.edges = [] then "none: every agent keeps its state", (if kind = 1 then "eps" else "E"), []
  else match kind, balanced, groups with
    | 1, true, _ -> "2 a(L)", "eps", [ ("P", first (List.hd s.closed), false) ]
    | 1, false, _ -> "lmin(Omega L + L' Omega) / lmax(Omega)", "E", [ ("Omega", first (List.hd s.closed), false) ]
    | _, true, [] ->
        let a = if kind = 2 then "Xi_F" else "H_F" in
        Printf.sprintf "lmin(%s L_F + L_F' %s) / lmax(%s)" a a a, "E", [ (a, s.followers, false) ]
    | 2, _, g :: _ ->
        let name, objective = if balanced then "Xi_L", "lmin(Phi) / lmax(Xi)" else "Xit_L", "lmin(Psi) / lmax(Xit)" in
        objective, "E", [ (name, first g, false); ("Xi_F", s.followers, true) ]
    | _ ->
        let one, last, objective =
          if balanced then "H_", "H_F", "lmin(Pi) / lmax(H)"
          else "Theta_L", "Theta_F", "lmin(Theta L + L' Theta) / lmax(Theta)" in
        objective, "E", List.map (fun (k, own, _) -> (one ^ string_of_int k, own, false)) groups
          @ (if s.followers = [] then [] else [ (last, s.followers, true) ])

let by_node s of_ = List.init s.n (fun i -> Option.value (List.assoc_opt i of_) ~default:Number.zero)
let size q = { q with qnum = Z.abs q.qnum }

(* |(p'M)_j| <= 10^-9 p_j M_jj at every node of a component *)
let near_null_vector s own p =
  let weight i = List.assoc i (List.combine own p) in
  List.iter (fun j ->
    let into = List.filter (fun e -> e.tgt = j) s.edges and out = List.filter (fun e -> e.src = j && List.mem e.tgt own) s.edges in
    let sum = List.fold_left Number.add Number.zero in
    let kept = Number.mul (weight j) (sum (List.map (fun e -> size e.wt) into)) in
    let given = sum (List.map (fun e -> Number.mul (weight e.tgt) (size e.wt)) out) in
    let off = size (Number.sub kept given) in
    need (Number.compare (Number.mul off (Number.of_z (Z.of_int 1_000_000_000))) kept <= 0)
      "the weights are not the left null vector of the comparison matrix") own

(* the leaders' part of the row: gammas by node; takes the obligations of each group *)
let leaders s proof blocks =
  if not (List.mem s.theorem [ "2.1"; "3.1"; "5.1"; "6.1" ]) then [], [], []
  else List.fold_left (fun (gammas, inequalities, groups) (name, own, p, times_rho) ->
    if times_rho || own = s.followers then gammas, inequalities, groups
    else
      let weights = by_node s (List.combine own p) in
      let _, _, balanced = List.find (fun (_, nodes, _) -> nodes = own) s.closed in
      if balanced then begin
        let b = bare proof "leader-decrease" ("paper." ^ name) [ "b" ] "b" in
        need (Z.sign b.qnum > 0) "leader-decrease: b is not positive";
        near_null_vector s own p;
        let low = List.fold_left (fun a x -> if Number.compare x a < 0 then x else a) (List.hd p) p in
        let each = List.map2 (fun i w ->
          (i, Number.mul b (if s.theorem.[0] = '2' || s.theorem.[0] = '5' then w else low))) own p in
        gammas @ each, inequalities, groups @ [ (weights, b) ] end
      else begin
        let m = bare proof "leader-margin" ("paper." ^ name) [ "m" ] "m" in
        need (Z.sign m.qnum > 0) "leader-margin: m is not positive";
        gammas @ List.map (fun i -> (i, m)) own, inequalities @ [ { on = own; weights; gammas = []; least = m; upto = [] } ], groups end)
    ([], [], []) blocks

let read s nodes proof v =
  let section = fields "paper" ~may:[ "rho"; "rho_interval"; "rate"; "overshoot" ] [ "theorem"; "objective"; "coordinates"; "blocks" ] v in
  let objective, coordinates, expected = row s in
  need (section "theorem" = Str s.theorem && section "objective" = Str objective) "paper: another theorem or objective";
  need (section "coordinates" = Str coordinates) "paper: other coordinates";
  let listed = entries "blocks" (section "blocks") in
  need (List.length listed = List.length expected) "paper: other blocks";
  let blocks = List.map2 (fun v (name, own, times_rho) ->
    let get = fields "a block" [ "name"; "nodes"; "diagonal"; "times_rho" ] v in
    need (get "name" = Str name && get "times_rho" = Bool times_rho) "paper: another block";
    need (positions nodes "nodes of a block" (get "nodes") = own) "paper: nodes of a block";
    let p = List.map (number "diagonal") (entries "diagonal" (get "diagonal")) in
    need (List.length p = List.length own && List.for_all (fun (w : q) -> Z.sign w.qnum > 0) p) "paper: weights of a block";
    name, own, p, times_rho) listed expected in
  let rho = optional number "paper.rho" (section "rho") in
  need ((rho <> None) = List.exists (fun (_, _, _, t) -> t) blocks) "rho belongs to a block times rho";
  let rho_value = Option.value rho ~default:Number.one in
  need (Z.sign rho_value.qnum > 0) "rho is not positive";
  let weights rho = List.concat_map (fun (_, own, p, t) ->
    List.map2 (fun i w -> i, if t then Number.mul rho w else w) own p) blocks in
  let own_rate = optional number "paper.rate" (section "rate") in
  (match own_rate with Some r -> need (Z.sign r.qnum > 0) "paper.rate is not positive" | None -> ());
  let own = weights rho_value in
  (match blocks, section "overshoot" with
   | [], o -> need (own_rate = None && o = Null) "paper: a rate where nothing moves"
   | _, o ->
       let ws = List.map snd own in
       let low = List.fold_left Number.min (List.hd ws) ws and high = List.fold_left Number.max (List.hd ws) ws in
       need (Number.equal (number "paper.overshoot" o) (Number.div high low)) "paper.overshoot");
  let inequalities, groups = match own_rate with
    | None -> need (section "rho_interval" = Null) "an interval without a proof"; [], []
    | Some r when coordinates = "eps" ->
        need (section "rho_interval" = Null) "an interval without rho";
        need (Number.equal (bare proof "deviation-decrease" "paper" [ "b" ] "b") r) "deviation-decrease: b is not the rate";
        let _, nodes, p, _ = List.hd blocks in
        near_null_vector s nodes p; [], []
    | Some r ->
        let gammas, inequalities, groups = leaders s proof blocks in
        let gammas = List.init s.n (fun i -> List.assoc_opt i gammas) in
        let on = List.map fst own in
        let upto = if rho = None then [] else s.followers in
        let at rho least = { on; weights = by_node s (weights rho); gammas; least; upto } in
        let numbers = bare proof "margin" "paper" (if rho = None then [ "m" ] else [ "m"; "rho" ]) in
        if rho <> None then need (Number.equal (numbers "rho") rho_value) "margin: another rho";
        let m = numbers "m" in
        let top = List.fold_left (fun a (_, w) -> Number.max a w) (snd (List.hd own)) own in
        need (Number.equal r (Number.div m top)) "paper.rate is not m / largest weight";
        let ends = match rho, section "rho_interval" with
          | None, Null -> []
          | None, _ | Some _, Null -> bad "paper.rho_interval: there iff there are rate and rho"
          | Some rho, v ->
              let get = fields "rho_interval" ~may:[ "printed"; "exact" ] [] v in
              (match optional number "printed" (get "printed"), optional number "exact" (get "exact") with
               | None, None ->
                   let fixed = List.concat_map (fun (_, own, _, t) -> if t then [] else own) blocks in
                   need (List.for_all (fun e -> not (List.mem e.tgt s.followers && List.mem e.src fixed)) s.edges)
                     "rho is bounded, since followers listen to these leaders"; []
               | Some printed, Some exact ->
                   let numbers = bare proof "rho-interval" "paper" [ "printed"; "exact" ] in
                   need (Number.equal (numbers "printed") printed && Number.equal (numbers "exact") exact) "rho-interval: other ends";
                   need (Z.sign printed.qnum > 0 && Number.compare printed exact <= 0 && Number.compare rho exact <= 0)
                     "rho-interval: the ends are in the wrong order";
                   [ at printed Number.zero; at exact Number.zero ]
               | _ -> bad "rho_interval: one end without the other") in
        inequalities @ (at rho_value m :: ends), groups in
  let any_rho = section "rho_interval" <> Null && not (List.exists (fun (m : margin) -> Number.equal m.least Number.zero) inequalities) in
  { coordinates; weights = own; own_rate; section; inequalities; groups; any_rho }
