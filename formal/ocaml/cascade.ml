(* Certificates of the cascade: the end of section 21 of FORMAT.md, after the certificate of their graph. *)
open Checker
open Json
open Document
module Z = Number.Z

type t = { base : Reader.t; record : Checker.cascade; hint : Checker.thrusts }

let keys = [ "cascade"; "dimension"; "functions"; "offsets"; "motion" ]
let is_cascade section = part "cascade" section <> None
let of_int i = Number.of_z (Z.of_int i)

(* what bounds the roots of a function at the begin; and the entry without that, as that of other agents *)
let roots_of v =
  let get = fields "a function that is used" ~may:[ "inputs"; "initial"; "drive" ] [ "function" ] v in
  let one key = optional number key (get key) in
  let roots = match one "initial", one "drive" with
    | Some x, Some y -> Some (x, y) | None, None -> None | _ -> bad "initial and drive are told both, or none" in
  roots, Obj (List.filter (fun (_, x) -> x <> Null) [ "function", get "function"; "inputs", get "inputs" ])

(* not below the root, to many bits; the check verifies it *)
let root (q : q) =
  if Z.sign q.qnum <= 0 then Number.zero
  else begin
    let e = max 0 (260 + (Z.numbits q.qden - Z.numbits q.qnum) / 2) in
    let v = Z.shift_left q.qnum (2 * e) in
    let s = Z.sqrt (Z.div v q.qden) in
    let s = if Z.equal (Z.mul (Z.mul s s) q.qden) v then s else Z.succ s in
    Number.div (Number.of_z s) (Number.of_z (Z.shift_left Z.one e)) end
let sum = List.fold_left Number.add Number.zero

(* what the bound of the input is formed of: roots of values at the begin, of constants and of speeds *)
let thrust_of team : thrusts =
  let d = prepare team.graph in
  let of_function k =
    let f = List.nth team.graph.funcs k in
    match form team.graph.order d.dls d.dL f.ly, bounds_of team.graph d f with
    | Some (m, scale), Some ((_, constants), _) ->
        root (sum (List.map (fun x -> value_q team m scale (mixed_row team x)) team.axes)), List.map root constants
    | _ -> Number.zero, [] in
  let speeds j = root (sum (List.map (fun x -> let v = List.nth (List.nth x.begins 1) j in Number.mul v v) team.axes)) in
  { of_functions = List.map of_function team.used; speeds = List.init team.graph.order speeds }

let certificate section json : t =
  let get = fields "agents" ~may:[ "initial_state"; "final_state"; "input" ] keys section in
  let r = Agents.graph_of json in
  let dimension = Agents.count "dimension" (get "dimension") in
  let alpha = Agents.short "cascade" (number "cascade" (get "cascade")) in
  need (Z.sign alpha.qnum > 0) "the rate of the cascade is not positive";
  let span = match r.cert.kind with Nominal t -> t | SlidingMode (a, b, _, _, _, _) -> Number.add a b in
  let pace = Number.mul r.cert.rho2 r.cert.kappa in
  List.iter (fun x -> ignore (Agents.short "T, rho1 and k" x)) [ span; pace; r.cert.rho1 ];
  let force = Number.mul (Number.mul alpha r.cert.rho1) span in
  need (Number.compare force (of_int 1000) <= 0) "alpha rho1 T is above 1000";
  let proof = { rest = r.rest; checked = []; unchecked = [] } in
  let told, entries_ = List.split (List.map roots_of (entries "functions" (get "functions"))) in
  let used, funcs = Agents.functions r proof (Arr entries_) in
  need (used <> [] || r.cert.edges = []) "what was proved makes another verdict";
  let begins = get "initial_state" <> Null in
  need (List.for_all (fun x -> (x <> None) = begins) told) "initial values are told iff there are initial states";
  need (Number.equal (bare proof "agent-cascade" "agents" [ "alpha" ] "alpha") alpha) "agent-cascade: another alpha";
  let left = ref [] in
  let skip kind key = if get key <> Null then (skipped proof kind "agents"; left := ("agents." ^ key) :: !left) in
  let faster f = Number.compare (Number.mul f.rate pace) (of_int 2) > 0 in
  let fast = List.exists (fun k -> faster (List.nth funcs k)) used in
  let stops = List.exists (fun k -> let f = List.nth funcs k in faster f && match f.ly with Weighted _ -> false | _ -> true) used in
  let agree = List.exists (fun k -> (List.nth funcs k).deviation <> None) used in
  if not agree then left := [ "claim, that all agree at the deadline" ];
  let motion = List.map (fun row -> let l = entries "motion" row in
    need (List.length l = 2) "motion: another number of columns"; List.map (Reader.interval "motion") l) (entries "motion" (get "motion")) in
  need (List.length motion = 2) "motion: another number of rows";
  List.iteri (fun i -> List.iteri (fun l (_, radius) ->
    need (i = 0 && l = 1 || Number.equal radius Number.zero) "motion: a radius where the common motion is known exactly")) motion;
  if agree then bare_of proof "agent-motion" "agents" else skip "agent-motion" "motion";
  let velocities = fast || r.cert.edges = [] in
  let ends = agree && (stops || not velocities) in
  if ends && get "final_state" <> Null then bare_of proof "agent-final-state" "agents" else skip "agent-final-state" "final_state";
  let axes = Agents.axes ~told:(if velocities then 2 else 1) r 2 dimension get ends in
  let largest = List.fold_left Number.max Number.zero in
  let tops = match get "input" with
    | Null -> []
    | v ->
        need (begins && used <> []) "a bound of the input without initial states or Lyapunov functions";
        bare_of proof "agent-input" "agents";
        let get = fields "input" [ "agents"; "largest" ] v in
        let tops = by_agent r.nodes number "input" (get "agents") in
        need (Number.equal (number "largest" (get "largest")) (largest tops)) "the largest input is another"; tops in
  if part "instants" json <> None then skipped proof "agent-instants" "instants";
  need (proof.rest = []) "an obligation that nothing asks for";
  let slope = r.cert.rho1 in
  let cert = { r.cert with funcs; rho1 = if Z.sign slope.qnum = 0 then Number.one else slope } in
  let team = { graph = cert; degree = 2; slope; cap = None; plant = []; damping = [ Number.zero; alpha ]; gains = []; w = []; p = [];
    coupling = Number.zero; falls = Number.zero; used; agree; drift = Some motion; axes; tops; left_over = None } in
  { base = { r with cert; rest = []; checked = r.checked @ List.rev proof.checked; unchecked = r.unchecked @ List.rev proof.unchecked;
      sections = r.sections @ List.rev !left };
    record = { team; firsts = List.filter_map Fun.id told; stops };
    hint = if tops = [] then { of_functions = []; speeds = [] } else thrust_of team }
let accepts c = accepts_cascade c.base.hints c.hint c.record
(* the parts of the check one by one *)
let parts c = [ "agent-motion of agents", (fun () -> check_law c.record);
  "agent-cascade of agents: a function whose deviation is known", (fun () -> check_agreed c.record);
  "agent-cascade of agents: velocities need not vanish at T", (fun () -> check_stops c.record);
  "agent-cascade of agents", (fun () -> check_roots c.record);
  "agent-final-state of agents", (fun () -> check_ends_of c.record.team);
  "agent-input of agents", (fun () -> check_push c.record c.hint) ]
