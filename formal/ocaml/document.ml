(* A certificate while it is read: fields, texts, labels, and how far its proof was followed. *)
open Json
exception Unsupported of string
let bad m = raise (Bad m)
let unsupported m = raise (Unsupported m)

(* of long lists too: [List.map] takes the stack *)
let map f l = List.rev (List.rev_map f l)
let entries what = function Arr l -> l | _ -> bad (what ^ ": an array is due")
let text what = function Str s -> s | _ -> bad (what ^ ": a text is due")
let truth what = function Bool b -> b | _ -> bad (what ^ ": true or false is due")
let part key = function Obj l -> List.assoc_opt key l | _ -> None
(* an object with exactly these keys, and some of those that it may have, as a function from keys to values: [Null] of a key
   that is absent, since none is there with null *)
let fields what ?(may = []) keys = function
  | Obj l as v ->
      let wrong k how = bad (Printf.sprintf "%s: the key %S is %s" what k how) in
      List.iter (fun k -> if not (List.mem_assoc k l) then wrong k "missing") keys;
      List.iter (fun (k, x) -> if not (List.mem k keys || List.mem k may) then wrong k "unknown" else if x = Null then wrong k "null") l;
      fun k -> Option.value (part k v) ~default:Null
  | _ -> bad (what ^ ": an object is due")
let beside = function Obj l -> (match List.assoc_opt "count" l with Some (Num _) -> true | _ -> false) | _ -> false
let need ok what = if not ok then bad what

let number what = function
  | Str s -> Number.rational s
  | Obj l when List.mem_assoc "mid" l -> unsupported (what ^ " with a radius")
  | _ -> bad (what ^ ": a number is due")
let optional read what = function Null -> None | x -> Some (read what x)
let integer what = function
  | Num s when Number.digits (Number.unsigned s) -> Number.Z.of_string s
  | _ -> bad (what ^ ": an integer is due")

(* the nodes, and where they stand *)
module Labels = Map.Make (String)
type nodes = { labels : string array; index : int Labels.t }
let nodes_of v =
  let labels = Array.of_list (List.map (text "nodes") (entries "nodes" v)) in
  need (Array.length labels > 0) "nodes: there is none";
  let index = ref Labels.empty in
  Array.iteri (fun i s -> need (not (Labels.mem s !index)) "a node occurs twice"; index := Labels.add s i !index) labels;
  { labels; index = !index }
let node nodes what v = match Labels.find_opt (text what v) nodes.index with
  | Some i -> i | None -> bad (what ^ ": an unknown node")
(* so many integers, or any number of them where a list is given *)
let integers what count v =
  if beside v then Side.integers what count v else
  let l = map (integer what) (entries what v) in need (List.length l = count) (what ^ ": another number of entries"); l
let count_of = function Obj l -> (match List.assoc_opt "count" l with Some (Num s) when Number.digits s && String.length s <= 9 -> int_of_string s | _ -> bad "a side vector: its count") | _ -> 0
(* as many numbers as there are of these *)
let numbers what count v =
  if beside v then Side.numbers what count v else
  let l = map (number what) (entries what v) in need (List.length l = count) (what ^ ": a number for each node"); l
let positions nodes what v =
  if not (beside v) then map (node nodes what) (entries what v) else
  map (fun z -> need (Number.Z.sign z >= 0 && Number.Z.lt z (Number.Z.of_int (Array.length nodes.labels))) (what ^ ": an unknown node"); Number.Z.to_int z)
    (Side.integers what (count_of v) v)
(* an object that has these labels as keys, in this order *)
let ordered labels what = function
  | Obj l -> need (List.map fst l = labels) (what ^ ": agents are others, or in another order"); List.map snd l
  | _ -> bad (what ^ ": an object by agent is due")
let by_agent nodes read what v =
  if beside v then unsupported (what ^ " in a side vector") else List.map (read what) (ordered (Array.to_list nodes.labels) what v)
(* numbers by agent that may stand in a side vector *)
let state nodes what v =
  if beside v then Side.numbers what (Array.length nodes.labels) v else by_agent nodes number what v

(* the SHA-256 of JSON, as section 16 has it *)
let hashed (v : Json.t) : string =
  let b = Buffer.create 65536 and sum = Sha256.start () in
  let feed () = Sha256.feed sum (Buffer.contents b); Buffer.clear b in
  let quoted s =
    Buffer.add_char b '"';
    let n = String.length s in
    let rec go i = if i < n then begin
      let c = Char.code s.[i] in
      if c < 128 then begin
        (match s.[i] with
         | '"' -> Buffer.add_string b "\\\"" | '\\' -> Buffer.add_string b "\\\\" | '\b' -> Buffer.add_string b "\\b"
         | '\t' -> Buffer.add_string b "\\t" | '\n' -> Buffer.add_string b "\\n" | '\012' -> Buffer.add_string b "\\f"
         | '\r' -> Buffer.add_string b "\\r"
         | _ when c < 32 || c = 127 -> Buffer.add_string b (Printf.sprintf "\\u%04x" c)
         | x -> Buffer.add_char b x); go (i + 1) end
      else begin
        let more, first = if c >= 0xF0 then 3, c land 7 else if c >= 0xE0 then 2, c land 15 else 1, c land 31 in
        let u = ref first in
        for j = 1 to more do u := (!u lsl 6) lor (Char.code s.[i + j] land 63) done;
        let unit x = Buffer.add_string b (Printf.sprintf "\\u%04x" x) in
        if !u < 0x10000 then unit !u
        else (let x = !u - 0x10000 in unit (0xD800 lor (x lsr 10)); unit (0xDC00 lor (x land 0x3FF)));
        go (i + more + 1) end end in
    go 0; Buffer.add_char b '"' in
  let rec put depth v =
    need (depth <= 12) "nested too deep";
    if Buffer.length b > 60000 then feed ();
    match v with
    | Null -> Buffer.add_string b "null" | Bool x -> Buffer.add_string b (string_of_bool x)
    | Num s -> Buffer.add_string b (Number.Z.to_string (integer "a number outside unverified" (Num s)))
    | Str s -> quoted s
    | Arr l -> Buffer.add_char b '['; List.iteri (fun i x -> if i > 0 then Buffer.add_char b ','; put (depth + 1) x) l; Buffer.add_char b ']'
    | Obj l ->
        Buffer.add_char b '{';
        List.iteri (fun i (k, x) -> if i > 0 then Buffer.add_char b ','; quoted k; Buffer.add_char b ':'; put (depth + 1) x)
          (List.sort (fun (a, _) (b, _) -> compare a b) l);
        Buffer.add_char b '}' in
  put 0 v; feed (); Sha256.finish sum

(* a text as the lines of the graph's SHA-256 have it *)
let line_text s =
  let b = Buffer.create 16 in
  Buffer.add_char b '"';
  String.iter (function
    | '"' -> Buffer.add_string b "\\\"" | '\\' -> Buffer.add_string b "\\\\" | '\b' -> Buffer.add_string b "\\b"
    | '\t' -> Buffer.add_string b "\\t" | '\n' -> Buffer.add_string b "\\n" | '\012' -> Buffer.add_string b "\\f"
    | '\r' -> Buffer.add_string b "\\r"
    | c when Char.code c < 32 -> Buffer.add_string b (Printf.sprintf "\\u%04x" (Char.code c))
    | c -> Buffer.add_char b c) s;
  Buffer.add_char b '"'; Buffer.contents b

(* the obligations of the proof, taken one after the other *)
type proof = { mutable rest : Json.t list; mutable checked : (string * string) list; mutable unchecked : (string * string) list }
let proof_of v = { rest = entries "proof" v; checked = []; unchecked = [] }
let following p = match p.rest with o :: _ -> (match part "kind" o with Some (Str s) -> s | _ -> "") | [] -> ""
let following_witness p = match p.rest with o :: _ -> Option.value (part "witness" o) ~default:Null | [] -> Null
let obligation what o =
  let get = fields what ~may:[ "numbers"; "witness" ] [ "kind"; "of"; "proves"; "lemma" ] o in
  (match get "numbers" with
   | Null -> () | Obj (_ :: _ as l) -> List.iter (fun (k, x) -> ignore (text (what ^ ": " ^ k) x)) l
   | _ -> bad (what ^ ": numbers are an object, or absent"));
  get
(* the next obligation, which must be this one: its numbers, and its witness *)
let take p kind of_ keys =
  match p.rest with
  | [] -> bad (Printf.sprintf "the proof does not list %s of %s" kind of_)
  | o :: rest ->
      let what = kind ^ " of " ^ of_ in
      let get = obligation ("an obligation, " ^ what) o in
      let proves, lemma = try List.assoc kind Texts.obligations with Not_found -> bad ("an unknown obligation " ^ kind) in
      need (get "kind" = Str kind && get "of" = Str of_ && get "proves" = Str proves && get "lemma" = Str lemma)
        ("the proof lists another obligation than " ^ what);
      p.rest <- rest;
      (match keys with
       | None -> (fun _ -> Number.zero), get "witness"
       | Some keys ->
           let n = fields ("numbers of " ^ what) keys (match get "numbers" with Null -> Obj [] | v -> v) in
           (fun k -> number k (n k)), get "witness")
let proved p kind of_ keys =
  let n, w = take p kind of_ (Some keys) in p.checked <- (kind, of_) :: p.checked; n, w
(* says of the last obligation what the theorem says, where that is not all of its fixed text *)
let said p words = match p.checked with (kind, of_) :: l -> p.checked <- (kind, of_ ^ ": " ^ words) :: l | [] -> ()
let bare p kind of_ keys =
  let n, w = proved p kind of_ keys in need (w = Null) (kind ^ ": a witness that nothing asks for"); n
(* without numbers and witness *)
let bare_of p kind of_ = let _ : string -> Checker.q = bare p kind of_ [] in ()
let skipped p kind of_ = ignore (take p kind of_ None); p.unchecked <- (kind, of_) :: p.unchecked
(* kinds of obligations and what they are of have these letters alone: what is printed of them can be no other line *)
let named = String.for_all (function 'a' .. 'z' | '0' .. '9' | '-' | '.' | '[' | ']' -> true | _ -> false)
(* all that are left: of parts that are not read *)
let others p of_part =
  List.iter (fun o ->
    let get = obligation "an obligation" o in
    match get "kind", get "of" with
    | Str k, Str o when of_part k && named k && named o -> p.unchecked <- (k, o) :: p.unchecked
    | _ -> bad "an obligation that nothing asks for") p.rest;
  p.rest <- []
