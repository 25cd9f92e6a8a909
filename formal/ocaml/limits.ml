(* What the check takes of where agents of a family end, and of boxes: hints, and what the file says of them. *)
open Checker
open Json
open Document
module Z = Number.Z

let negated q = Number.sub Number.zero q
let positive_tie e = Z.sign e.bottom.qnum > 0 || (Z.sign e.bottom.qnum = 0 && Z.sign e.top.qnum >= 0)
(* the least and the largest of what reaches each agent along edges of any modes, with their signs *)
let hull_of modes start =
  let low = Array.of_list start and high = Array.of_list start in
  let moved = ref true in
  let along t s positive =
    let a, b = if positive then low.(s), high.(s) else negated high.(s), negated low.(s) in
    if Number.compare a low.(t) < 0 then (low.(t) <- a; moved := true);
    if Number.compare b high.(t) > 0 then (high.(t) <- b; moved := true) in
  while !moved do
    moved := false;
    List.iter (fun m -> List.iter (fun e ->
      along e.head e.tail (positive_tie e); if e.mutual then along e.tail e.head (positive_tie e)) m.ties) modes
  done;
  Array.to_list low, Array.to_list high
(* an agent and all that it hears *)
let heard modes n i =
  let found = Array.make n false in
  found.(i) <- true;
  let more = ref true in
  let hear t s = if found.(t) && not found.(s) then (found.(s) <- true; more := true) in
  while !more do
    more := false;
    List.iter (fun m -> List.iter (fun e -> hear e.head e.tail; if e.mutual then hear e.tail e.head) m.ties) modes
  done;
  found
(* sums that every member keeps, one for each column that has a witness *)
let kept nodes modes part witness =
  let n = Array.length nodes.labels in
  let here = Pieces.inside n part.its_agents in
  let mine = List.filter (fun (_, (one : comp)) -> here (List.hd one.nodes) && (match one.camps with Gauge _ -> true | Cycle _ -> false))
    (List.mapi (fun k one -> string_of_int (k + 1), one) (List.hd modes).mandatory.comps) in
  let columns = if part.still = [] then [] else begin
    need (List.length mine = List.length part.still) "claim: other states at rest"; List.combine (List.map fst mine) part.still end in
  match witness with
  | Null -> []
  | Obj l -> List.map (fun (number_, q) ->
      let pivot, column = match List.assoc_opt number_ columns with Some c -> c | None -> bad "means of a component" in
      let group = heard modes n pivot in
      let weights = match q with
        | Str "equal" -> List.mapi (fun i x -> if group.(i) then x else Number.zero) column
        | Obj l ->
            let l = List.map (fun (label, x) -> node nodes "a mean" (Str label), number "a mean" x) l in
            need (List.for_all (fun (i, _) -> group.(i)) l) "a mean of agents that a pivot does not hear";
            List.init n (fun i -> Option.value (List.assoc_opt i l) ~default:Number.zero)
        | _ -> bad "a mean is no object" in
      let d = List.fold_left (fun a x -> Z.lcm a x.qden) Z.one weights in
      Kept (List.map (fun x -> Z.div (Z.mul x.qnum d) x.qden) weights)) l
  | _ -> bad "means of a component"
(* what is known where no sliding variable moves: of pivots by what reaches them, of others by the functions of the part *)
let near family part =
  let four = Number.of_z (Z.of_int 4) in
  List.map (fun (p, _) -> Hull p) part.still
  @ List.concat (List.mapi (fun k b ->
      if b.about != part || Z.sign b.decay.qnum <= 0 then [] else match value_at family b with
      | None -> []
      | Some v ->
          let within c = Number.root (Number.div (Number.mul four (Number.mul c v)) (Number.mul b.decay b.decay)) in
          let inputs = Array.of_list b.inputs in
          List.map (fun i -> Near (k, i, within inputs.(i))) part.its_agents
          @ List.mapi (fun j (_, c) -> Moved (k, j, within c)) b.means) family.bounds)
(* boxes, those of followers first *)
let boxes nodes modes (parts : part list) proof v =
  let n = Array.length nodes.labels in
  let items = entries "boxes" v in
  need (items <> []) "no box";
  let last = ref (false, -1) in
  List.mapi (fun k v ->
    let of_ = Printf.sprintf "boxes[%d]" k in
    let drawn = part "nodes" v <> None in
    let get = fields "a box" (if drawn then [ "component"; "nodes"; "vector"; "lower"; "upper"; "rate" ] else [ "component"; "lower"; "upper" ]) v in
    let number_ = integer "component" (get "component") in
    need (Z.sign number_ >= 0 && Z.lt number_ (Z.of_int (List.length parts))) "component: there is no such";
    let number_ = Z.to_int number_ in
    need (compare !last (not drawn, number_) < 0) "boxes: out of order";
    last := not drawn, number_;
    let part = List.nth parts number_ in
    need (part.becomes = Depends) "a box where all agents come to rest";
    let whom = if drawn then positions nodes "followers" (get "nodes") else part.its_agents in
    let inside = Pieces.inside n whom in
    need (whom <> [] && whom = List.filter inside part.its_agents) "followers";
    let spread l = let l = List.combine whom l in List.init n (fun i -> Option.value (List.assoc_opt i l) ~default:Number.zero) in
    let count = List.length whom in
    let lower = spread (numbers "lower" count (get "lower")) and upper = spread (numbers "upper" count (get "upper")) in
    if not drawn then begin
      bare_of proof "kept-box" of_;
      { whom; extent = []; lower_end = lower; upper_end = upper; speed = Number.zero } end
    else begin
      bare_of proof "attracting-box" of_;
      let within = Pieces.inside n part.its_agents in
      let hears t s = need (not (inside s && within t && not (inside t))) "a follower is heard by another agent" in
      List.iter (fun m -> List.iter (fun e -> hears e.head e.tail; if e.mutual then hears e.tail e.head) m.ties) modes;
      let sizes = numbers "vector" count (get "vector") in
      need (List.for_all (fun x -> Z.sign x.qnum > 0) sizes) "vector: a number is not positive";
      let speed = number "rate" (get "rate") in
      need (Z.sign speed.qnum > 0) "rate: it is not positive";
      { whom; extent = spread sizes; lower_end = lower; upper_end = upper; speed } end) items
