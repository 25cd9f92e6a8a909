"""What a certificate may prove, and the report of a check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

#: What each kind of obligation states, and what makes it part of the claim.
OBLIGATIONS = {
    "structure": ("components, closedness, camps and negative cycles are those of the edges", "Lemma 1"),
    "claim": ("the hypotheses of the theorem and of the corollaries hold", "Theorems 1 to 6, Corollaries 1 to 10"),
    "deviation-decrease": (
        "Z L + L'Z - b Z > 0 modulo G1, Z = G (P - p p'/p'1) G, p near the left null vector of M(L)",
        "Lemma 3.1",
    ),
    "leader-decrease": (
        "L_k'(W L_k + L_k'W - b W)L_k > 0 modulo G_k 1, W the block, near the left null vector of M(L_k)",
        "Lemma 3.1",
    ),
    "leader-margin": ("W L_k + L_k'W - m I > 0, W the block of this component", "Lemma 3.2"),
    "margin": ("S - m I > 0 for the matrix S whose least eigenvalue the objective takes", "Lyapunov decrease"),
    "rho-interval": ("S(end) > 0 at both ends, so S(rho) > 0 in between", "Lemma 5"),
    "rate": ("P L + L'P - b P > 0 on the range of L", "Lyapunov decrease"),
    "dominance": (
        "S = P L + L'P - b P, (g_k - b) P_k for leader groups: S_ii d_i > sum_j |S_ij| d_j for a vector d > 0",
        "Lyapunov decrease",
    ),
    "prefactor": ("lowest I < P < highest I", "Rayleigh quotient"),
    "distance": ("(x_k - (Q x)_k)^2 <= c_k V for every agent, ||x - Q x||^2 <= c V", "Schur complement"),
    "rate-limit": ("H B + B'H > 0, B = A - (limit/2) I, H negative on the vectors", "inertia of Lyapunov equations"),
    "rate-mean": (
        "limit = 2 trace(A)/r, A the block of L of a strong component, r of whose eigenvalues are not 0",
        "the least real part is not above the mean",
    ),
    "sliding-bound": ("mu1 > delta, mu2, mu3 > 0, so the bound holds and sigma = 0 from T_r on", "Proposition 1"),
    "reaching-time": ("|sigma_k(0)| <= (mu1 - delta) int_0^t dr/psi(r) at z_k", "comparison with the adversary"),
    "input-threshold": (
        "nonzero eigenvalues of L have rho2 kappa Re lambda >= 1, semisimple where that is 1; or some has not",
        "gain e^(-lambda s) stays bounded, or not",
    ),
    "input-constants": ("e_k^2 <= c_k E'P E for every agent", "Schur complement"),
    "input-peak": ("gain |e_k| <= peak_k up to the deadline", "|e_k| <= min(held_k, sqrt(c_k V(0)) e^(-rate s / 2))"),
    "input-energy": ("int ||gain E||^2 dt <= energy", "the same in norm, or two Lyapunov equations"),
    "input-length": ("int ||gain E|| dt <= path length", "the same in norm"),
    "input-sliding": ("|u_k - gain e_k| <= mu1 + (mu2 + mu3 kappa/T_r) |sigma_k(0)|", "Proposition 1"),
    "limited-gain": ("what is left at the deadline if the gain is capped, stopped or held", "Lyapunov decrease"),
    "nominal-disturbed": (
        "|d_k| <= delta adds at most these to the inputs of the nominal protocol and to where the agents end",
        "variation of constants",
    ),
    "outcome": ("L Q = 0 and Q(x - sigma) is kept, so the agents end at Q(X(0) - sigma(0))", "Lemmas 2, 8 and 9"),
}


@dataclass(frozen=True)
class Statement:
    """What an obligation states: its kind, and the part of the certificate that it is about."""

    kind: str
    of: str

    @property
    def statement(self) -> str:
        """What is stated."""
        return OBLIGATIONS[self.kind][0]

    @property
    def lemma(self) -> str:
        """What makes the statement part of the claim."""
        return OBLIGATIONS[self.kind][1]


@dataclass(frozen=True)
class Step(Statement):
    """One obligation that was verified, and what was verified."""

    detail: str


@dataclass(frozen=True)
class CheckReport:
    """What came of a check.

    Attributes
    ----------
    accepted : bool
        Every claim outside ``unverified`` was verified.
    verdict : str
        Of the certificate: ``certified`` or ``undecided``.
    steps : tuple of Step
        The obligations that were verified, in order.
    rejected : str or None
        The obligation, or the part of the document, that was not.
    reason : str or None
        Why it was not.
    arithmetic : str
        What the numbers were computed with.
    sha256 : str
        Of the graph.
    memory : float
        The ``memory``, in GB, for which all that was checked is allowed.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify, check
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> document = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), simulation=False).to_dict()
    >>> check(document).accepted, check(document | {"verdict": "undecided"}).rejected
    (True, 'verdict')
    """

    accepted: bool
    verdict: str
    steps: tuple[Step, ...]
    rejected: str | None
    reason: str | None
    arithmetic: str
    sha256: str
    memory: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON-ready data."""
        steps = [{"kind": s.kind, "of": s.of, "verified": s.detail, "lemma": s.lemma} for s in self.steps]
        return {
            "accepted": self.accepted,
            "verdict": self.verdict,
            "obligations": steps,
            "rejected": self.rejected,
            "reason": self.reason,
            "arithmetic": self.arithmetic,
            "graph_sha256": self.sha256,
        }

    def lines(self) -> list[str]:
        """Return the report as text, one line for each obligation."""
        lines = [f"verified   {step.kind} of {step.of}: {step.detail} ({step.lemma})" for step in self.steps]
        if self.accepted:
            return [*lines, f"accepted   {self.verdict}; {len(self.steps)} obligation(s) by {self.arithmetic}"]
        return [*lines, f"rejected   {self.rejected}: {self.reason}"]
