(* What the input takes from the initial state, how large it gets, its energy and the length of its path: with their
   witnesses as the theorem knows them. Others are named, and not believed. *)
open Checker
open Json
open Document
module Z = Number.Z

(* the next obligation, checked if the theorem speaks of it *)
let claim proof kind keys reading =
  let numbers, witness = take proof kind "input" (Some keys) in
  match reading numbers witness with
  | Some e -> proof.checked <- (kind, "input") :: proof.checked; [ e ]
  | None -> proof.unchecked <- (kind, "input") :: proof.unchecked; []

(* the number of a Lyapunov function *)
let index kind functions v =
  let at = integer "a Lyapunov function" v in
  need (Z.sign at >= 0 && Z.compare at (Z.of_int (List.length functions)) < 0) (kind ^ ": there is no such Lyapunov function");
  Z.to_int at
(* from where motions start: of that nothing is read; one initial state, with [rho1 T + k], where no sliding variable moves;
   one where some do, and whether pieces of the time up to an instant are known well enough *)
type begins = Unread | At_rest of q | Moving of (q -> bool)
(* [e^z] and [e^(-rate s)] of an instant are known well enough, [rate s <= rate (rho1 T + k) z]; so are constants *)
let known begins (functions : func list) (f, z) =
  let one = List.nth functions f in
  let at_0 row i x = i = row || Number.equal x Number.zero in
  let bounded = one.constants <> None || (match one.ly with
    | InEps _ -> true | Weighted _ -> false
    | InE p -> List.for_all Fun.id (List.concat (List.mapi (fun row -> List.mapi (at_0 row)) p))) in
  match begins with
  | At_rest pace -> Number.compare (Number.mul (Number.max Number.one (Number.mul one.rate pace)) z) (Number.of_z (Z.of_int 40)) <= 0
  | Moving enclosed -> bounded && enclosed z
  | Unread -> false
(* functions with instants *)
let peak proof (functions : func list) nodes begins v =
  let get = fields "peak" [ "agents"; "largest"; "norm" ] v in
  let each = by_agent nodes number "peak.agents" (get "agents") in
  need (Number.equal (number "peak.largest" (get "largest")) (List.fold_left Number.max (List.hd each) each)) "peak.largest is another";
  claim proof "input-peak" [ "z" ] (fun numbers witness ->
    let of_ = fields "the witness" [ "agents"; "norm" ] witness in
    let way v = match entries "an agent" v with
      | [ f; z ] -> index "input-peak" functions f, number "an instant" z
      | _ -> bad "input-peak: a Lyapunov function and an instant" in
    let ways = List.map way (ordered (Array.to_list nodes.labels) "agents" (of_ "agents")) in
    let last = index "input-peak" functions (of_ "norm"), numbers "z" in
    if List.for_all (known begins functions) (List.sort_uniq compare (last :: ways))
    then Some (Peak (each, number "peak.norm" (get "norm"), ways, last)) else None)
(* a Lyapunov function from the first instant on, or in pieces up to an instant *)
let path_length proof (functions : func list) begins v =
  let most = number "path_length" v in
  claim proof "input-length" [ "z" ] (fun numbers witness ->
    let way = index "input-length" functions witness, numbers "z" in
    let read = match begins with At_rest _ -> Number.equal (snd way) Number.zero | _ -> known begins functions way in
    if read then Some (PathLength (most, way)) else None)
(* two matrices, where [e^-p] is known well enough up to [p = 40]; or a function, in pieces up to an instant *)
let energy proof triangle (functions : func list) begins v =
  let most = number "energy" v in
  match following_witness proof, begins with
  | Obj _, At_rest _ ->
      claim proof "input-energy" [ "p"; "m0"; "m1" ] (fun numbers witness ->
        let get = fields "the witness" [ "W0"; "W1" ] witness in
        let p = numbers "p" in
        if Number.compare p (Number.of_z (Z.of_int 40)) > 0 then None
        else Some (Energy (most, triangle "W0" (get "W0"), triangle "W1" (get "W1"), numbers "m0", numbers "m1", p)))
  | Num _, Moving _ ->
      claim proof "input-energy" [ "z" ] (fun numbers witness ->
        let way = index "input-energy" functions witness, numbers "z" in
        if known begins functions way then Some (EnergyBy (most, way)) else None)
  | _ -> skipped proof "input-energy" "input"; []

(* the efforts, and the parts that were not checked *)
let read proof nodes functions triangle begins input =
  let part key skip read = match input key with
    | Null -> [], []
    | v when (match begins with Unread -> false | _ -> true) -> let found = read v in found, if found = [] then [ key ] else []
    | _ -> skipped proof skip "input"; [], [ key ] in
  let peak, a = part "peak" "input-peak" (peak proof functions nodes begins) in
  let energy, b = part "energy" "input-energy" (energy proof triangle functions begins) in
  let path, c = part "path_length" "input-length" (path_length proof functions begins) in
  peak @ energy @ path, a @ b @ c
