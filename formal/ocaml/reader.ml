(* From the document to the record that the theorem speaks of. What is read here is compared key by key with
   FORMAT.md; what the theorem does not speak of is named, and not believed. *)
open Checker
open Json
open Document
module Z = Number.Z

type t = {
  nodes : nodes; cert : cert; sha256 : string; theorem : string;
  checked : (string * string) list; unchecked : (string * string) list; sections : string list;
  hints : Checker.hints; rest : Json.t list; full : int -> bool (* whether a Lyapunov function is a full matrix *) }

let refuse_formation j = if part "formation" j <> None then unsupported "agents in a formation"

(* keys of every certificate; claims besides the others, which keep their meaning, are named, and not believed, with their
   obligations *)
let keys = [ "schema"; "producer"; "problem"; "structure"; "decays"; "proof"; "verdict"; "digest"; "unverified" ]
let messages = "messages", "messages that are late, lost or rounded, and of leaders that move"
let opened ~may more j =
  let get = fields "the certificate" ~may (keys @ more) j in
  ignore (text "producer" (get "producer"));
  need (match get "unverified" with Obj _ -> true | _ -> false) "unverified is not an object";
  let outside = match j with Obj l -> List.filter (fun (k, _) -> k <> "digest" && k <> "unverified") l | _ -> [] in
  need (get "digest" = Str (hashed (Obj outside))) "digest: the certificate was changed after it was made"; get
let set_apart get not_checked besides =
  let there = List.filter (fun (key, _) -> get key <> Null) besides in
  List.iter (fun (key, what) -> not_checked (Printf.sprintf "%s, all that is said of %s" key what)) there; there <> []

(* * What is asked: the graph in all its modes, the gain, where agents begin *)
let is_family j = Option.bind (part "problem" j) (part "signal") <> None
let most_modes = 1000
let how_read v =
  let get = fields "graph.read" ~may:[ "zeros"; "laplacian"; "columns"; "variable" ]
    [ "orientation"; "duplicates"; "self_loops"; "undirected" ] v in
  let said key ok = need (ok (get key)) ("graph.read: " ^ key) in
  let among l = function Str s -> List.mem s l | _ -> false in
  let dropped = function
    | Str s -> String.length s >= 9 && String.length s <= 20 && String.sub s 0 8 = "dropped "
        && Number.digits (String.sub s 8 (String.length s - 8))
    | _ -> false in
  said "orientation" (among [ "information"; "listens"; "matrix" ]);
  said "duplicates" (among [ "refused"; "sum"; "last" ]);
  said "self_loops" (fun v -> v = Str "refused" || dropped v);
  said "undirected" (function Bool _ -> true | _ -> false);
  said "zeros" (fun v -> v = Null || dropped v);
  said "laplacian" (function Null | Bool _ -> true | _ -> false);
  List.iter (fun key -> said key (function Null | Str _ -> true | _ -> false)) [ "columns"; "variable" ]

let sign e = if Z.sign e.top.qnum <> 0 then Z.sign e.top.qnum else -1
let known e = Number.equal e.bottom e.top
let may_fail e = Z.sign e.bottom.qnum = 0 || Z.sign e.top.qnum = 0
let edge s t bottom top =
  let one = Z.sign bottom.qnum and other = Z.sign top.qnum in
  need (one * other >= 0 && (one <> 0 || other <> 0)) "an edge: weights of two signs, or none";
  need (s <> t) "an edge from a node to itself";
  { head = t; tail = s; bottom; top; mutual = false }
let edge_of family nodes v = match entries "an edge" v with
  | s :: t :: weights ->
      let bottom, top = match List.map (number "a weight") weights with
        | [ w ] -> w, w
        | [ a; b ] when family -> need (Number.compare a b < 0) "an edge: least < largest is due"; a, b
        | _ -> bad "an edge has three entries, or four in a family" in
      edge (node nodes "an edge" s) (node nodes "an edge" t) bottom top
  | _ -> bad "an edge has three entries, or four in a family"
(* those of a fixed graph in side files *)
let edges_beside nodes v =
  let get = fields "edges" [ "count"; "source"; "target"; "weight"; "scale" ] v in
  let count = count_of v in
  let scale = number "scale" (get "scale") in
  need (Z.equal scale.qden Z.one && Z.sign scale.qnum > 0) "edges: the scale is no positive integer";
  let column what = Side.column (get what) count in
  let ends what = match column what with
    | Side.Integers l ->
        let n = Z.of_int (Array.length nodes.labels) in
        List.map (fun z -> need (Z.sign z >= 0 && Z.lt z n) "edges: an unknown node"; Z.to_int z) l
    | _ -> bad "edges: positions are integers" in
  let weights = match column "weight" with
    | Side.Integers l -> List.map Number.of_z l | Side.Floats l -> List.map Side.exactly l in
  List.map2 (fun (s, t) w -> let w = Number.div w scale in edge s t w w) (List.combine (ends "source") (ends "target")) weights
(* whether both directions of edges change together, the edges, and these with one for both directions *)
let mode_of family nodes v =
  let get = if family then fields "a mode" ~may:[ "undirected" ] [ "name"; "edges" ] v else fields "a mode" [ "edges" ] v in
  if family then ignore (text "the name of a mode" (get "name"));
  let paired = match get "undirected" with Null -> false | Bool true -> true | _ -> bad "undirected: true, or absent" in
  let edges = match get "edges" with
    | v when not (beside v) -> map (edge_of family nodes) (entries "edges" v)
    | _ when family -> unsupported "a family with edges in side files"
    | v -> edges_beside nodes v in
  ignore (List.fold_left (fun last e ->
    let at = (e.head, e.tail, sign e) in need (compare last at < 0) "edges are in another order"; at) (-1, -1, 0) edges);
  Number.limited "edges" (List.concat_map (fun e -> if known e then [ e.top ] else [ e.bottom; e.top ]) edges);
  let table = Hashtbl.create 64 in
  List.iter (fun e ->
    let at = (e.head, e.tail) in
    (match Hashtbl.find_opt table at with
     | Some f -> need (may_fail e && may_fail f) "two edges of one pair of nodes, of which one cannot fail" | None -> ());
    Hashtbl.add table at e) edges;
  if paired then List.iter (fun e -> need (List.exists (fun f -> Number.equal f.bottom e.bottom && Number.equal f.top e.top)
    (Hashtbl.find_all table (e.tail, e.head))) "undirected: an edge without its reverse") edges;
  let ties = if paired then List.filter_map (fun e -> if e.tail < e.head then Some { e with mutual = true } else None) edges else edges in
  paired, edges, ties
let hash nodes modes =
  let name i = nodes.labels.(i) and sum = Sha256.start () in
  let feed = Sha256.feed sum in
  let line e =
    feed (Printf.sprintf "[%s, %s, " (line_text (name e.tail)) (line_text (name e.head)));
    if not (known e) then feed (Printf.sprintf "\"%s\", " (Number.text e.bottom));
    feed (Printf.sprintf "\"%s\"]\n" (Number.text e.top)) in
  List.iter (fun s -> feed ("[" ^ line_text s ^ "]\n")) (List.sort compare (Array.to_list nodes.labels));
  List.iteri (fun k (paired, edges, _) ->
    if k > 0 then feed "{}\n";
    if paired && not (List.for_all known edges) then feed "{\"undirected\": true}\n";
    List.iter line (List.sort (fun a b -> compare (name a.tail, name a.head, sign a) (name b.tail, name b.head, sign b)) edges)) modes;
  Sha256.finish sum

let gain v =
  let alike = [ "kind"; "rho1"; "rho2"; "kappa" ] in
  let all get kind = let q k = number ("gain." ^ k) (get k) in kind q, q "rho1", q "rho2", q "kappa" in
  if part "kind" v = Some (Str "sliding-mode") then begin
    let get = fields "gain" ~may:[ "disturbance" ] (alike @ [ "T_r"; "T_s"; "mu1"; "mu2"; "mu3"; "delta" ]) v in
    need (match get "disturbance" with Null | Str _ -> true | _ -> false) "gain.disturbance is not a text";
    all get (fun q -> SlidingMode (q "T_r", q "T_s", q "mu1", q "mu2", q "mu3", q "delta")) end
  else begin
    let get = fields "gain" (alike @ [ "T" ]) v in
    need (get "kind" = Str "nominal") "an unknown kind of gain";
    all get (fun q -> Nominal (q "T")) end
(* nodes, modes, the SHA-256 of both, the gain, and where agents and sliding variables begin *)
let problem family v =
  let due = [ "graph"; "gain" ] @ if family then [ "signal" ] else [] in
  let get = fields "problem" ~may:[ "initial_state"; "sliding_variable" ] due v in
  if family then need (get "signal" = Str "any") "problem.signal: any signal is meant";
  let graph = fields "graph" ([ "nodes"; "modes"; "sha256" ] @ if family then [] else [ "read" ]) (get "graph") in
  if not family then how_read (graph "read");
  let nodes = nodes_of (graph "nodes") and listed = entries "modes" (graph "modes") in
  let count = List.length listed in
  need (count = 1 || family && count > 0 && count <= most_modes) "graph.modes: one of a fixed graph, 1 to 1,000 of a family";
  let modes = map (mode_of family nodes) listed in
  let sha256 = hash nodes modes in
  need (graph "sha256" = Str sha256) "graph: another SHA-256 than that of the modes";
  let (kind, _, _, _) as gain = gain (get "gain") in
  need ((match kind with SlidingMode _ -> true | Nominal _ -> false) = (get "sliding_variable" <> Null))
    "sigma(0) belongs to the sliding-mode protocol, and is part of it";
  nodes, modes, sha256, gain, optional (state nodes) "initial_state" (get "initial_state"),
  Option.value (optional (state nodes) "sliding_variable" (get "sliding_variable")) ~default:[]

let interval what = function
  | Obj l when List.mem_assoc "mid" l ->
      let get = fields what [ "mid"; "radius" ] (Obj l) in
      let mid, radius = number what (get "mid"), number what (get "radius") in
      need (Z.sign radius.qnum > 0) (what ^ ": a radius is not positive"); mid, radius
  | v -> number what v, Number.zero

(* camps of a balanced component, by node into an array *)
let into_camps g own v =
  let camps = List.map (integer "gauge") (entries "gauge" v) in
  need (List.length camps = List.length own && Z.equal (List.hd camps) Z.one) "camps of a component";
  List.iter2 (fun i s -> need (Z.equal (Z.abs s) Z.one) "camps of a component"; g.(i) <- s) own camps
let cycle_of nodes v = Cycle (List.map (fun e -> match positions nodes "negative_cycle" e with
  | [ s; t ] -> (s, t) | _ -> bad "negative_cycle: an edge has two ends") (entries "negative_cycle" v))
(* closed components by camps or negative cycles alone *)
let without_weights nodes listed =
  let g = Array.make (Array.length nodes.labels) Z.zero in
  List.iter (fun (own, balanced, get) -> if balanced then into_camps g own (get "gauge")) listed;
  let all = Array.to_list g in
  List.map (fun (own, balanced, get) ->
    { nodes = own; share = []; null = []; camps = if balanced then Gauge all else cycle_of nodes (get "negative_cycle") }) listed
(* a left null vector as integers, in its own scale, and where it is largest *)
let stated number own eta =
  let d = List.fold_left (fun d ((x : q), _) -> Z.lcm d x.qden) Z.one eta in
  let whole = List.map (fun ((x : q), _) -> Z.mul x.qnum (Z.divexact d x.qden)) eta in
  let entries = List.map2 (fun i z -> i, z) own whole in
  let fixed, _ = List.fold_left (fun (i, a) (j, b) -> if Z.gt (Z.abs b) (Z.abs a) then j, b else i, a) (List.hd entries) entries in
  { which = number; vector_of = entries; fixed }
(* the closed components of a large form, without weights; the left null vectors of groups, which the check does not believe *)
let large_components nodes listed vectors =
  let groups = List.filter (fun (own, balanced, _) -> balanced && List.length own > 1) listed in
  let vectors = entries "influence.components" vectors in
  need (List.length vectors = List.length groups) "influence.components: one for each balanced group";
  let vectors = List.map2 (fun (own, _, _) v ->
    let one = fields "a component of influence" [ "nodes"; "left_null_vector" ] v in
    need (positions nodes "influence" (one "nodes") = own) "influence: another component";
    let eta = List.map (interval "left_null_vector") (entries "left_null_vector" (one "left_null_vector")) in
    need (List.length eta = List.length own) "left_null_vector: a number for each node"; own, eta) groups vectors in
  without_weights nodes listed,
  List.concat (List.mapi (fun k (own, _, _) ->
    match List.assoc_opt own vectors with Some eta -> [ stated k own eta ] | None -> []) listed)
(* closed components as they are listed, and the followers *)
let listed_components nodes v =
  let structure = fields "structure" [ "connectivity"; "closed_components"; "leaders"; "followers"; "balanced"; "sign_symmetric" ] v in
  let n = Array.length nodes.labels in
  let listed = List.map (fun item ->
    let get = match item with
      | Obj l when List.assoc_opt "balanced" l = Some (Bool true) -> fields "a closed component" [ "nodes"; "balanced"; "gauge" ] item
      | _ -> fields "a closed component" [ "nodes"; "balanced"; "negative_cycle" ] item in
    let own = positions nodes "a closed component" (get "nodes") in
    need (own <> [] && List.sort_uniq compare own = own) "nodes of a closed component are not in order";
    own, truth "balanced" (get "balanced"), get) (entries "closed_components" (structure "closed_components")) in
  let firsts = List.map (fun (own, _, _) -> List.hd own) listed in
  need (List.sort_uniq compare firsts = firsts) "closed components are in another order";
  let leading = List.concat_map (fun (own, _, _) -> own) listed in
  let is_leader = Array.make n false in
  List.iter (fun i -> need (not is_leader.(i)) "a node in two closed components"; is_leader.(i) <- true) leading;
  let followers = List.filter (fun i -> not is_leader.(i)) (List.init n Fun.id) in
  need (positions nodes "leaders" (structure "leaders") = leading) "other leaders";
  need (positions nodes "followers" (structure "followers") = followers) "other followers";
  structure, listed, followers
(* closed components with their witnesses, and what influence says of the balanced ones *)
let components nodes listed followers influence =
  let n = Array.length nodes.labels in
  let get = fields "influence" ~may:[ "containment_weights"; "degenerate" ] [ "components" ] influence in
  if get "containment_weights" = Null then
    let comps, lefts = large_components nodes listed (get "components") in comps, lefts, get "degenerate", true
  else
  let () = Number.few_rows "containment_weights, in a certificate" n in
  let balanced = List.length (List.filter (fun (_, b, _) -> b) listed) in
  let rows = ordered (List.map (fun i -> nodes.labels.(i)) followers) "containment_weights" (get "containment_weights") in
  let rows = List.map2 (fun i row ->
    let ws = List.map (number "containment_weights") (entries "containment_weights" row) in
    need (List.length ws = balanced) "containment_weights: a number for each balanced component"; i, ws) followers rows in
  let vectors = entries "influence.components" (get "components") in
  need (List.length vectors = balanced) "influence.components: one for each balanced component";
  let k = ref (-1) in
  let comps = List.map (fun (own, is_balanced, get) ->
    if is_balanced then begin
      incr k;
      let g = Array.make n Z.zero and w = Array.make n Number.zero and v = Array.make n Number.zero in
      into_camps g own (get "gauge");
      List.iter (fun i -> w.(i) <- Number.of_z g.(i)) own;
      List.iter (fun (i, ws) -> w.(i) <- List.nth ws !k) rows;
      let one = fields "a component of influence" [ "nodes"; "left_null_vector" ] (List.nth vectors !k) in
      need (positions nodes "influence" (one "nodes") = own) "influence: another component";
      let eta = entries "left_null_vector" (one "left_null_vector") in
      need (List.length eta = List.length own) "left_null_vector: a number for each node";
      List.iter2 (fun i x -> v.(i) <- number "left_null_vector" x) own eta;
      { nodes = own; camps = Gauge (Array.to_list g); share = Array.to_list w; null = Array.to_list v } end
    else
      { nodes = own; share = []; null = []; camps = cycle_of nodes (get "negative_cycle") }) listed in
  comps, [], get "degenerate", false

(* a Lyapunov matrix on all nodes, 0 elsewhere; the weights of a diagonal one *)
let matrix nodes what own rows =
  let n = Array.length nodes.labels in
  Number.few_rows what n;
  let m = Array.make_matrix n n Number.zero in
  List.iteri (fun a row ->
    let row = List.map (number what) (entries what row) in
    Number.limited what ~entries:(n * n) row;
    need (List.length row = a + 1) (what ^ ": the rows of a lower triangle");
    List.iteri (fun b x -> let i = own.(a) and j = own.(b) in m.(i).(j) <- x; m.(j).(i) <- x) row) rows;
  need (List.length rows = Array.length own) (what ^ ": the rows of a lower triangle");
  let m = Array.to_list (Array.map Array.to_list m) in
  Number.limited what (List.concat m); m
let diagonal_matrix nodes weights =
  let n = Array.length nodes.labels in
  Number.few_rows "a dense matrix" n; Number.limited "diagonal" ~entries:(n * n) (List.map snd weights);
  let m = Array.make_matrix n n Number.zero in
  List.iter (fun (i, w) -> m.(i).(i) <- w) weights;
  Array.to_list (Array.map Array.to_list m)
let ends weights = match weights with
  | [] -> bad "a Lyapunov function of no nodes"
  | (_, w) :: l -> List.fold_left (fun (a, b) (_, x) ->
      (if Number.compare x a < 0 then x else a), (if Number.compare x b > 0 then x else b)) (w, w) l

let block nodes listening shape v =
  let get = fields "a block" [ "name"; "nodes"; shape; "times_rho" ] v in
  let own = positions nodes "nodes of a block" (get "nodes") in
  need (List.sort_uniq compare own |> List.length = List.length own) "nodes of a block: one occurs twice";
  need (List.sort compare own = listening) "nodes of a block: not those that listen to somebody";
  text "name" (get "name"), own, get shape, truth "times_rho" (get "times_rho")
(* weights of a large form, 0 of nodes that listen to nobody; the vector of its rows, and the rates of leader groups *)
let dominance nodes comps facts edges_in proof of_ rate v =
  let name, own, d, times_rho = v in
  need (name = "P" && not times_rho) "another block";
  let from_document, witness = proved proof "dominance" of_ [ "b" ] in
  need (Number.equal (from_document "b") rate) (of_ ^ ": b is not the rate");
  let get = fields "the witness" [ "vector"; "groups" ] witness in
  let by_node what v =
    let a = Array.make (Array.length nodes.labels) Number.zero in
    List.iter2 (fun i x -> need (Z.sign x.qnum > 0) (what ^ " is not positive"); a.(i) <- x) own (numbers what (List.length own) v); a in
  let weights = by_node "diagonal" d and vector = by_node "vector" (get "vector") in
  let rest = ref (entries "groups" (get "groups")) in
  let alone = List.mapi (fun k (one : comp) -> match one.nodes, !rest with
    | [ _ ], _ -> Number.zero
    | _, [] -> bad "groups: one for each leader group"
    | own, (Obj _ as g) :: l ->
        rest := l;
        let get = fields "a leader group" [ "rate"; "factor" ] g in
        let g = number "groups" (get "rate") in
        let ratios = Factors.ratios weights own in
        need (not (List.exists (Factors.same k g ratios) !facts)) "a factor of a leader group that is proved already";
        facts := !facts @ [ Factors.of_group (edges_in k) k one weights g (get "factor") ]; g
    | own, g :: l ->
        rest := l;
        let g = number "groups" g in
        need (List.length own <= Factors.largest_dense || List.exists (Factors.same k g (Factors.ratios weights own)) !facts)
          (Printf.sprintf "a leader group of more than %d nodes is not proved" Factors.largest_dense);
        g) comps in
  need (!rest = []) "groups: one for each leader group";
  List.map (fun i -> i, weights.(i)) own, Array.to_list weights, (Array.to_list vector, alone)
let function_ nodes listening comps vectors facts edges_in proof gauge paper number_of v =
  let of_ = Printf.sprintf "decays[%d]" number_of in
  let get = fields "a Lyapunov function" ~may:[ "rho"; "deviation" ] [ "class"; "coordinates"; "blocks"; "rate"; "overshoot" ] v in
  let rate = number "rate" (get "rate") and overshoot = number "overshoot" (get "overshoot") in
  let ly, diagonal, lowest, highest = match paper with
    | Some (p : Paper.t) when p.own_rate <> None && number_of = 0 ->
        need (get "class" = Str "paper") "the first Lyapunov function is not the paper's";
        List.iter (fun k -> need (get k = p.section k) "the first Lyapunov function is not the paper's")
          [ "coordinates"; "blocks"; "rho"; "rate"; "overshoot" ];
        let lo, hi = ends p.weights in
        (if p.coordinates = "E" then InE (diagonal_matrix nodes p.weights)
         else
           let n = Array.length nodes.labels in
           let d = Array.make n Number.zero in
           List.iter (fun (i, w) -> d.(i) <- w) p.weights;
           InEps (Array.to_list d, gauge ())), false, lo, hi
    | _ ->
        need (get "coordinates" = Str "E" && get "rho" = Null) "other coordinates, or a rho";
        let one = match entries "blocks" (get "blocks") with [ b ] -> b | _ -> bad "blocks: one is due" in
        (match text "class" (get "class") with
         | "full" ->
             let name, own, rows, times_rho = block nodes listening "lower_triangle" one in
             need (name = "P" && not times_rho) "another block";
             if following proof <> "rate" then bad (of_ ^ ": its rate is not proved");
             need (Number.equal (bare proof "rate" of_ [ "b" ] "b") rate) (of_ ^ ": b is not the rate");
             let e = bare proof "overshoot" of_ [ "lowest"; "highest" ] in
             said proof "lowest I <= P <= highest I, on agents that listen";
             InE (matrix nodes "lower_triangle" (Array.of_list own) (entries "lower_triangle" rows)), false, e "lowest", e "highest"
         | "perron" | "lmi" ->
             if following proof = "dominance" then begin
               let weights, ly, vector = dominance nodes comps facts edges_in proof of_ rate (block nodes listening "diagonal" one) in
               vectors := vector :: !vectors;
               let lo, hi = ends weights in
               Weighted ly, true, lo, hi end
             else
             let name, own, d, times_rho = block nodes listening "diagonal" one in
             need (name = "P" && not times_rho) "another block";
             let d = List.map (number "diagonal") (entries "diagonal" d) in
             need (List.length d = List.length own) "diagonal: a number for each node";
             let weights = List.combine own d in
             need (Number.equal (bare proof "rate" of_ [ "b" ] "b") rate) (of_ ^ ": b is not the rate");
             let lo, hi = ends weights in
             InE (diagonal_matrix nodes weights), true, lo, hi
         | _ -> bad "an unknown class") in
  let deviation = match get "deviation" with
    | Null -> None
    | d ->
        let d = fields "deviation" [ "agents"; "norm" ] d in
        bare_of proof "deviation" of_;
        Some (number "deviation.norm" (d "norm"), by_agent nodes number "deviation.agents" (d "agents")) in
  { ly; diagonal; rate; lowest; highest; overshoot; deviation; constants = None }

(* reaching times that the panels of the check can place; of many agents, of instants near 0 or far away none *)
let most_instants = 100
let reaching_times nodes proof kind kappa sliding v not_checked = match kind with
| Nominal _ -> need (v = Null) "reaching times without sliding variables"; []
| SlidingMode (t_r, _, _, mu2, mu3, _) ->
  let get = fields "reaching_time" [ "bound"; "clock"; "z" ] v in
  need (get "bound" = Str Texts.sliding_bound && get "clock" = Str Texts.sliding_clock) "reaching_time: another bound or clock";
  bare_of proof "sliding-bound" "gain";
  let z = by_agent nodes (optional number) "reaching_time.z" (get "z") in
  let both = List.combine sliding z in
  let at_0 s = Number.equal s Number.zero in
  List.iter (function
    | s, Some z -> need (Number.compare z Number.zero >= 0 && at_0 s = at_0 z) "reaching_time.z: not of such a variable"
    | _, None -> ()) both;
  let moving = List.filter_map (fun (s, z) -> if at_0 s then None else z) both in
  let push = Number.add (Number.mul t_r mu2) (Number.mul mu3 kappa) in
  let whole k = Number.of_z (Z.of_int k) in
  let near z = Number.compare z (whole 25) <= 0 && Number.compare (Number.mul z (whole (1 lsl 30))) Number.one >= 0 in
  if moving = [] then z
  else if List.length moving <= most_instants && Number.compare push (whole 100) <= 0 && List.for_all near moving then
    (bare_of proof "reaching-time" "reaching_time"; z)
  else (skipped proof "reaching-time" "reaching_time"; not_checked "reaching_time.z"; [])

(* some function tells that a state at which nothing moves is one at which agents end *)
let has_kernel = List.exists (fun f -> f.deviation <> None && (match f.ly with InE _ -> true | InEps _ | Weighted _ -> false))
(* the upper bound on the rate: of two vectors, the combination that the left null vector annihilates *)
let upper nodes comps proof bound =
  let numbers, witness = proved proof "rate-upper-bound" "rates" [ "upper_bound" ] in
  need (Number.equal (numbers "upper_bound") bound) "rate-upper-bound: another upper bound";
  let get = fields "the witness" [ "nodes"; "lower_triangle"; "vectors" ] witness in
  let inside = positions nodes "nodes" (get "nodes") in
  need (inside <> [] && List.sort_uniq compare inside = inside) "rate-upper-bound: nodes are in another order";
  let vector v =
    let own = List.map (number "a vector") (entries "a vector" v) in
    need (List.length own = List.length inside) "a vector: a number for each node";
    List.init (Array.length nodes.labels) (fun i -> Option.value (List.assoc_opt i (List.combine inside own)) ~default:Number.zero) in
  let dot = List.fold_left2 (fun a x y -> Number.add a (Number.mul x y)) Number.zero in
  let null = List.find_map (fun (one : comp) ->
    if is_balanced one && List.mem (List.hd one.nodes) inside then Some one.null else None) comps in
  let vector_y = match List.map vector (entries "vectors" (get "vectors")), null with
    | [ y ], None -> y
    | [ y; z ], Some v ->
        let a = dot v y and b = dot v z in
        if Z.sign a.qnum = 0 then y else List.map2 (fun y z -> Number.sub (Number.mul b y) (Number.mul a z)) y z
    | _ -> bad "rate-upper-bound: two vectors iff the component is closed and balanced" in
  let form = matrix nodes "lower_triangle" (Array.of_list inside) (entries "lower_triangle" (get "lower_triangle")) in
  { bound; inside; because = ByForm (form, vector_y) }
(* the same by the trace of a strong component, named by its first node *)
let mean nodes all proof bound =
  let numbers, witness = proved proof "rate-mean" "rates" [ "upper_bound" ] in
  said proof "upper_bound >= 2 trace(A)/r, which no form exceeds";
  need (Number.equal (numbers "upper_bound") bound) "rate-mean: another upper bound";
  let first = node nodes "rate-mean" ((fields "the witness" [ "node" ] witness) "node") in
  let inside = Pieces.strong_component all first in
  need (List.hd inside = first) "rate-mean: not the first node of its component";
  { bound; inside; because = ByTrace }

(* the edges into each closed component, by its number *)
let edges_into nodes comps edges =
  let k = Array.make (Array.length nodes.labels) (-1) and into = Array.make (List.length comps) [] in
  List.iteri (fun number (one : comp) -> List.iter (fun i -> k.(i) <- number) one.nodes) comps;
  List.iter (fun e -> let c = k.(e.tgt) in if c >= 0 then into.(c) <- e :: into.(c)) edges;
  fun number -> into.(number)

let certificate (j : Json.t) : t =
  refuse_formation j;
  let of_agents = part "agents" j <> None in
  let also = [ ("phases", "faster decrease nearer to the deadline"); ("instants", "Lyapunov functions on the way") ] in
  let may = [ "claim"; "components"; "paper"; "overshoot"; "influence"; "final_state"; "reaching_time"; "input"; "messages"; "agents" ] in
  let get = opened ~may:(may @ if of_agents then List.map fst also else []) [ "rates" ] j in
  let left_out = ref [] in
  let not_checked s = left_out := s :: !left_out in
  let of_messages = set_apart get not_checked [ messages ] in
  ignore (set_apart get not_checked also : bool);
  let nodes, modes, sha256, (kind, rho1, rho2, kappa), start, sliding = problem false (get "problem") in
  let edges = List.concat_map (fun (_, edges, _) -> map (fun e -> { tgt = e.head; src = e.tail; wt = e.top }) edges) modes in
  let is_sliding = match kind with SlidingMode _ -> true | Nominal _ -> false in
  let proof = proof_of (get "proof") in
  bare_of proof "structure" "graph.modes[0]";
  bare_of proof "claim" "graph";
  if get "influence" = Null then unsupported "an undecided certificate, without influence";
  let structure, listed, followers = match entries "structure" (get "structure") with
    | [ v ] -> listed_components nodes v | _ -> bad "structure: one of a fixed graph" in
  let comps, lefts, degenerate, enclosed = components nodes listed followers (get "influence") in
  let n = Array.length nodes.labels in
  if not enclosed then begin
    Number.limited "edges" ~entries:(n * n) (List.map (fun e -> e.wt) edges);
    List.iter (fun get -> Number.limited "influence" ~entries:(n * List.length comps) (List.concat_map get comps))
      [ (fun (one : comp) -> one.share); (fun one -> one.null) ] end;
  let all, all_balanced, pieces = Pieces.whole n edges comps structure in
  let final_beside = Option.fold ~none:false ~some:beside (part "mid" (get "final_state")) in
  let final_text = match get "final_state" with Obj l when not final_beside && List.length l = Array.length nodes.labels -> Obj l | _ -> Null in
  let theorem = Pieces.compare_claims nodes is_sliding pieces (get "claim") (get "components") final_text in
  let final = match start, get "final_state" with
    | None, Null -> []
    | Some _, v when final_beside ->
        let get = fields "final_state" [ "mid"; "radius" ] v in
        let column k = need (beside (get k)) ("final_state: " ^ k ^ " is no side vector"); state nodes ("final_state." ^ k) (get k) in
        List.map2 (fun x r -> need (Z.sign r.qnum >= 0) "final_state: a radius is negative"; x, r) (column "mid") (column "radius")
    | Some _, v -> by_agent nodes interval "final_state" v
    | None, _ -> bad "a final state without an initial state" in
  Number.limited "the initial state" (Option.value start ~default:[] @ sliding);
  Number.limited "the final state" (List.concat_map (fun (x, r) -> [ x; r ]) final);
  let degenerate = match start, degenerate with
    | None, v -> need (v = Null) "influence.degenerate without an initial state"; None
    | Some _, v when enclosed -> ignore (entries "degenerate" v); not_checked "influence.degenerate"; None
    | Some _, v ->
        let numbers = List.map (fun v -> let z = integer "degenerate" v in
          need (Z.sign z > 0 && Z.leq z (Z.of_int (List.length comps))) "degenerate: no closed component has this number";
          Z.to_int z) (entries "degenerate" v) in
        need (List.sort_uniq compare numbers = numbers) "degenerate: numbers are not in order"; Some numbers in
  let unproved = enclosed && (start = None || (following_witness proof = Null && followers <> [])) in
  if unproved && start <> None then not_checked "final_state";
  let around, final =
    if unproved then (skipped proof "final-state" "graph"; [], [])
    else match proved proof "final-state" "graph" [] with
      | _, Null -> [], final
      | _ when not enclosed -> unsupported "a final state that is enclosed by a witness"
      | _, w -> state nodes "the witness u" ((fields "the witness" [ "u" ] w) "u"), final in
  if lefts <> [] then not_checked "influence.components";
  let closed = List.mapi (fun k (one : Checker.comp) -> k + 1, one.nodes, is_balanced one) comps in
  let setting = { Paper.n = Array.length nodes.labels; edges; closed; followers; theorem } in
  let paper = optional (fun _ v -> Paper.read setting nodes proof v) "paper" (get "paper") in
  (match paper with Some { Paper.any_rho = true; _ } -> not_checked "paper.rho_interval, that every rho is admissible" | _ -> ());
  let gauge () = match comps with [ { camps = Gauge g; _ } ] -> g | _ -> bad "coordinates eps of another graph" in
  let is_target = Array.make (Array.length nodes.labels) false in
  List.iter (fun e -> is_target.(e.tgt) <- true) edges;
  let listening = List.filter (fun i -> is_target.(i)) (List.init (Array.length nodes.labels) Fun.id) in
  let listed = entries "decays" (get "decays") in
  let vectors = ref [] and facts = ref [] in
  let functions = List.mapi (function_ nodes listening comps vectors facts (edges_into nodes comps edges) proof gauge paper) listed in
  let is_weighted f = match f.ly with Weighted _ -> true | _ -> false in
  let own_rate = Option.bind paper (fun (p : Paper.t) -> p.own_rate) in
  if enclosed && not (own_rate = None && List.for_all is_weighted functions) then unsupported "a large form with dense matrices";
  if not enclosed && List.exists is_weighted functions then unsupported "dominance with weights of followers";
  let rates = fields "rates" ~may:[ "paper"; "diagonal"; "proved"; "upper_bound" ] [] (get "rates") in
  let rate k = optional number ("rates." ^ k) (rates k) in
  (match rate "paper", own_rate with
   | None, None -> () | Some a, Some b when Number.equal a b -> () | _ -> bad "rates.paper is not that of the paper's function");
  let best_overshoot = match get "overshoot" with
    | Null -> None
    | v -> let o = fields "overshoot" [ "value"; "of" ] v in
        let of_ = text "overshoot.of" (o "of") in
        let value = number "overshoot.value" (o "value") in
        need (List.exists (fun f -> (match rate "proved" with Some r -> Number.equal f.rate r | None -> false)
          && Number.equal f.overshoot value && of_ = (match f.ly with InE _ | Weighted _ -> "||E||^2" | InEps _ -> "||eps||^2")) functions)
          "overshoot.of: other coordinates than those of a Lyapunov function with the largest rate";
        Some value in
  let upper_bound = match rate "upper_bound" with
    | None -> None
    | Some bound when following proof = "rate-upper-bound" && has_kernel functions ->
        Some (upper nodes comps proof bound)
    | Some bound when following proof = "rate-mean" && has_kernel functions -> Some (mean nodes all proof bound)
    | Some _ ->
        skipped proof (if following proof = "rate-mean" then "rate-mean" else "rate-upper-bound") "rates";
        not_checked "rates.upper_bound, input.threshold.upper"; None in
  let reaching = reaching_times nodes proof kind kappa sliding (get "reaching_time") not_checked in
  let full k = part "class" (List.nth listed k) = Some (Str "full") in
  let bounded_input, sliding_input, functions, efforts, start_box = match get "input" with
    | Null ->
        need (of_agents || rate "proved" = None && edges <> []) "there is no input, though a decay was proved, or nothing moves";
        false, [], functions, [], None
    | v ->
        let input = fields "input" ~may:[ "bounded"; "initial_set"; "peak"; "energy"; "path_length"; "sliding"; "disturbed" ]
          [ "threshold"; "constants"; "residual" ] v in
        let threshold = fields "threshold" ~may:[ "lower"; "upper" ] [] (input "threshold") in
        List.iter (fun (key, of_) ->
          let half = Number.div (Number.mul rho2 kappa) (Number.of_z (Z.of_int 2)) in
          match optional number "threshold" (threshold key), rate of_ with
          | None, None -> ()
          | Some a, Some r when Number.equal a (Number.mul half r) -> ()
          | _ -> bad "input.threshold: not what the rates say") [ ("lower", "proved"); ("upper", "upper_bound") ];
        let bounded = match input "bounded" with
          | Null -> false
          | b when following proof = "input-threshold" ->
              let stays = truth "input.bounded" b in
              if stays && following_witness proof = Str "rate" then (ignore (proved proof "input-threshold" "input" []); true)
              else (skipped proof "input-threshold" "input"; not_checked "input.bounded"; false)
          | _ -> bad "input.bounded without a proof" in
        let constants = entries "constants" (input "constants") in
        need (List.length constants = List.length functions) "constants: one for each Lyapunov function";
        let functions = List.mapi (fun k (f, v) -> match v with
          | Null -> f
          | v ->
              need (full k) "constants: of a Lyapunov function that is not full";
              bare_of proof "input-constants" (Printf.sprintf "decays[%d]" k);
              { f with constants = Some (by_agent nodes number "constants" v) }) (List.combine functions constants) in
        let there v = v <> Null in
        let sliding_input = match input "sliding", kind with
          | Null, Nominal _ -> []
          | v, SlidingMode (_, _, _, _, mu3, _) ->
              let told = fields "input.sliding" ~may:[ "agents" ] [ "bounded" ] v in
              need (truth "input.sliding.bounded" (told "bounded") = (Number.compare (Number.mul mu3 kappa) (Number.of_z Z.one) >= 0))
                "input.sliding: bounded for every initial state iff mu3 kappa >= 1";
              if not (there (told "agents")) then []
              else (bare_of proof "input-sliding" "input"; by_agent nodes number "input.sliding.agents" (told "agents"))
          | _ -> bad "input.sliding of the nominal protocol" in
        let start_box = match input "initial_set" with
          | Obj l as v when List.mem_assoc "radius" l ->
              let set = fields "initial_set" [ "center"; "radius" ] v in
              let radii = by_agent nodes number "radius" (set "radius") in
              need (List.for_all (fun r -> Z.sign r.qnum >= 0) radii) "radius: a number is negative";
              Some (by_agent nodes number "center" (set "center"), radii)
          | _ -> None in
        let read_set = match start_box with
          | Some _ -> List.for_all (Number.equal Number.zero) sliding
          | None -> not (there (input "initial_set")) && start <> None in
        let begins =
          if enclosed || not read_set then Effort.Unread
          else match kind with
            | Nominal t -> Effort.At_rest (Number.add (Number.mul rho1 t) (Number.mul rho2 kappa))
            | SlidingMode (t_r, t_s, _, _, _, _) when List.for_all (Number.equal Number.zero) sliding ->
                Effort.At_rest (Number.add (Number.mul rho1 (Number.add t_r t_s)) (Number.mul rho2 kappa))
            | SlidingMode (t_r, t_s, _, mu2, mu3, _) ->
                Effort.Moving (fun z -> reaching <> [] && instants t_r t_s mu2 (Number.mul mu3 kappa) z 16 <> None) in
        let triangle what v = matrix nodes what (Array.of_list listening) (entries what v) in
        let efforts, left = Effort.read proof nodes functions triangle begins input in
        List.iteri (fun i _ -> skipped proof "limited-gain" (Printf.sprintf "input.residual[%d]" i))
          (entries "residual" (input "residual"));
        if there (input "disturbed") then skipped proof "nominal-disturbed" "input";
        let left = List.filter (fun key -> (match begins with Effort.Unread -> true | _ -> false) && there (input key)) [ "initial_set" ] @ left
          @ (if is_sliding then [ "sliding.bounded" ] else []) @ (if input "residual" <> Arr [] then [ "residual" ] else [])
          @ List.filter (fun key -> there (input key)) [ "disturbed" ] in
        List.iter (fun key -> not_checked ("input." ^ key)) left;
        bounded, sliding_input, functions, efforts, (if efforts = [] then None else start_box) in
  (* of agents of order n: [Agents] reads them *)
  if not of_agents then others proof (fun kind -> of_messages && String.starts_with ~prefix:"late-" kind);
  let verdict = text "verdict" (get "verdict") in
  let certified = if of_agents then verdict = "certified" else rate "proved" <> None || edges = [] in
  need (verdict = (if certified then "certified" else "undecided")) "what was proved makes another verdict";
  if not certified then unsupported "an undecided certificate";
  { nodes; rest = proof.rest; full; hints = { vectors = List.rev !vectors; facts = !facts; lefts; around }; sha256; theorem; checked = List.rev proof.checked; unchecked = List.rev proof.unchecked;
    sections = List.rev !left_out;
    cert = { order = Array.length nodes.labels; edges; kind; rho1; rho2; kappa; comps; pieces; all_balanced;
      sign_symmetric = Pieces.sign_symmetric all; funcs = functions;
      start = Option.value start ~default:[]; sliding; final; enclosed; reaching; sliding_input; efforts;
      margins = (match paper with Some p -> p.inequalities | None -> []);
      leaders = (match paper with Some p -> p.groups | None -> []);
      upper_bound;
      proved = rate "proved"; best_diagonal = rate "diagonal"; best_overshoot; bounded_input; degenerate; start_box } }
