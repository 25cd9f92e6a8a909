(* Side files of section 3 of FORMAT.md: vectors of 64-bit integers or floats beside the certificate, each named with its
   SHA-256. *)
open Json
module Z = Number.Z

(* the folder of the certificate *)
let folder = ref "."
let bad m = raise (Bad m)
type column = Integers of Z.t list | Floats of float list

let content name largest =
  let path = Filename.concat !folder name in
  if not (Sys.file_exists path) || Sys.is_directory path then bad ("side file " ^ name ^ " cannot be read");
  let c = try open_in_bin path with Sys_error _ -> bad ("side file " ^ name ^ " cannot be read") in
  Fun.protect ~finally:(fun () -> close_in_noerr c) (fun () ->
    let size = in_channel_length c in
    if size > largest then bad ("side file " ^ name ^ " is not a vector of so few numbers");
    try really_input_string c size with End_of_file | Sys_error _ -> bad ("side file " ^ name ^ " cannot be read"))
(* {"file", "sha256"} with so many entries *)
let column v count =
  let get = match v with
    | Obj l when List.sort compare (List.map fst l) = [ "file"; "sha256" ] -> fun k -> (match List.assoc k l with Str s -> s | _ -> bad "a side file: a text is due")
    | _ -> bad "a side file has a name and a SHA-256, and no more" in
  let name = get "file" in
  let plain = function 'A' .. 'Z' | 'a' .. 'z' | '0' .. '9' | '_' | '.' | '-' -> true | _ -> false in
  if name = "" || String.length name > 200 || not (String.for_all plain name) then bad "a side file's name is odd";
  let s = content name (8 * count + 1024) in
  if Sha256.hex s <> get "sha256" then bad ("side file " ^ name ^ " is not what its hash says");
  let wrong () = bad (Printf.sprintf "side file %s is not a vector of %d numbers" name count) in
  let start = String.length s - 8 * count in
  if start < 12 || String.sub s 0 8 <> "\x93NUMPY\x01\x00" || 10 + String.get_uint16_le s 8 <> start then wrong ();
  let header = String.sub s 10 (start - 10) in
  let expected kind = Printf.sprintf "{'descr': '<%c8', 'fortran_order': False, 'shape': (%d,), }" kind count in
  let rest = String.length header - String.length (expected 'i') in
  if rest < 1 || String.sub header (String.length header - rest) rest <> String.make (rest - 1) ' ' ^ "\n" then wrong ();
  let at k = String.get_int64_le s (start + 8 * k) in
  match String.sub header 0 (String.length (expected 'i')) with
  | h when h = expected 'i' -> Integers (List.init count (fun k -> Z.of_int64 (at k)))
  | h when h = expected 'f' -> Floats (List.init count (fun k ->
      let x = Int64.float_of_bits (at k) in
      if not (Float.is_finite x) then bad ("side file " ^ name ^ ": a number is not finite"); x))
  | _ -> wrong ()
let exactly x = (* a float as the rational that it is *)
  let m, e = Float.frexp x in
  let z = Z.of_float (Float.ldexp m 53) and e = e - 53 in
  if e >= 0 then Number.of_z (Z.shift_left z e) else Number.make z (Z.shift_left Z.one (-e))

(* a side vector of so many entries: its column, and its scale *)
let vector what count v = match v with
  | Obj l ->
      if List.assoc_opt "count" l <> Some (Num (string_of_int count)) then bad (Printf.sprintf "%s has not %d entries" what count);
      column (Obj (List.filter (fun (k, _) -> k <> "count" && k <> "scale") l)) count, List.assoc_opt "scale" l
  | _ -> bad (what ^ ": a side vector is due")
let integers what count v = match vector what count v with
  | Integers l, None -> l
  | _ -> bad (what ^ ": integers are due, without a scale")
let numbers what count v = match vector what count v with
  | Floats l, None -> List.rev (List.rev_map exactly l)
  | Floats _, Some _ -> bad (what ^ ": only integers have a scale")
  | Integers l, None -> List.rev (List.rev_map Number.of_z l)
  | Integers l, Some (Str s) ->
      let scale = Number.rational s in
      if Z.sign scale.Checker.qnum <= 0 then bad (what ^ ": the scale is not positive");
      List.rev (List.rev_map (fun z -> Number.div (Number.of_z z) scale) l)
  | _ -> bad (what ^ ": the scale is no number")
