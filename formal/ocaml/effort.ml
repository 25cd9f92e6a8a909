(* What the input takes from the initial state, the length of its path and its energy: with their witnesses as the
   theorem knows them. Others are named, and not believed. *)
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

(* a Lyapunov function from the first instant on *)
let path_length proof (functions : func list) most =
  claim proof "input-length" [ "z" ] (fun numbers witness ->
    let at = integer "a Lyapunov function" witness in
    need (Z.sign at >= 0 && Z.compare at (Z.of_int (List.length functions)) < 0) "input-length: there is no such Lyapunov function";
    let f = Z.to_int at in
    match (List.nth functions f).ly with
    | InE _ when Number.equal (numbers "z") Number.zero -> Some (PathLength (most, f))
    | _ -> None)
(* two matrices; [e^-p] is known well enough up to [p = 40] *)
let energy proof triangle most =
  match witness proof with
  | Some (Obj _) ->
      claim proof "input-energy" [ "p"; "m0"; "m1" ] (fun numbers witness ->
        let get = fields "the witness" [ "W0"; "W1" ] witness in
        let p = numbers "p" in
        if Number.compare p (Number.of_z (Z.of_int 40)) > 0 then None
        else Some (Energy (most, triangle "W0" (get "W0"), triangle "W1" (get "W1"), numbers "m0", numbers "m1", p)))
  | _ -> skipped proof "input-energy" "input"; []

(* the efforts, and the parts that were not checked; [alone]: of one initial state, and no sliding variable moves *)
let read proof functions triangle alone input =
  let part key skip read = match input key with
    | Null -> [], []
    | v ->
        let found = if alone then read (number key v) else (skipped proof skip "input"; []) in
        found, if found = [] then [ key ] else [] in
  if input "peak" <> Null then skipped proof "input-peak" "input";
  let energy, left = part "energy" "input-energy" (energy proof triangle) in
  let path, right = part "path_length" "input-length" (path_length proof functions) in
  energy @ path, (if input "peak" <> Null then [ "peak" ] else []) @ left @ right
