"""Certify prescribed-time coordination control on signed digraphs.

import ptcc_certify as ptcc

g = ptcc.read_graph("graph.csv")
p = ptcc.NominalProtocol(T=0.6, rho1=0.1, rho2=0.3, kappa=1)
cert = ptcc.certify(g, p, x0=[5, 2, -4, 3, -2, 1])
cert.save("certificate.json")

.. [Zhu] Z.-H. Zhu, H. Wu, Z.-H. Guan, Z.-W. Liu, Y. Chen, X. Zheng: Robust prescribed-time coordination control of
   cooperative-antagonistic networks with disturbances, manuscript; ``ptcc cite`` prints the BibTeX entry.
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
    "SignedDigraph": "graphs.digraph",
    "as_graph": "graphs.io",
    "as_state": "graphs.io",
    "read_graph": "graphs.io",
    "write_graph": "graphs.io",
    "read_state": "graphs.io",
    "Structure": "graphs.structure",
    "Claim": "theorems.claims",
    "ClosedComponent": "graphs.structure",
    "WeakComponent": "graphs.structure",
    "analyse": "graphs.structure",
    "Gain": "protocols.gain",
    "prescribed_time_bound": "protocols.gain",
    "NominalProtocol": "protocols",
    "SlidingModeProtocol": "protocols",
    "ExpressionDisturbance": "protocols.disturbance",
    "SampledDisturbance": "protocols.disturbance",
    "WorstCaseDisturbance": "protocols.disturbance",
    "StateDependent": "protocols.disturbance",
    "telegraph_noise": "protocols.disturbance",
    "ReachingTime": "protocols.reaching_time",
    "certified_reaching_times": "protocols.reaching_time",
    "Trajectory": "simulation.trajectory",
    "SlidingTrajectory": "simulation.trajectory",
    "simulate": "simulation.run",
    "FinalState": "bounds.final_state",
    "Influence": "bounds.final_state",
    "final_state": "bounds.final_state",
    "influence": "bounds.final_state",
    "is_prescribed_time_stable": "bounds.behaviours",
    "is_stability": "bounds.behaviours",
    "is_bipartite_consensus": "bounds.behaviours",
    "is_interval_bipartite_consensus": "bounds.behaviours",
    "is_bipartite_containment": "bounds.behaviours",
    "gauge": "theorems.lemmas",
    "left_vector": "theorems.lemmas",
    "exact_left_vector": "theorems.lemmas",
    "laplacian_spectrum": "theorems.lemmas",
    "algebraic_connectivity": "theorems.lemmas",
    "unbalanced_lyapunov": "theorems.lemmas",
    "follower_lyapunov": "theorems.lemmas",
    "containment_weights": "theorems.lemmas",
    "exact_containment_weights": "theorems.lemmas",
    "Envelope": "bounds.envelope",
    "SlidingEnvelope": "bounds.sliding_envelope",
    "Comparison": "bounds.envelope",
    "Certificate": "certificate.certificate",
    "certify": "certificate.procedure",
    "certify_vectors": "certificate.vector_states",
    "Expectations": "certificate.request",
    "Assessment": "certificate.verdict",
    "RejectedCertificate": "certificate.certificate",
    "read_certificate": "certificate.certificate",
    "report_html": "report.page",
    "report_latex": "report.statement",
    "write_report": "report.report_file",
    "Ensemble": "graphs.ensembles",
    "certify_many": "batch",
    "Actuator": "protocols.gain_limits",
    "GainLimits": "protocols.gain_limits",
    "InitialSet": "checker.input_formulas",
    "initial_set_within": "bounds.input.initial_set",
    "box": "bounds.input.initial_set",
    "ellipsoid": "bounds.input.initial_set",
    "Effort": "bounds.input.effort",
    "WorstInitialState": "bounds.input.worst_initial_state",
    "worst_initial_state": "bounds.input.worst_initial_state",
    "Design": "gain_design",
    "design": "gain_design",
    "check": "certificate.checking",
    "CheckReport": "checker",
    "SymbolicLyapunov": "theorems.symbolic",
    "symbolic_lyapunov": "theorems.symbolic",
    "SymbolicSliding": "theorems.symbolic",
    "symbolic_sliding": "theorems.symbolic",
    "THEOREMS": "theorems.table",
    "theorem_for": "theorems.table",
    "plot_trajectory": "report.plots.trajectory",
    "plot_decay": "report.plots.decay",
    "plot_run": "report.plots.trajectory",
    "plot_sliding": "report.plots.trajectory",
    "plot_trade_off": "report.plots.trade_off",
    "plot_input": "report.plots.input",
    "plot_effort": "report.plots.input",
    "plot_graph": "report.plots.graph",
    "plot_spectrum": "report.plots.spectrum",
    "plot_frontier": "report.plots.spectrum",
    "explore": "report.explorer",
    "save_figure": "report.plots.style",
    "SINGLE_COLUMN": "report.plots.style",
    "DOUBLE_COLUMN": "report.plots.style",
}
__all__ = sorted(_EXPORTS)


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        return getattr(import_module(f"{__name__}.{_EXPORTS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
