(* The parts of the check one by one, to name the first that fails where [Checker.check] says no. *)
open Checker
let of_check c d : (string * (unit -> bool)) list =
  [ "graph: an edge", (fun () -> check_edges c d.dls);
    "gain: a parameter", (fun () -> check_protocol c);
    "structure of graph.modes[0]", (fun () -> check_structure c);
    "final-state of graph", (fun () -> check_end c d);
    "final-state of graph: where the components end", (fun () -> check_behaviour c d);
    "claim of graph", (fun () -> check_claims c d) ]
  @ List.mapi (fun k f -> Printf.sprintf "decays[%d]" k, (fun () -> check_function c d f)) c.funcs
  @ [ "final-state of graph: no Lyapunov function proves that it is reached", (fun () -> check_reached c d);
      "final_state: not what was proved", (fun () -> check_final c d);
      "influence.degenerate: other components end at 0", (fun () -> check_degenerate c d);
      "input-threshold of input", (fun () -> check_input c d);
      "rates, or overshoot, are not what was proved", (fun () -> check_rates c);
      "input-sliding of input", (fun () -> check_sliding_input c);
      "reaching-time of reaching_time", (fun () -> check_reaching c) ]
  @ List.mapi (fun k m -> Printf.sprintf "paper: inequality %d of its own function" (k + 1), (fun () -> check_margin c d m)) c.margins
  @ List.mapi (fun k l -> Printf.sprintf "leader-decrease of paper, group %d" (k + 1), (fun () -> check_leader c d l)) c.leaders
  @ (match c.upper_bound with
     | Some u -> [ (match u.because with ByTrace -> "rate-mean of rates" | ByForm _ -> "rate-upper-bound of rates"),
         (fun () -> check_upper c d u) ]
     | None -> [])
  @ List.map (fun e -> (match e with
      | Peak _ -> "input-peak of input" | Energy _ | EnergyBy _ -> "input-energy of input" | PathLength _ -> "input-length of input"),
      (fun () -> check_effort c d e)) c.efforts
let of_large (h : hints) c : (string * (unit -> bool)) list =
  [ "graph: an edge", (fun () -> check_edges c (common (List.map (fun e -> e.wt) c.edges)));
    "gain: a parameter", (fun () -> check_protocol c);
    "structure of graph.modes[0]", (fun () -> wide_structure c);
    "claim of graph", (fun () -> wide_claims c);
    "dominance of a Lyapunov function", (fun () -> check_functions c h.vectors h.facts);
    "final-state of graph: no Lyapunov function proves that it is reached", (fun () -> check_moves c);
    "final-state of graph", (fun () -> check_final_large c h.lefts h.around);
    "input-threshold of input", (fun () -> check_input_large c);
    "rates, or overshoot, are not what was proved", (fun () -> check_rates c);
    "input-sliding of input", (fun () -> check_sliding_input c);
    "reaching-time of reaching_time", (fun () -> check_reaching c) ]
let of_either h c d = if c.enclosed then of_large h c else of_check c (Lazy.force d)
