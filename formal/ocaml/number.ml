(* The numbers of section 3 of FORMAT.md: an integer, a quotient, a decimal or a hexadecimal text, exactly. *)
module Integer = Z
open Checker
module Z = Integer
exception Bad = Json.Bad

let make p d = let g = Z.gcd p d in { qnum = Z.div p g; qden = Z.div d g }
let of_z z = { qnum = z; qden = Z.one }
let zero = of_z Z.zero
let one = of_z Z.one
let mul a b = make (Z.mul a.qnum b.qnum) (Z.mul a.qden b.qden)
let div a b = (* b is not 0 *)
  let p = Z.mul a.qnum b.qden and d = Z.mul a.qden b.qnum in
  if Z.sign d > 0 then make p d else make (Z.neg p) (Z.neg d)
let div_signed a b = (* b is not 0 *)
  if Z.sign b.qnum > 0 then div a b else div { a with qnum = Z.neg a.qnum } { b with qnum = Z.neg b.qnum }
let compare a b = Z.compare (Z.mul a.qnum b.qden) (Z.mul b.qnum a.qden)
let add a b = make (Z.add (Z.mul a.qnum b.qden) (Z.mul b.qnum a.qden)) (Z.mul a.qden b.qden)
let sub a b = add a { b with qnum = Z.neg b.qnum }
let min a b = if compare a b <= 0 then a else b
let max a b = if compare a b >= 0 then a else b
let equal a b = compare a b = 0
let text q = if Z.equal q.qden Z.one then Z.to_string q.qnum else Z.to_string q.qnum ^ "/" ^ Z.to_string q.qden

let digits s = s <> "" && String.for_all (fun c -> c >= '0' && c <= '9') s
let hexdigits s = String.for_all (fun c -> (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F')) s
let cut c t = match String.index_opt t c with
  | None -> (t, None) | Some i -> (String.sub t 0 i, Some (String.sub t (i + 1) (String.length t - i - 1)))
let unsigned s = if s <> "" && (s.[0] = '-' || s.[0] = '+') then String.sub s 1 (String.length s - 1) else s

let rational (s : string) : q =
  let bad () = raise (Bad ("no number: " ^ (if String.length s > 40 then String.sub s 0 40 else s))) in
  if String.length s > 4000 || s = "" then bad ();
  let t = unsigned s in
  let signed z = if s.[0] = '-' then Z.neg z else z in
  let exponent limit e =
    let e' = unsigned e in
    if not (digits e') || String.length e' > 5 then bad ();
    let v = int_of_string ("0u" ^ e') in
    if v > limit then bad ();
    if e.[0] = '-' then -v else v in
  (* digits with a point, in some base, times a power *)
  let pointed ok base m power e =
    let whole, part = cut '.' m in
    let part = Option.value part ~default:"" in
    if not (ok whole && ok part) || whole ^ part = "" then bad ();
    let z = signed (Z.of_string_base base (whole ^ part)) in
    let e = e - (if base = 16 then 4 else 1) * String.length part in
    if e >= 0 then of_z (Z.mul z (Z.pow (Z.of_int power) e)) else make z (Z.pow (Z.of_int power) (-e)) in
  if String.length t > 2 && t.[0] = '0' && (t.[1] = 'x' || t.[1] = 'X') then
    match cut 'p' (String.lowercase_ascii (String.sub t 2 (String.length t - 2))) with
    | m, Some e when m <> "" && m.[0] <> '.' -> pointed hexdigits 16 m 2 (exponent 1400 e)
    | _ -> bad ()
  else match cut '/' t with
    | a, Some b ->
        if not (digits a && digits b) || Z.equal (Z.of_string b) Z.zero then bad ();
        make (signed (Z.of_string a)) (Z.of_string b)
    | _, None ->
        let m, e = cut 'e' (String.lowercase_ascii t) in
        let e = match e with None -> 0 | Some e -> exponent 400 e in
        pointed (fun s -> s = "" || digits s) 10 m 10 e
(* sizes of section 17 of FORMAT.md, judged before anything is formed: of a common denominator in bits, of so many entries
   over it, and of the rows of a dense matrix *)
let most_common = 100_000 and most_bits = 400_000_000 and most_rows = 400
let limited what ?(entries = 0) (l : q list) =
  let too_long () = raise (Bad (what ^ ": numbers too long for exact arithmetic; round them")) in
  let common = List.fold_left (fun d (x : q) ->
    if Z.equal x.qden Z.one then d else
    let d = Z.lcm d x.qden in if Z.numbits d > most_common then too_long () else d) Z.one l in
  let widest = List.fold_left (fun a (x : q) -> Stdlib.max a (Z.numbits x.qnum)) 0 l in
  if (Z.numbits common + widest) * Stdlib.max entries (List.length l) > most_bits then too_long ()
let few_rows what n = if n > most_rows then raise (Bad (Printf.sprintf "%s of more than %d rows" what most_rows))
(* above the root, and near it *)
let root (v : q) : q =
  if Z.sign v.qnum <= 0 then zero else begin
    let bits = 80 + Stdlib.max 0 ((Z.numbits v.qden - Z.numbits v.qnum) / 2) in
    let scaled = Z.add (Z.div (Z.shift_left v.qnum (2 * bits)) v.qden) Z.one in
    make (Z.add (Z.sqrt scaled) Z.one) (Z.shift_left Z.one bits) end
