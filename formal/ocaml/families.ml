(* A certificate of a family: from the document, sections 18 and 19 of FORMAT.md, to the record that the theorem speaks of. *)
open Checker
open Json
open Document
module Z = Number.Z

type t = { nodes : nodes; family : family; hints : hint list; whys : why option list; limits : limits; sha256 : string;
  checked : (string * string) list;
  unchecked : (string * string) list; sections : string list }

let most_nodes = 400
let most_functions = 1000
(* entries of the matrices of all rates: so much is formed and factorised *)
let most_work = 30_000_000

(* the mandatory graph of a mode with the components that are listed *)
let mandatory nodes ties structure =
  let n = Array.length nodes.labels in
  let get, listed, _ = Reader.listed_components nodes structure in
  let comps = Reader.without_weights nodes listed in
  let edges = smallest ties in
  let all, all_balanced, pieces = Pieces.whole n edges comps get in
  { order = n; edges; kind = Nominal Number.one; rho1 = Number.one; rho2 = Number.one; kappa = Number.one; comps; pieces;
    all_balanced; sign_symmetric = Pieces.sign_symmetric all; funcs = []; start = []; sliding = []; final = [];
    enclosed = true; margins = []; leaders = []; upper_bound = None; proved = None; best_diagonal = None; best_overshoot = None;
    bounded_input = false; reaching = []; sliding_input = []; efforts = []; degenerate = None; start_box = None }

(* * Components, and what becomes of them *)
let outcomes = [ "stability", Stability; "bipartite consensus", Consensus; "interval bipartite consensus", Interval;
  "bipartite containment", Containment; "depends on the signal", Depends ]
let claim v =
  let get = fields "claim" [ "theorem"; "behaviour" ] v in
  need (get "theorem" = Str "common kernel") "claim: another theorem";
  let b = text "behaviour" (get "behaviour") in
  try List.assoc b outcomes with Not_found -> bad "claim: an unknown behaviour"
(* closed components of the first mode by number, and the columns of the balanced ones *)
let columns nodes (first : cert) own camps outcome witness =
  let n = Array.length nodes.labels in
  let here = Pieces.inside n own in
  let mine = List.filter (fun (_, (one : comp)) -> here (List.hd one.nodes) && is_balanced one) (List.mapi (fun k one -> k + 1, one) first.comps) in
  let column entry = List.init n (fun i -> if here i then entry i else Number.zero) in
  match outcome, witness with
  | Depends, _ -> []
  | (Stability | Consensus), w ->
      need (w = Null) "family-claim: a witness that nothing asks for";
      (match outcome, mine, camps with
       | Stability, _, _ -> []
       | _, (_, one) :: _, Gauge g ->
           let g = Array.of_list g in
           let pivot = List.hd one.nodes in
           [ pivot, column (fun i -> Number.of_z (Z.mul g.(i) g.(pivot))) ]
       | _ -> bad "claim: no camps fit all edges")
  | _, w ->
      (* of the behaviours of section 18 that fit the first is due *)
      need (outcome <> Interval || (match camps with Cycle _ -> true | Gauge _ -> false)) "claim: camps fit all edges, which is bipartite consensus";
      let rows = match (fields "the witness" [ "rows" ] w) "rows" with Obj l -> l | _ -> bad "rows: an object is due" in
      let rows = List.map (fun (label, row) -> node nodes "rows" (Str label), match row with
        | Obj l -> List.map (fun (k, x) -> k, number "rows" x) l | _ -> bad "rows: an object is due") rows in
      let leader = Array.make n false in
      List.iter (fun (one : comp) -> List.iter (fun i -> leader.(i) <- true) one.nodes) first.comps;
      List.iter (fun (i, row) -> need (here i && not leader.(i)) "rows: not of a follower";
        List.iter (fun (k, _) -> need (List.exists (fun (j, _) -> string_of_int j = k) mine) "rows: no balanced component of this number") row) rows;
      List.map (fun (k, (one : comp)) ->
        let g = match one.camps with Gauge g -> Array.of_list g | Cycle _ -> [||] in
        let inside = Pieces.inside n one.nodes in
        List.hd one.nodes, column (fun i ->
          if inside i then Number.of_z g.(i) else if leader.(i) then Number.zero
          else match List.assoc_opt i rows with
            | Some row -> Option.value (List.assoc_opt (string_of_int k) row) ~default:Number.zero | None -> Number.zero)) mine

let index_of f l =
  let rec go k = function [] -> None | x :: l' -> if f x then Some k else go (k + 1) l' in go 0 l
(* why what becomes of a component depends on the signal: numbers of balanced closed components that differ, or a state *)
let why_of nodes modes part witness =
  let n = Array.length nodes.labels in
  let counts = List.map (fun m -> List.length (heads m part)) modes in
  let most = List.fold_left max 0 counts and least = List.fold_left min max_int counts in
  let place x = Option.get (index_of (fun y -> y = x) counts) in
  if part.becomes <> Depends then None
  else if most > least then begin
    need (witness = Null) "family-claim: a witness that nothing asks for";
    Some (Counts (place most, place least)) end
  else begin
    let get = fields "the witness" ~may:[ "edge" ] [ "mode"; "other"; "state" ] witness in
    let mode key = let k = integer key (get key) in
      need (Z.sign k >= 0 && Z.compare k (Z.of_int (List.length modes)) < 0) "family-claim: an unknown mode"; Z.to_int k in
    let one = mode "mode" and other = mode "other" in
    let here = Pieces.inside n part.its_agents in
    let state = match get "state" with
      | Obj l -> List.map (fun (label, v) -> let i = node nodes "state" (Str label) in
          need (here i) "family-claim: a state outside the component"; i, Reader.interval "state" v) l
      | _ -> bad "state: an object is due" in
    let all f = List.init n (fun i -> match List.assoc_opt i state with Some x -> f x | None -> Number.zero) in
    let by_weight = match get "edge" with
      | Null -> None
      | v -> (match entries "edge" v with
          | [ s; t; sg ] ->
              let s = node nodes "edge" s and t = node nodes "edge" t and sg = integer "edge" sg in
              let fits e = not (Reader.known e) && Z.equal sg (Z.of_int (Reader.sign e))
                && ((e.tail = s && e.head = t) || (e.mutual && e.tail = t && e.head = s)) in
              (match index_of fits (List.nth modes other).ties with
               | Some j -> Some j | None -> bad "family-claim: an unknown edge, or a known weight")
          | _ -> bad "edge: three entries are due") in
    Some (Moves (one, other, by_weight, all fst, all snd)) end

(* * Functions *)
(* an upper bound of [(d'x)^2 / V], and of its root *)
let square r (q : quotient) fs d =
  let f : factor = r in
  let rec pad n l = if n = 0 then [] else match l with [] -> Z.zero :: pad (n - 1) [] | x :: l' -> x :: pad (n - 1) l' in
  let masked = List.mapi (fun i x -> if List.mem i fs then Z.zero else x) d in
  let u = pad (List.length f.fD) (List.map (Z.mul f.fs) (hmul f.fD masked)) in
  let y, rest = solve f.fT u in
  let m = List.fold_left Z.min (List.hd f.fe) f.fe in
  let two = Z.of_int 2 in
  Number.make (Z.mul two (Z.mul q.qm (Z.add (Z.mul m (size2 y)) (size2 rest)))) (Z.mul m (Z.mul f.fs f.fs))
let middle_common ties = List.fold_left (fun a e -> Z.lcm a (middle e).qden) Z.one ties
let roots_of n part (q : quotient) means modes = match factor_mod n q.qsw q.qfw q.qF with
  | None -> bad "P is not definite"
  | Some r ->
      let fs = List.map fst q.qfw in
      let here = Pieces.inside n part.its_agents in
      let above d scale = Number.root (Number.div (square r q fs d) (Number.of_z (Z.mul scale scale))) in
      List.map (fun m ->
        let dq = middle_common m.ties in
        List.map (fun e -> if Reader.known e || not (here e.head) then Number.zero else above (hvec e) Z.one) m.ties,
        List.init n (fun i -> if here i then above (mid_row dq m.ties (List.init (i + 1) (fun j -> if i = j then Z.one else Z.zero))) dq else Number.zero)
        @ List.map (fun (u, _) -> let d = common u in above (mid_row dq m.ties (List.map (scaled d) u)) dq) means) modes
(* the weights of a mode that have a multiplier: those that move what is left to the states at rest *)
let moving part n =
  let pivots = List.map fst part.still in
  let here = Pieces.inside n part.its_agents and pivot = Pieces.inside n pivots in
  let columns = List.map (fun (p, v) -> p, Array.of_list v) part.still in
  let of_pivot p k = match List.assoc_opt p columns with Some v -> v.(k) | None -> Number.zero in
  let entry j k = (* column j of C at k, which is no pivot *)
    if pivot j then Number.sub Number.zero (of_pivot j k) else if j = k then Number.one else Number.zero in
  let rows = List.filter (fun k -> not (pivot k)) part.its_agents in
  fun e -> here e.head && not (Reader.known e)
    && not (pivot e.head && pivot e.tail)
    && List.exists (fun k ->
         let a = if here e.head then entry e.head k else Number.zero in
         let a = if e.mutual then Number.sub a (Number.mul (Number.of_z (Z.of_int (Reader.sign e))) (entry e.tail k)) else a in
         Z.sign a.qnum <> 0) rows
let component_of parts v =
  let z = integer "component" v in
  need (Z.sign z >= 0 && Z.lt z (Z.of_int (List.length parts))) "component: there is no such";
  let part = List.nth parts (Z.to_int z) in
  need (part.becomes <> Depends) "a Lyapunov function of a component without a common kernel"; part
(* the largest [|xi_k| / d_k] of followers, whose leaders are at rest *)
let rows_of nodes parts modes proof of_ v =
  let n = Array.length nodes.labels in
  let get = fields "a Lyapunov function" [ "class"; "component"; "vector"; "parts"; "rate" ] v in
  if get "parts" <> Arr [] then unsupported "a family with a function of rows whose parts have forms of their own";
  let part = component_of parts (get "component") in
  let pivot = Pieces.inside n (List.map fst part.still) in
  let own = List.filter (fun i -> not (pivot i)) part.its_agents in
  need (own <> []) "a function of rows without followers";
  let d = Array.make n Number.zero in
  List.iter2 (fun i x -> need (Z.sign x.qnum > 0) "vector: a number is not positive"; d.(i) <- x) own (numbers "vector" (List.length own) (get "vector"));
  let rate = number "rate" (get "rate") in
  need (Number.equal (bare proof "family-rows" of_ [ "b" ] "b") rate) (of_ ^ ": b is not the rate");
  let d = Array.to_list d in
  let squared x = Number.mul x x in
  let here = Pieces.inside n part.its_agents in
  let inputs = List.init n (fun i -> if not (here i) then Number.zero else
    List.fold_left (fun a m -> Number.max a (squared (row_sum m.ties (row_moved d) i))) Number.zero modes) in
  { about = part; by_ = Rows d; decay = rate; inputs; offs = List.map squared d; means = [] }, { multipliers = []; roots = [] }
(* weights of agents that end at one value up to signs, which do not cancel *)
let mean_of nodes part v =
  let n = Array.length nodes.labels in
  let get = fields "a mean" [ "weights"; "constant" ] v in
  let weights = match get "weights" with
    | Obj l -> List.map (fun (label, x) -> node nodes "means" (Str label), number "means" x) l | _ -> bad "means: an object is due" in
  let here = Pieces.inside n part.its_agents in
  need (weights <> [] && List.for_all (fun (i, _) -> here i) weights) "means: of agents of the component";
  let row i = List.map (fun (_, v) -> List.nth v i) part.still in
  let size l = List.map (fun x -> if Number.compare x Number.zero < 0 then Number.sub Number.zero x else x) l in
  let first = size (row (fst (List.hd weights))) in
  let total l = List.fold_left Number.add Number.zero l in
  need (Number.equal (total first) Number.one && List.for_all (fun x -> Number.equal x Number.one || Number.equal x Number.zero) first
    && List.for_all (fun (i, _) -> List.for_all2 Number.equal (size (row i)) first) weights) "means: of agents that end at one value";
  need (not (Number.equal (total (List.map (fun (i, x) -> Number.mul x (total (row i))) weights)) Number.zero)) "means: weights that cancel";
  List.init n (fun i -> Option.value (List.assoc_opt i weights) ~default:Number.zero), number "constant" (get "constant")
let form_of nodes parts modes proof work k v =
  let n = Array.length nodes.labels in
  let of_ = Printf.sprintf "decays[%d]" k in
  let get = fields "a Lyapunov function" [ "class"; "component"; "nodes"; "lower_triangle"; "rate"; "inputs"; "coordinates"; "means" ] v in
  need (List.mem (text "class" (get "class")) [ "full"; "diagonal"; "undirected" ]) "an unknown class";
  let part = component_of parts (get "component") in
  let pivot = Pieces.inside n (List.map fst part.still) in
  let own = positions nodes "nodes of a function" (get "nodes") in
  need (own <> [] && own = List.filter (fun i -> not (pivot i)) part.its_agents) "nodes of a function";
  let p = Reader.matrix nodes "lower_triangle" (Array.of_list own) (entries "lower_triangle" (get "lower_triangle")) in
  let rate = number "rate" (get "rate") in
  let labels = List.map (fun i -> nodes.labels.(i)) in
  let spread own what v = let l = List.combine own (List.map (number what) (ordered (labels own) what v)) in
    List.init n (fun i -> Option.value (List.assoc_opt i l) ~default:Number.zero) in
  let moves = moving part n in
  let q = quotient_of n part p in
  let multipliers = List.mapi (fun i m ->
    let numbers, witness = proved proof "family-rate" (Printf.sprintf "%s.modes[%d]" of_ i) [ "b" ] in
    let b = numbers "b" in
    if not (Number.equal b rate) then said proof "at the rate of the function";
    let taus = match witness with
      | Null -> List.map (fun _ -> None) m.ties
      | w ->
          let given = ref (List.map (number "multipliers") (entries "multipliers" ((fields "the witness" [ "multipliers" ] w) "multipliers"))) in
          let l = map (fun e -> if moves e then match !given with
            | tau :: rest -> given := rest; need (Z.sign tau.qnum > 0) "multipliers: one is not positive"; Some (Number.mul tau (Number.of_z q.qm))
            | [] -> bad "multipliers: one for each weight" else None) m.ties in
          need (!given = []) "multipliers: one for each weight"; l in
    let size = n + List.length (List.filter Option.is_some taus) in
    need (size <= 800 + most_nodes) "multipliers: more than 800 rows";
    work := !work + size * size;
    if !work > most_work then unsupported "a family whose rates take more than 30,000,000 entries";
    b, taus) modes in
  let least = List.fold_left (fun a (b, _) -> Number.min a b) (fst (List.hd multipliers)) multipliers in
  need (Number.equal least rate) (of_ ^ ": the rate is not the least of all modes");
  bare_of proof "family-constants" of_;
  let means = map (mean_of nodes part) (entries "means" (get "means")) in
  need (List.length means <= 100) "means: more than 100";
  let b = { about = part; by_ = Form p; decay = rate; inputs = spread part.its_agents "inputs" (get "inputs");
    offs = spread own "coordinates" (get "coordinates"); means } in
  b, { multipliers; roots = roots_of n part q means modes }
let lyapunov_of nodes parts modes proof work k v =
  match part "class" v with
  | Some (Str "rows") -> rows_of nodes parts modes proof (Printf.sprintf "decays[%d]" k) v
  | Some (Str "squares") -> unsupported "a family with a function of squares"
  | _ -> form_of nodes parts modes proof work k v

(* * The document *)
let certificate (j : Json.t) : t =
  Reader.refuse_formation j;
  let may = [ "claim"; "components"; "drives"; "final_state"; "reaching_time"; "messages"; "boxes"; "restricted" ] in
  let get = Reader.opened ~may [ "input" ] j in
  let left = ref [] in
  let not_checked s = left := s :: !left in
  let more = Reader.set_apart get not_checked [ "restricted", "signals that are restricted"; Reader.messages ] in
  let nodes, read, sha256, (kind, rho1, rho2, kappa), start, sliding = Reader.problem true (get "problem") in
  let n = Array.length nodes.labels in
  if n > most_nodes then unsupported (Printf.sprintf "a family of more than %d nodes" most_nodes);
  let structures = entries "structure" (get "structure") in
  need (List.length structures = List.length read) "structure: one for each mode";
  let modes = List.map2 (fun (_, _, ties) s -> { ties; mandatory = mandatory nodes ties s }) read structures in
  let is_sliding = match kind with SlidingMode _ -> true | Nominal _ -> false in
  let proof = proof_of (get "proof") in
  List.iteri (fun i _ -> bare_of proof "structure" (Printf.sprintf "graph.modes[%d]" i)) modes;
  (* camps that fit all edges of all modes *)
  let every = List.concat_map (fun (_, edges, _) -> List.map (fun e -> { tgt = e.head; src = e.tail; wt = Number.of_z (Z.of_int (Reader.sign e)) }) edges) read in
  let found = (Pieces.find (Pieces.graph n every)).pieces in
  let claims = match found with
    | [ _ ] -> need (get "components" = Null) "components of a connected family"; [ claim (get "claim") ]
    | _ ->
        need (get "claim" = Null) "claim: the family is not connected";
        let l = entries "components" (get "components") in
        need (List.length l = List.length found) "components: one for each weak component";
        List.map2 (fun v (own, _) ->
          let get = fields "a component" [ "nodes"; "claim" ] v in
          need (positions nodes "a component" (get "nodes") = own) "components: other nodes"; claim (get "claim")) l found in
  let _, witness = proved proof "family-claim" "graph" [] in
  let witnesses = entries "family-claim" witness in
  need (List.length witnesses = List.length found) "family-claim: one for each component";
  let first = (List.hd modes).mandatory in
  let parts = List.map2 (fun ((own, camps), becomes) w ->
    { its_agents = own; becomes; still = columns nodes first own camps becomes w }) (List.combine found claims) witnesses in
  let whys = List.map2 (why_of nodes modes) parts witnesses in
  let moving = List.exists (fun x -> not (Number.equal x Number.zero)) sliding in
  let functions = entries "decays" (get "decays") in
  need (List.length functions <= most_functions) "decays: more than 1,000";
  let work = ref 0 in
  let bounds = List.mapi (lyapunov_of nodes parts modes proof work) functions in
  let reaching = Reader.reaching_times nodes proof kind kappa sliding (get "reaching_time") not_checked in
  if moving then begin
    need (List.length (entries "drives" (get "drives")) = List.length functions) "drives: one for each function";
    not_checked "drives";
    List.iteri (fun k _ -> skipped proof "family-drive" (Printf.sprintf "decays[%d]" k)) functions end
  else need (get "drives" = Null) "drives where no sliding variable moves";
  need ((start = None) = (get "final_state" = Null)) "a final state without an initial state, or none";
  (* of every part what is known of its ends; none if they are not proved *)
  let base = { frame = { first with start = Option.value start ~default:[] }; modes; parts; bounds = List.map fst bounds; ends = []; stays = false; peaks = []; boxes = [] } in
  let ends, facts = match start with
    | None -> [], []
    | Some _ ->
        let all_kept p k = p.still = [] || List.length k = List.length p.still in
        let told = match following_witness proof with
          | Null -> List.map (fun p -> p, []) parts
          | w ->
              let l = entries "family-final-state" w in
              need (List.length l = List.length parts) "family-final-state: one for each component";
              List.map2 (fun p w -> need (p.becomes <> Depends || w = Null) "kept means of a component without a common kernel";
                p, Limits.kept nodes modes p w) parts l in
        let proved_ (p, k) = p.becomes = Depends || (match p.its_agents with [ _ ] -> true | _ -> not moving || all_kept p k) in
        let read = by_agent nodes (optional Reader.interval) "final_state" (get "final_state") in
        let depends = Pieces.inside n (List.concat_map (fun p -> if p.becomes = Depends then p.its_agents else []) parts) in
        List.iteri (fun i e -> need ((e = None) = depends i) "a final state that is not claimed, or one that is") read;
        if List.for_all proved_ told then ignore (proved proof "family-final-state" "final_state" [])
        else (skipped proof "family-final-state" "final_state"; not_checked "final_state");
        let ok = Pieces.inside n (List.concat_map (fun t -> if proved_ t then (fst t).its_agents else []) told) in
        List.mapi (fun i e -> if ok i then e else None) read,
        List.mapi (fun i (p, k) -> i, k @ (if moving then [] else Limits.near base p)) told in
  let input = fields "input" ~may:[ "bounded"; "peaks" ] (if is_sliding then [ "sliding" ] else []) (get "input") in
  let sliding_input = if not is_sliding then [] else begin
    let told = fields "input.sliding" ~may:[ "agents" ] [ "bounded" ] (input "sliding") in
    ignore (truth "input.sliding.bounded" (told "bounded")); not_checked "input.sliding.bounded";
    if told "agents" = Null then [] else (bare_of proof "input-sliding" "input"; by_agent nodes number "input.sliding.agents" (told "agents")) end in
  let stays, peaks = match input "bounded" with
    | Null -> need (input "peaks" = Null) "peaks of an input that may grow"; false, []
    | b ->
        need (truth "input.bounded" b) "input.bounded is true, or absent";
        let slow = match kind with
          | SlidingMode (_, _, _, _, mu3, _) -> moving && Number.compare (Number.mul mu3 kappa) Number.one < 0 | Nominal _ -> false in
        if input "peaks" = Null then (need (start = None || slow) "input.peaks are due"; bare_of proof "family-input" "input"; true, [])
        else if moving then (skipped proof "family-input" "input"; not_checked "input.peaks"; true, [])
        else (need (start <> None) "peaks without an initial state"; bare_of proof "family-input" "input"; true, by_agent nodes number "input.peaks" (input "peaks")) in
  let boxes = if get "boxes" = Null then [] else begin
    need (start <> None && not moving) "boxes without an initial state, or while sliding variables move";
    Limits.boxes nodes modes parts proof (get "boxes") end in
  let hull = match start with Some x when not moving && (boxes <> [] || facts <> []) -> Limits.hull_of modes x | _ -> [], [] in
  others proof (fun _ -> more);
  need (get "verdict" = Str "certified") "verdict: a family is certified";
  let frame = { first with edges = []; comps = []; pieces = []; kind; rho1; rho2; kappa; start = Option.value start ~default:[]; sliding;
    reaching; sliding_input } in
  { nodes; sha256; checked = List.rev proof.checked; unchecked = List.rev proof.unchecked; sections = List.rev !left;
    hints = List.map snd bounds; whys; limits = { hull; told = facts };
    family = { frame; modes; parts; bounds = List.map fst bounds; ends; stays; peaks; boxes } }

(* the parts of the check one by one, to name the first that fails *)
let of_family (f : family) hs ws l : (string * (unit -> bool)) list =
  [ "gain, or what is said of sliding variables", (fun () -> check_frame f) ]
  @ List.mapi (fun i m -> Printf.sprintf "structure of graph.modes[%d]" i, (fun () -> check_mode f m)) f.modes
  @ List.mapi (fun i (p, w) -> Printf.sprintf "family-claim of graph, component %d" i,
      (fun () -> check_part f p && check_pivots f p && check_depends f p w)) (List.combine f.parts ws)
  @ List.mapi (fun i (b, h) -> Printf.sprintf "decays[%d]" i, (fun () -> check_bound f b h)) (List.combine f.bounds hs)
  @ [ "family-final-state of final_state", (fun () -> check_family_ends f l.hull l.told);
      "family-input of input", (fun () -> check_stays f && check_peaks f);
      "boxes", (fun () -> check_boxes f l.hull) ]
