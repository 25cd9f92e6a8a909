"""Certify prescribed-time coordination control on signed digraphs.

import ptcc_certify as ptcc

g = ptcc.read_graph("graph.csv")
p = ptcc.NominalProtocol(T=0.6, rho1=0.1, rho2=0.3, kappa=1)
cert = ptcc.certify(g, p, x0=[5, 2, -4, 3, -2, 1])
cert.save("certificate.json")
"""

from importlib import import_module
from typing import Any

_EXPORTS = {
    "PTCCError": "errors",
    "NumberError": "errors",
    "GraphError": "errors",
    "FormatError": "errors",
    "ParameterError": "errors",
    "HypothesisError": "errors",
    "SimulationError": "errors",
    "SignedDigraph": "graph",
    "read_graph": "io",
    "write_graph": "io",
    "read_state": "io",
    "Structure": "structure",
    "Claim": "structure",
    "ClosedComponent": "structure",
    "WeakComponent": "structure",
    "analyse": "structure",
    "Gain": "gain",
    "prescribed_time_bound": "gain",
    "NominalProtocol": "protocols",
    "SlidingModeProtocol": "protocols",
    "ExpressionDisturbance": "disturbance",
    "SampledDisturbance": "disturbance",
    "Adversary": "disturbance",
    "StateDependent": "disturbance",
    "telegraph_noise": "disturbance",
    "ReachingTime": "reaching",
    "certified_reaching_times": "reaching",
    "Trajectory": "trajectory",
    "SlidingTrajectory": "trajectory",
    "simulate": "simulation",
    "Outcome": "outcomes",
    "Influence": "outcomes",
    "outcome": "outcomes",
    "influence": "outcomes",
    "is_prescribed_time_stable": "outcomes",
    "is_stability": "outcomes",
    "is_bipartite_consensus": "outcomes",
    "is_interval_bipartite_consensus": "outcomes",
    "is_bipartite_containment": "outcomes",
    "gauge": "lemmas",
    "left_vector": "lemmas",
    "exact_left_vector": "lemmas",
    "laplacian_spectrum": "lemmas",
    "algebraic_connectivity": "lemmas",
    "unbalanced_lyapunov": "lemmas",
    "follower_lyapunov": "lemmas",
    "containment_weights": "lemmas",
    "exact_containment_weights": "lemmas",
    "Envelope": "bounds",
    "SlidingEnvelope": "sliding_bounds",
    "Comparison": "bounds",
    "Certificate": "certificate",
    "certify": "certificate",
    "Expectations": "verdict",
    "Assessment": "verdict",
    "SavedCertificate": "saved",
    "RejectedCertificate": "saved",
    "read_certificate": "saved",
    "report_html": "report",
    "report_latex": "report",
    "write_report": "report",
    "Ensemble": "ensembles",
    "certify_many": "batch",
    "Actuator": "actuator",
    "Starts": "input_bounds",
    "starts_within": "effort",
    "box": "effort",
    "ellipsoid": "effort",
    "Effort": "effort",
    "WorstStart": "effort",
    "worst_start": "effort",
    "Design": "gain_design",
    "design": "gain_design",
    "check": "checker",
    "CheckReport": "checker",
    "SymbolicLyapunov": "symbolic",
    "symbolic_lyapunov": "symbolic",
    "SymbolicSliding": "symbolic",
    "symbolic_sliding": "symbolic",
    "THEOREMS": "theorems",
    "theorem_for": "theorems",
    "plot_trajectory": "plots",
    "plot_decay": "plots",
    "plot_run": "plots",
    "plot_sliding": "plots",
    "plot_trade_off": "plots",
    "plot_input": "plots",
    "plot_effort": "plots",
    "plot_graph": "plots",
    "plot_spectrum": "plots",
    "plot_frontier": "plots",
    "explore": "explorer",
    "save_figure": "plots",
    "SINGLE_COLUMN": "plots",
    "DOUBLE_COLUMN": "plots",
}
__all__ = sorted(_EXPORTS)


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        return getattr(import_module(f"{__name__}.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
