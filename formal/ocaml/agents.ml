(* Certificates of agents of order n: section 21 of FORMAT.md, after the certificate of their graph. *)
open Checker
open Json
open Document
module Z = Number.Z

type t = { base : Reader.t; record : Checker.agents; points : q list }

let keys = [ "order"; "dimension"; "plant"; "own"; "gains"; "coupling"; "lower_triangle"; "rate"; "points"; "functions";
  "offsets"; "motion" ]
let some = [ "gain_cap"; "initial_state"; "final_state"; "residual"; "input" ]
let section = part "agents"
let many_points = 257 and longest = 2000

(* a matrix of few rows as a sum of squares, where it is one: coefficients and rows, by elimination; none is believed *)
let split rows =
  let a = Array.of_list (List.map Array.of_list rows) in
  let n = Array.length a in
  let step k =
    let d = a.(k).(k) in
    if Z.sign d.qnum = 0 then None
    else begin
      let l = Array.init n (fun i -> if i < k then Number.zero else Number.div_signed a.(k).(i) d) in
      for i = k to n - 1 do for j = k to n - 1 do
        a.(i).(j) <- Number.sub a.(i).(j) (Number.mul d (Number.mul l.(i) l.(j))) done done;
      Some (d, Array.to_list l) end in
  List.filter_map step (List.init n Fun.id)

(* the inverse of a matrix, which the check verifies *)
let inverse rows =
  let n = List.length rows in
  let a = Array.of_list (List.mapi (fun i r ->
    Array.append (Array.of_list r) (Array.init n (fun j -> if i = j then Number.one else Number.zero))) rows) in
  for k = 0 to n - 1 do
    need (Z.sign a.(k).(k).qnum > 0) "agent-positive of agents";
    let d = a.(k).(k) in
    a.(k) <- Array.map (fun x -> Number.div x d) a.(k);
    for i = 0 to n - 1 do
      if i <> k then begin
        let c = a.(i).(k) in
        a.(i) <- Array.map2 (fun x y -> Number.sub x (Number.mul c y)) a.(i) a.(k) end done done;
  Array.to_list (Array.map (fun r -> Array.to_list (Array.sub r n n)) a)

let count what v =
  let z = integer what v in
  need (Z.sign z > 0 && Z.leq z (Z.of_int 8)) (what ^ " is no integer from 1 to 8"); Z.to_int z
let short what (x : q) =
  need (Z.numbits x.qnum <= longest && Z.numbits x.qden <= longest) (Printf.sprintf "%s: a number of more than %d bits" what longest); x
let shorts what length v =
  let l = entries what v in
  need (List.length l = length) (Printf.sprintf "%s: %d numbers are due" what length); List.map (fun x -> short what (number what x)) l
let symmetric n v =
  let rows = entries "lower_triangle" v in
  need (List.length rows = n) "lower_triangle: another number of rows";
  let rows = Array.of_list (List.mapi (fun i r -> Array.of_list (shorts "lower_triangle" (i + 1) r)) rows) in
  List.init n (fun i -> List.init n (fun j -> rows.(max i j).(min i j)))

(* the functions that are used, with constants of their input, which the certificate of the graph bears in its record *)
let functions (r : Reader.t) proof v =
  let one (before, funcs) v =
    let get = fields "a function that is used" ~may:[ "inputs" ] [ "function" ] v in
    let z = integer "function" (get "function") in
    need (Z.gt z (Z.of_int before) && Z.lt z (Z.of_int (List.length funcs))) "functions that are used: none such, or in another order";
    let k = Z.to_int z in
    need (Z.sign (List.nth funcs k).rate.qnum > 0) "a Lyapunov function that is used and does not decay";
    k, match get "inputs" with
    | Null -> funcs
    | v ->
        need (r.full k) "constants of the input of a Lyapunov function that is not full";
        bare_of proof "input-constants" (Printf.sprintf "decays[%d]" k);
        let constants = by_agent r.nodes number "inputs" v in
        List.mapi (fun i f -> if i = k then { f with constants = Some constants } else f) funcs in
  let used, _, funcs = List.fold_left (fun (used, before, funcs) v -> let k, funcs = one (before, funcs) v in k :: used, k, funcs)
    ([], -1, r.cert.funcs) (entries "functions" v) in
  List.rev used, funcs

(* by coordinate: offsets by agent, and states by derivative and agent; of the final ones [told] derivatives *)
let axes ?told (r : Reader.t) n dimension get ends_known =
  let boxes key read v = by_agent r.nodes (fun what v ->
    let l = entries what v in
    need (List.length l = dimension) (Printf.sprintf "%s: %d coordinates are due" what dimension); List.map (read what) l) key v in
  let told = Option.value told ~default:n in
  let row n read what v =
    let l = entries what v in
    need (List.length l = n) (Printf.sprintf "%s: %d derivatives are due" what n); List.map (read what) l in
  let offsets = boxes "offsets" number (get "offsets") in
  let states = match get "initial_state" with Null -> None | v -> Some (boxes "initial_state" (row n number) v) in
  let finals = match get "final_state" with
    | Null -> None
    | v -> need (states <> None) "a final state without initial states"; Some (boxes "final_state" (row told Reader.interval) v) in
  let turned n axis rows = List.init n (fun i -> List.map (fun row -> List.nth (List.nth row axis) i) rows) in
  match states with
  | None -> []
  | Some states -> List.init dimension (fun axis -> { offsets = List.map (fun row -> List.nth row axis) offsets; begins = turned n axis states;
      arrivals = match finals with Some l when ends_known -> turned told axis l | _ -> [] })

(* the certificate of the graph of agents of order n *)
let graph_of json : Reader.t =
  let r = Reader.certificate json in
  need (part "messages" json = None) "messages beside agents of order n";
  need (r.cert.start = [] && part "input" json = None) "initial_state or input beside that of the agents";
  List.iter (fun x -> need (Number.equal x Number.zero) "agents of order n begin with sliding variables that are 0") r.cert.sliding;
  if r.cert.enclosed then unsupported "agents of order n on a large form";
  r

let certificate json : t =
  let get = match section json with Some v -> fields "agents" ~may:some keys v | None -> bad "no agents of order n" in
  let r = graph_of json in
  let n = count "order" (get "order") in
  let dimension = count "dimension" (get "dimension") in
  let row key = shorts key n (get key) in
  let single key = short key (number key (get key)) in
  let w = symmetric n (get "lower_triangle") in
  let points = entries "points" (get "points") in
  need (List.length points <= many_points) (Printf.sprintf "more than %d points" many_points);
  let points = List.map (fun x -> short "points" (number "points" x)) points in
  let rec ascending = function a :: (b :: _ as l) -> Number.compare a b < 0 && ascending l | _ -> true in
  need (ascending points) "points do not ascend";
  let proof = { rest = r.rest; checked = []; unchecked = [] } in
  let used, funcs = functions r proof (get "functions") in
  need (used <> [] || r.cert.edges = []) "what was proved makes another verdict";
  let coupling, rate = single "coupling", single "rate" in
  bare_of proof "agent-positive" "agents";
  need (Number.equal (bare proof "agent-decrease" "agents" [ "rate" ] "rate") rate) "agent-decrease: another rate";
  need (Number.equal (bare proof "agent-coupling" "agents" [ "coupling" ] "coupling") coupling) "agent-coupling: another coupling";
  let left = ref [] in
  let skip kind key = if get key <> Null then (skipped proof kind "agents"; left := ("agents." ^ key) :: !left) in
  let plant = row "plant" and damping = row "own" in
  let cap = match get "gain_cap" with Null -> None | _ -> Some (single "gain_cap") in
  let of_int i = Number.of_z (Z.of_int i) and largest = List.fold_left (fun m (x : q) -> Number.max m { x with qnum = Z.abs x.qnum }) Number.zero in
  let pace = Number.mul r.cert.rho2 r.cert.kappa and most = largest plant in
  let span = match r.cert.kind with Nominal t -> t | SlidingMode (a, b, _, _, _, _) -> Number.add a b in
  need (Number.equal most Number.zero || Number.compare (Number.mul span (Number.add Number.one most)) (of_int 100) <= 0)
    "agents that move too far before T";
  let gain_0 = Number.add r.cert.rho1 (Number.div pace span) in
  (match cap with
   | None ->
       need (Number.compare (Number.mul rate pace) (of_int (2 * (n - 1))) > 0) "r k is not above 2 (n - 1): derivatives need not agree at T";
       need (points <> [] && Number.equal (List.hd points) Number.zero) "points do not begin at 0"
   | Some g ->
       need (Z.sign g.qnum > 0) "the cap of the gain is not positive";
       need (if Number.compare g gain_0 <= 0 then points = []
         else points <> [] && Number.equal (List.hd points) (Number.div Number.one g)) "points do not begin at the cap of the gain");
  need (Number.equal (largest damping) Number.zero || (n = 2 && Z.sign (List.hd damping).qnum = 0 && Z.sign (List.nth damping 1).qnum > 0
    && Z.sign (List.hd plant).qnum = 0 && cap = None)) "feedback of the own state that is not that of meeting at rest";
  let deviates = List.exists (fun k -> (List.nth funcs k).deviation <> None) used in
  let agree = cap = None && (deviates || r.cert.edges = []) in
  if cap = None && not agree && used <> [] then left := [ "claim, that all agree at the deadline" ];
  let motion = List.map (fun row -> let l = entries "motion" row in
    need (List.length l = n) "motion: another number of columns"; List.map (Reader.interval "motion") l) (entries "motion" (get "motion")) in
  need (List.length motion = n) "motion: another number of rows";
  let force = if Number.equal (largest damping) Number.zero then Number.zero
    else Number.mul span (Number.add (List.nth plant 1) (Number.mul (List.nth damping 1) r.cert.rho1)) in
  need (Number.compare { force with qnum = Z.abs force.qnum } (of_int 1000) <= 0) "agents at rest: (a_2 + f_2 rho1) T is above 1000";
  let rounded i l = if Number.equal (largest damping) Number.zero then not (Number.equal most Number.zero)
    else i = 0 && l = 1 && not (Number.equal force Number.zero) in
  List.iteri (fun i -> List.iteri (fun l (_, radius) ->
    need (rounded i l || Number.equal radius Number.zero) "motion: a radius where the common motion is known exactly")) motion;
  let known = agree || cap <> None in
  if known then bare_of proof "agent-motion" "agents" else skip "agent-motion" "motion";
  if known && get "final_state" <> Null then bare_of proof "agent-final-state" "agents" else skip "agent-final-state" "final_state";
  need ((get "residual" <> Null) = (cap <> None && get "initial_state" <> Null && deviates))
    "what is left at the deadline is told iff there are a cap, initial states and deviations";
  let left_over = match get "residual" with
    | Null -> None
    | v ->
        let get = fields "residual" [ "clock"; "agents" ] v in
        let clock = number "clock" (get "clock") in
        let rows = by_agent r.nodes (fun what v ->
          let l = entries what v in
          need (List.length l = n) (Printf.sprintf "%s: %d derivatives are due" what n); List.map (number what) l) "residual" (get "agents") in
        (* [e^(r clock)] and the logarithm of the capped gain are known well enough *)
        let far = Number.compare (Number.mul rate clock) (of_int 400) > 0
          || Number.compare (Number.div (Number.mul span (Option.get cap)) pace) (Number.of_z (Z.shift_left Z.one 800)) > 0 in
        if far then (skip "agent-residual" "residual"; None)
        else (bare_of proof "agent-residual" "agents"; Some (clock, rows)) in
  let tops = match get "input" with
    | Null -> []
    | v ->
        need (get "initial_state" <> Null && used <> []) "a bound of the input without initial states or Lyapunov functions";
        need (cap <> None || Number.compare (Number.mul rate pace) (of_int (2 * n)) >= 0) "a bound of the input though r k is below 2 n";
        bare_of proof "agent-input" "agents";
        let get = fields "input" [ "agents"; "largest" ] v in
        let tops = by_agent r.nodes number "input" (get "agents") in
        need (Number.equal (number "largest" (get "largest")) (largest tops)) "the largest input is another"; tops in
  List.iteri (fun i _ -> skipped proof "agent-phase" (Printf.sprintf "phases[%d]" i))
    (Option.fold ~none:[] ~some:(entries "phases") (part "phases" json));
  if part "instants" json <> None then skipped proof "agent-instants" "instants";
  need (proof.rest = []) "an obligation that nothing asks for";
  let slope = r.cert.rho1 in
  let cert = { r.cert with funcs; rho1 = if Z.sign slope.qnum = 0 then Number.one else slope } in
  let record = { graph = cert; degree = n; slope; cap; plant; damping; gains = row "gains"; w; p = inverse w;
    coupling; falls = rate; used; agree; drift = Some motion; axes = axes r n dimension get known; tops; left_over } in
  { base = { r with cert; rest = []; checked = r.checked @ List.rev proof.checked; unchecked = r.unchecked @ List.rev proof.unchecked;
      sections = r.sections @ List.rev !left };
    record; points }
let accepts a = accepts_agents a.base.hints split a.points a.record
(* the parts of the check one by one *)
let parts a = [ "agent-positive of agents", (fun () -> check_matrices split a.record);
  "agent-decrease of agents", (fun () -> check_decrease split a.record a.points);
  "agent-coupling of agents", (fun () -> check_coupling a.record);
  "agent-decrease of agents: derivatives need not agree at T", (fun () -> check_agree a.record);
  "agent-motion of agents", (fun () -> check_common a.record);
  "agent-final-state of agents", (fun () -> check_ends_of a.record);
  "agent-residual of agents", (fun () -> check_left a.record);
  "agent-input of agents", (fun () -> check_tops a.record) ]
