(* Weak components, and what sections 6 and 7 of FORMAT.md say of them: found here from the edges, compared with the
   document, and handed to the check, which believes none of it. *)
open Checker
open Json
open Document

type graph = { n : int; edges : edge list; beside : edge list array }
let graph n edges =
  let beside = Array.make n [] in
  List.iter (fun e -> beside.(e.src) <- e :: beside.(e.src); beside.(e.tgt) <- e :: beside.(e.tgt)) edges;
  { n; edges; beside }

(* the nodes linked to one, with camps that fit the edges of a tree, and the way back to it along the tree *)
let spread g root camps back =
  let found = ref [ root ] and queue = Queue.create () in
  camps.(root) <- 1; Queue.add root queue;
  while not (Queue.is_empty queue) do
    let i = Queue.pop queue in
    List.iter (fun e ->
      let j = if e.src = i then e.tgt else e.src in
      if camps.(j) = 0 then begin
        camps.(j) <- camps.(i) * Number.Z.sign e.wt.qnum; back.(j) <- (e.src, e.tgt) :: back.(i);
        found := j :: !found; Queue.add j queue end) g.beside.(i)
  done;
  List.sort compare !found
let inside n own = let m = Array.make n false in List.iter (fun i -> m.(i) <- true) own; fun i -> m.(i)

type found = { pieces : (int list * balance) list; balance : balance }
(* camps of nodes, 0 elsewhere; or a closed walk whose signs multiply to -1 *)
let balance g camps back own =
  let odd = List.find_opt (fun e -> own e.src && camps.(e.src) * camps.(e.tgt) * Number.Z.sign e.wt.qnum < 0) g.edges in
  match odd with
  | Some e -> Cycle (List.rev back.(e.src) @ ((e.src, e.tgt) :: back.(e.tgt)))
  | None -> Gauge (List.init g.n (fun i -> Number.Z.of_int (if own i then camps.(i) else 0)))
(* camps of all nodes are listed for each weak component, and all edges are gone through: so many at most *)
let most_camps = 20_000_000 and most_edges = 1_000_000_000
let find g =
  let camps = Array.make g.n 0 and back = Array.make g.n [] in
  let groups = List.filter_map (fun i -> if camps.(i) = 0 then Some (spread g i camps back) else None) (List.init g.n Fun.id) in
  let count = List.length groups in
  if count > most_camps / g.n || count > most_edges / (1 + List.length g.edges) then
    unsupported (Printf.sprintf "%d weak components of %d nodes" count g.n);
  { pieces = List.map (fun own -> own, balance g camps back (inside g.n own)) groups; balance = balance g camps back (fun _ -> true) }

let strong_component g i =
  let reached next =
    let seen = Array.make g.n false in
    let rec go i = if not seen.(i) then begin seen.(i) <- true; List.iter (fun e -> match next i e with Some j -> go j | None -> ()) g.beside.(i) end in
    go i; seen in
  let there = reached (fun i e -> if e.src = i then Some e.tgt else None)
  and back = reached (fun i e -> if e.tgt = i then Some e.src else None) in
  List.filter (fun j -> there.(j) && back.(j)) (List.init g.n Fun.id)

let twin e f = f.src = e.tgt && f.tgt = e.src
let undirected g own = List.for_all (fun e -> not (own e.tgt)
  || List.exists (fun f -> twin e f && Number.equal f.wt e.wt) g.beside.(e.tgt)) g.edges
let cooperative g own = List.for_all (fun e -> not (own e.tgt) || Number.Z.sign e.wt.qnum > 0) g.edges
let sign_symmetric g = List.for_all (fun e -> List.for_all (fun f -> not (twin e f)
  || Number.Z.sign e.wt.qnum * Number.Z.sign f.wt.qnum > 0) g.beside.(e.tgt)) g.edges

(* the record of a weak component with these closed ones *)
let piece g (comps : comp list) (members, whole) =
  let here = inside g.n members in
  let own = List.filter (fun (one : comp) -> here (List.hd one.nodes)) comps in
  let row = match own with [ one ] -> if List.length one.nodes = List.length members then 1 else 2 | _ -> 3 in
  let some_balanced = List.exists is_balanced own in
  { members; row; some_balanced; undirected = undirected g here; cooperative = cooperative g here; whole }

let connectivity (p : piece) = List.nth [ "strong"; "quasi-strong"; "weak" ] (p.row - 1)
let theorem is_sliding (p : piece) =
  Printf.sprintf "%d.%d" (p.row + if is_sliding then 3 else 0) (if p.some_balanced then 1 else 2)
let behaviour (p : piece) =
  if not p.some_balanced then "stability"
  else List.nth [ "bipartite consensus"; "interval bipartite consensus"; "bipartite containment" ] (p.row - 1)
let corollaries is_sliding (p : piece) =
  let fits = match p.whole with Gauge _ -> true | Cycle _ -> false in
  List.filter_map (fun (holds, nominal, sliding) -> if holds then Some (if is_sliding then sliding else nominal) else None)
    [ p.row = 1 && p.some_balanced && p.undirected, "1.1", "6.1";
      p.row = 1 && not p.some_balanced && p.undirected, "1.2", "6.2";
      p.row = 1 && p.some_balanced && p.cooperative, "2", "7";
      p.row = 2 && p.some_balanced && fits, "3", "8";
      p.row = 2 && p.some_balanced && p.cooperative, "4", "9";
      p.row = 3 && p.some_balanced && p.cooperative, "5", "10" ]
(* what a structure says of the whole graph, with these closed components: the graph, its balance, its weak components *)
let whole n edges comps structure =
  let all = graph n edges in
  let found = find all in
  let pieces = List.map (piece all comps) found.pieces in
  let kind = match pieces with [ p ] -> connectivity p | _ -> "disconnected" in
  need (structure "connectivity" = Str kind) ("structure: the graph is " ^ kind);
  need (structure "balanced" = Bool (match found.balance with Gauge _ -> true | Cycle _ -> false)) "structure: balance of the graph";
  need (structure "sign_symmetric" = Bool (sign_symmetric all)) "structure: sign symmetry";
  all, found.balance, pieces
let claim is_sliding p v =
  let get = fields "claim" [ "theorem"; "behaviour"; "corollaries" ] v in
  need (get "theorem" = Str (theorem is_sliding p)) ("claim: the theorem is " ^ theorem is_sliding p);
  need (get "behaviour" = Str (behaviour p)) ("claim: the behaviour is " ^ behaviour p);
  need (get "corollaries" = Arr (List.map (fun s -> Str s) (corollaries is_sliding p))) "claim: other corollaries"

(* the final states of some nodes, as the document has them *)
let part members = function Obj l -> let a = Array.of_list l in Obj (List.map (fun i -> a.(i)) members) | _ -> Null
(* more weak components than this stand in arrays, one for each key *)
let in_objects = 100
let compare_arrays nodes is_sliding pieces v =
  let get = fields "components" [ "nodes"; "connectivity"; "theorem"; "behaviour"; "corollaries" ] v in
  let each key one = need (get key = Arr (List.map one pieces)) ("components: another " ^ key) in
  (match get "nodes" with
   | Arr l -> need (List.length l = List.length pieces && List.for_all2 (fun v (p : piece) ->
       (match v with Arr _ -> positions nodes "a component" v = p.members | _ -> false)) l pieces) "components: other nodes"
   | v ->
       let own = Array.make (Array.length nodes.labels) (-1) in
       List.iteri (fun k (p : piece) -> List.iter (fun i -> own.(i) <- k) p.members) pieces;
       let listed = Side.integers "components.nodes" (Array.length own) v in
       need (List.for_all2 (fun z k -> Number.Z.equal z (Number.Z.of_int k)) listed (Array.to_list own)) "components: other nodes");
  each "connectivity" (fun p -> Str (connectivity p));
  each "theorem" (fun p -> Str (theorem is_sliding p));
  each "behaviour" (fun p -> Str (behaviour p));
  each "corollaries" (fun p -> Arr (List.map (fun s -> Str s) (corollaries is_sliding p)))
let compare_objects nodes is_sliding pieces final listed =
  need (List.length listed = List.length pieces) "components: one for each weak component";
  List.iter2 (fun v p ->
    let get = fields "a component" ~may:[ "final_state" ] [ "nodes"; "connectivity"; "claim" ] v in
    need (positions nodes "a component" (get "nodes") = p.members) "components: other nodes";
    need (get "connectivity" = Str (connectivity p)) "components: another connectivity";
    claim is_sliding p (get "claim");
    need (get "final_state" = part p.members final) "components: other final states than in final_state") listed pieces
(* compares the claims of the document; returns the theorem whose row is used *)
let compare_claims nodes is_sliding pieces claim_of components final =
  match pieces with
  | [ p ] ->
      need (components = Null) "components of a connected graph";
      claim is_sliding p claim_of; theorem is_sliding p
  | _ ->
      need (claim_of = Null) "claim: the graph is disconnected";
      (match components with
       | Arr l when List.length pieces <= in_objects -> compare_objects nodes is_sliding pieces final l
       | Obj _ as v when List.length pieces > in_objects -> compare_arrays nodes is_sliding pieces v
       | _ -> bad "components: an array of objects, of more than 100 an object of arrays");
      let some = List.exists (fun (p : piece) -> p.some_balanced) pieces in
      (if is_sliding then "6." else "3.") ^ (if some then "1" else "2")
