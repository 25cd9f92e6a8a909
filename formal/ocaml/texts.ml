(* The fixed texts of section 14 of FORMAT.md: kind, what it proves, lemma. *)
let obligations = [
  "structure", ("components, closedness, camps and negative cycles are those of the edges",
    "Lemma 1");
  "claim", ("the hypotheses of the theorem and of the corollaries hold",
    "Theorems 1 to 6, Corollaries 1 to 10");
  "deviation-decrease", ("Z L + L'Z - b Z > 0 modulo G1, Z = G (P - p p'/p'1) G, p near the left null vector of M(L)",
    "Lemma 3.1");
  "leader-decrease", ("L_k'(W L_k + L_k'W - b W)L_k > 0 modulo G_k 1, W the block, near the left null vector of M(L_k)",
    "Lemma 3.1");
  "leader-margin", ("W L_k + L_k'W - m I > 0, W the block of this component",
    "Lemma 3.2");
  "margin", ("S - m I > 0 for the matrix S whose least eigenvalue the objective takes",
    "Lyapunov decrease");
  "rho-interval", ("S(end) > 0 at both ends, so S(rho) > 0 in between",
    "Lemma 5");
  "rate", ("P L + L'P - b P > 0 on the range of L",
    "Lyapunov decrease");
  "dominance", ("S = P L + L'P - b P, (g_k - b) P_k for leader groups: S_ii d_i > sum_j |S_ij| d_j for a vector d > 0",
    "Lyapunov decrease");
  "overshoot", ("lowest I < P < highest I",
    "Rayleigh quotient");
  "deviation", ("(x_k - (Q x)_k)^2 <= c_k V for every agent, ||x - Q x||^2 <= c V",
    "Schur complement");
  "rate-upper-bound", ("H B + B'H > 0, B = A - (upper_bound/2) I, H negative on the vectors",
    "inertia of Lyapunov equations");
  "rate-mean", ("upper_bound = 2 trace(A)/r, A the block of L of a strong component, r of whose eigenvalues are not 0",
    "the least real part is not above the mean");
  "sliding-bound", ("mu1 > delta, mu2, mu3 > 0, so the bound holds and sigma = 0 from T_r on",
    "Proposition 1");
  "reaching-time", ("|sigma_k(0)| <= (mu1 - delta) int_0^t dr/psi(r) at z_k",
    "comparison with the worst-case disturbance");
  "input-threshold", ("nonzero eigenvalues of L have rho2 kappa Re lambda >= 1, semisimple where that is 1; or some has not",
    "gain e^(-lambda s) stays bounded, or not");
  "input-constants", ("e_k^2 <= c_k E'P E for every agent",
    "Schur complement");
  "input-sliding", ("|u_k - gain e_k| <= mu1 + (mu2 + mu3 kappa/T_r) |sigma_k(0)|",
    "Proposition 1");
  "input-peak", ("gain |e_k| <= peak_k up to the deadline",
    "|e_k| <= min(A_k, sqrt(c_k V(0)) e^(-rate s / 2))");
  "input-energy", ("int ||gain E||^2 dt <= energy",
    "the same in norm, or two Lyapunov equations");
  "input-length", ("int ||gain E|| dt <= path length",
    "the same in norm");
  "limited-gain", ("what remains at the deadline under gain saturation, switch-off or zero-order hold",
    "Lyapunov decrease");
  "nominal-disturbed", ("|d_k| <= delta adds at most these to the inputs of the nominal protocol and to where the agents end",
    "variation of constants");
  "final-state", ("L Q = 0 and Q(x - sigma) is kept, so the agents end at Q(X(0) - sigma(0))",
    "Lemmas 2, 8 and 9");
  "family-claim", ("all members have one kernel, or a state at rest in one member moves in another",
    "common kernel");
  "family-rate", ("P A + A'P - b P >= 0 for all members of the mode, P > 0",
    "Lyapunov decrease");
  "family-constants", ("|(L X)_k|^2 <= inputs_k V for every member, xi_k^2 <= coordinates_k V",
    "Schur complement");
  "family-rows", ("every row of the followers decays at this rate at the worst weights, and so does what they hear",
    "comparison row by row");
  "family-squares", ("P L(w-) + L(w-)'P - (1/2) diag_l(sum_k p_k (w+ - w-)) - b P > 0, P = diag(p)",
    "least weights, and what is above them");
  "family-drive", ("sqrt(V) of all states with |x_k| <= sum_l w+ (|sigma_k(0)| + |sigma_l(0)|) is at most this, in every mode",
    "variation of constants");
  "family-final-state", ("for every signal the agents end between these ends",
    "kept means, integral of the input");
  "family-input", ("for every signal the input is bounded, by these peaks",
    "integral of the input");
  "attracting-box", ("every row of the followers decays at this rate, and none leaves the box, at the worst weights",
    "an attracting box");
  "kept-box", ("for every signal each agent stays between these ends at all times",
    "extremes of what reaches an agent");
  "agent-positive", ("W > 0",
    "Lyapunov matrix of one agent");
  "agent-decrease", ("A W + W A' - b b' + rate W <= 0 at all values of zeta, by Bernstein matrices",
    "one matrix for all agents");
  "agent-coupling", ("K = c b'W^-1, and c times the rate of every function used is at least 1",
    "Lyapunov decrease of a Kronecker product");
  "agent-cascade", ("q = x' - eta e decays like e^(-alpha s); initial and drive are not below sqrt(V) of positions and of q(0)",
    "variation of constants");
  "agent-motion", ("the common motion is M times its initial value at the deadline",
    "one agent without neighbours");
  "agent-final-state", ("Q and M take the initial states to these final states",
    "L Q = 0 and Q L = 0");
  "agent-residual", ("what is left at the deadline with a bounded gain",
    "Schur complement");
  "agent-input", ("the input of no agent exceeds these",
    "error constants, Lyapunov decrease");
  "agent-phase", ("from this zeta on a function decays at this rate, by a matrix that is not below the former",
    "Lyapunov decrease of a Kronecker product");
  "agent-instants", ("where so many halves of the time are left, no function exceeds these values",
    "Lyapunov decrease, variation of constants");
]
(* and of section 13 *)
let sliding_bound = "||sigma(t)|| <= phi(t,T_r)^(-mu3) e^(-mu2 t) ||sigma(0)||"
let sliding_clock = "z = ln(T_r / (T_r - t)); null: certain at T_r only"
