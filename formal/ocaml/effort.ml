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
let witness proof = match proof.rest with Obj l :: _ -> List.assoc_opt "witness" l | _ -> None

(* the number of a Lyapunov function *)
let index kind functions v =
  let at = integer "a Lyapunov function" v in
  need (Z.sign at >= 0 && Z.compare at (Z.of_int (List.length functions)) < 0) (kind ^ ": there is no such Lyapunov function");
  Z.to_int at
(* functions with instants, of [e^z] and [e^(-rate s)] that are known well enough: [rate s <= rate (rho1 T + k) z] *)
let peak proof (functions : func list) nodes pace v =
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
    let known (f, z) =
      let rate = (List.nth functions f).rate in
      Number.compare (Number.mul (Number.max Number.one (Number.mul rate pace)) z) (Number.of_z (Z.of_int 40)) <= 0 in
    if List.for_all known (last :: ways) then Some (Peak (each, number "peak.norm" (get "norm"), ways, last)) else None)
(* a Lyapunov function from the first instant on *)
let path_length proof (functions : func list) v =
  let most = number "path_length" v in
  claim proof "input-length" [ "z" ] (fun numbers witness ->
    let f = index "input-length" functions witness in
    if Number.equal (numbers "z") Number.zero then Some (PathLength (most, f)) else None)
(* two matrices; [e^-p] is known well enough up to [p = 40] *)
let energy proof triangle v =
  let most = number "energy" v in
  match witness proof with
  | Some (Obj _) ->
      claim proof "input-energy" [ "p"; "m0"; "m1" ] (fun numbers witness ->
        let get = fields "the witness" [ "W0"; "W1" ] witness in
        let p = numbers "p" in
        if Number.compare p (Number.of_z (Z.of_int 40)) > 0 then None
        else Some (Energy (most, triangle "W0" (get "W0"), triangle "W1" (get "W1"), numbers "m0", numbers "m1", p)))
  | _ -> skipped proof "input-energy" "input"; []

(* the efforts, and the parts that were not checked; [alone]: of one initial state, and no sliding variable moves; [pace]:
   [rho1 T + k] of the nominal protocol *)
let read proof nodes functions triangle alone pace input =
  let part key skip read = match input key, read with
    | Null, _ -> [], []
    | v, Some read when alone -> let found = read v in found, if found = [] then [ key ] else []
    | _ -> skipped proof skip "input"; [], [ key ] in
  let peak, a = part "peak" "input-peak" (Option.map (peak proof functions nodes) pace) in
  let energy, b = part "energy" "input-energy" (Some (energy proof triangle)) in
  let path, c = part "path_length" "input-length" (Some (path_length proof functions)) in
  peak @ energy @ path, a @ b @ c
