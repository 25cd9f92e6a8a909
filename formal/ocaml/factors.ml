(* Sparse factors of leader groups, as section 14 of FORMAT.md has them, handed to the check as integers: places instead of
   rows, one scale for each. Nothing here is believed but by what the check makes of it. *)
open Checker
open Json
open Document
module Z = Number.Z

let keys = [ "order"; "indptr"; "indices"; "data"; "exponents"; "bits"; "power" ]
let largest_shift = 65_536 and largest_bits = 400_000_000
let small what v = match v with Num s when String.length s <= 18 -> int_of_string s | _ -> bad (what ^ ": an integer of at most 18 digits is due")
let ints what count v = map (fun z -> if Z.fits_int z then Z.to_int z else bad (what ^ ": an integer is too large")) (integers what count v)

(* weights in lowest terms: integers, and the rational that they are multiplied by *)
let in_ratios weights =
  let d = List.fold_left (fun d (q : q) -> Z.lcm d q.qden) Z.one weights in
  let whole = List.map (fun (q : q) -> Z.mul q.qnum (Z.divexact d q.qden)) weights in
  let g = List.fold_left Z.gcd Z.zero whole in
  List.map (fun z -> Z.divexact z g) whole, Number.make g d
(* edges of a tree that is given by the place of each node's parent, those of the deepest nodes first; its root *)
let tree own parents =
  let m = Array.length own in
  let parents = Array.of_list parents in
  let no_tree () = bad "parents are not those of a tree" in
  let depth = Array.make m (-1) in
  let rec deep i left =
    if left < 0 || i < 0 || i >= m then no_tree ();
    if depth.(i) < 0 then depth.(i) <- if parents.(i) = -1 then 0 else 1 + deep parents.(i) (left - 1);
    depth.(i) in
  for i = 0 to m - 1 do ignore (deep i m) done;
  match List.filter (fun i -> parents.(i) = -1) (List.init m Fun.id) with
  | [ root ] ->
      let others = List.filter (fun i -> i <> root) (List.init m Fun.id) in
      root, others, List.stable_sort (fun i j -> compare depth.(j) depth.(i)) others |> List.map (fun i -> i, parents.(i))
  | _ -> no_tree ()

let largest_dense = 400
let ratios (weights : q array) own = List.map2 (fun i z -> i, z) own (fst (in_ratios (List.map (fun i -> weights.(i)) own)))
let same number rate ratios (f : fact) = f.whose = number && Number.equal f.decays rate
  && List.for_all2 (fun (i, a) (j, b) -> i = j && Z.equal a b) f.ratios ratios
let of_group (edges : edge list) number (one : comp) weights rate v : fact =
  let get = fields "factor" ~may:[ "weights"; "parents" ] keys v in
  let own = Array.of_list one.nodes in
  let gauge = match one.camps with Gauge g -> Some (Array.of_list g) | Cycle _ -> None in
  let m = Array.length own in
  let n = if gauge = None then m else m - 1 in
  let count k c = ints k c (get k) in
  let order = Array.of_list (count "order" n) and exponents = Array.of_list (count "exponents" n) in
  need (List.sort compare (Array.to_list order) = List.init n Fun.id) "a factor: order is no permutation";
  let indptr = Array.of_list (count "indptr" (n + 1)) in
  let entries_ = indptr.(n) in
  need (indptr.(0) = 0 && entries_ <= n * (n + 1) / 2) "a factor has too many entries";
  Array.iteri (fun j a -> if j > 0 then need (a >= indptr.(j - 1)) "a factor: indptr descends") indptr;
  let indices = Array.of_list (count "indices" entries_) and data = Array.of_list (integers "data" entries_ (get "data")) in
  let columns_of = List.init n (fun j ->
    let last = ref (j - 1) in
    List.init (indptr.(j + 1) - indptr.(j)) (fun k ->
      let i = indices.(indptr.(j) + k) in
      need (i > !last && i < n) "a factor: rows of a column do not ascend"; last := i;
      i, data.(indptr.(j) + k))) in
  let spread = match get "weights" with Null -> List.init n (fun _ -> Z.one) | w -> integers "weights" n w in
  let bits = small "bits" (get "bits") and power = small "power" (get "power") in
  Array.iter (fun e -> need (abs e <= largest_shift) "a factor: an exponent is too large") (Array.append exponents [| bits; power |]);
  let r, times = in_ratios (List.map (fun i -> weights.(i)) one.nodes) in
  let ratios = List.map2 (fun i z -> i, z) one.nodes r in
  let signs = Option.map (fun g -> fun k -> g.(own.(k))) gauge in
  let how, column, sign = match signs, get "parents" with
    | None, Null -> Whole, (fun j -> j), fun _ -> Z.one
    | None, _ -> bad "parents of a group that is not balanced"
    | Some s, Null -> Pinned (own.(0), List.init m (fun k -> own.(k), s k)), (fun j -> j + 1), fun _ -> Z.one
    | Some s, p ->
        let parents = ints "parents" m p in
        let up = Array.of_list parents in
        let root, others, hops = tree own parents in
        let others = Array.of_list others in
        Tree (own.(root), List.mapi (fun k z -> own.(k), Z.mul (s k) z) r, List.map (fun (i, q) -> own.(i), own.(q)) hops),
        (fun j -> others.(j)), fun k -> Z.mul (s k) (s up.(k)) in
  let low = Array.fold_left min 0 exponents and high = Array.fold_left max 0 exponents in
  let shift = -2 * low - 2 * bits - power in
  need ((2 * (high - low) + abs shift) * (List.length edges + n) <= largest_bits) "a factor is scaled too far";
  let eliminated = List.map (fun j -> let k = column j in own.(k), Z.shift_left (sign k) (exponents.(j) - low)) (Array.to_list order) in
  let ls = Checker.common (List.map (fun e -> e.wt) edges) in
  let squared = match how with Pinned _ -> Z.mul ls ls | _ -> Z.one in
  let above = Z.mul (Z.mul ls rate.qden) (Z.mul squared times.qden) and below = times.qnum in
  let above = if shift > 0 then Z.shift_left above shift else above
  and below = if shift < 0 then Z.shift_left below (- shift) else below in
  let g = Z.gcd above below in
  { whose = number; decays = rate; ratios;
    factor_is = { how; eliminated; by_times = Z.divexact below g; by_squares = Z.divexact above g; columns_of; spread } }
