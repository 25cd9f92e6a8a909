"""Certify prescribed-time coordination control on signed digraphs.

import ptcc_certify as ptcc

g = ptcc.read_graph("graph.csv")
p = ptcc.NominalProtocol(T=0.6, rho1=0.1, rho2=0.3, kappa=1)
cert = ptcc.certify(g, p, x0=[5, 2, -4, 3, -2, 1])
cert.save("certificate.json")

The names at the top, by topic:

- Graphs: ``SignedDigraph``, ``as_graph``, ``as_state``, ``read_graph``, ``write_graph``, ``with_stubborn``,
  ``analyse``, ``Structure``
- Families of graphs: ``Family``, ``as_family``, ``read_family``, ``decide``, ``DwellTime``, ``JointWindows``,
  ``ClockShares``
- Protocols, disturbances, actuators: ``Agents``, ``companion_form``, ``NominalProtocol``, ``SlidingModeProtocol``,
  ``ExpressionDisturbance``, ``SampledDisturbance``, ``StateDependent``, ``telegraph_noise``, ``GainLimits``,
  ``LateMessages``, ``MovingLeaders``
- Runs: ``simulate``, ``Bounded``, ``simulate_late``, ``simulate_tracking``, ``Trajectory``
- Certificates: ``certify``, ``Certificate``, ``Asks``, ``InitialState``, ``Expectations``, ``read_certificate``,
  ``check``
- Bounds and design: ``final_state``, ``influence``, ``formation_of_biases``, ``box``, ``ellipsoid``,
  ``worst_initial_state``, ``design``, ``design_agents``
- Many graphs: ``Ensemble``, ``certify_many``
- Figures: ``plot_glance``, ``plot_influence``, ``plot_trajectory``, ``plot_decay``, ``plot_run``, ``plot_sliding``,
  ``plot_trade_off``, ``plot_input``, ``plot_effort``, ``plot_graph``, ``plot_spectrum``, ``plot_frontier``,
  ``plot_motion``, ``plot_formation``, ``plot_tracking``, ``save_figure``, ``SINGLE_COLUMN``, ``DOUBLE_COLUMN``,
  ``figures_for``
- Reports: ``write_report``, ``explore``, ``cite``
- Errors: ``PTCCError``

Everything else is in the rooms of the package, which are loaded when they are named: ``ptcc.errors.GraphError``,
``ptcc.theorems.lemmas.gauge``.

.. [Zhu] Z.-H. Zhu, H. Wu, Z.-H. Guan, Z.-W. Liu, Y. Chen, X. Zheng: Robust prescribed-time coordination control of
   cooperative-antagonistic networks with disturbances, manuscript; ``ptcc cite`` prints the BibTeX entry.
"""

import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from types import FunctionType
from typing import Any

_EXPORTS = {
    # Graphs
    "SignedDigraph": "graphs.digraph",
    "as_graph": "graphs.io",
    "as_state": "graphs.io",
    "read_graph": "graphs.io",
    "write_graph": "graphs.io",
    "analyse": "graphs.structure",
    "Structure": "graphs.structure",
    # Families of graphs
    "Family": "graphs.family",
    "as_family": "graphs.io",
    "with_stubborn": "graphs.io.with_stubborn",
    "read_family": "graphs.io",
    "decide": "theorems.family_behaviour",
    "DwellTime": "model.constrained_switching",
    "JointWindows": "model.constrained_switching",
    "ClockShares": "model.constrained_switching",
    # Protocols, disturbances, actuators
    "Agents": "model.agents",
    "companion_form": "model.companion",
    "NominalProtocol": "model",
    "SlidingModeProtocol": "model",
    "ExpressionDisturbance": "model.disturbance",
    "SampledDisturbance": "model.disturbance",
    "StateDependent": "model.disturbance",
    "telegraph_noise": "model.disturbance",
    "GainLimits": "model.asks",
    "LateMessages": "model.late_messages",
    "MovingLeaders": "model.late_messages",
    # Runs
    "simulate": "simulation.run",
    "Bounded": "simulation.nominal",
    "simulate_late": "simulation.late_messages",
    "simulate_tracking": "simulation.moving_leaders",
    "Trajectory": "simulation.trajectory",
    # Certificates
    "certify": "certificate.certification",
    "Certificate": "certificate.certificate",
    "Asks": "model.asks",
    "Expectations": "model.asks",
    "InitialState": "model.asks",
    "read_certificate": "certificate.certificate",
    "check": "certificate.checking",
    # Bounds and design
    "final_state": "bounds.final_state.of_graph",
    "influence": "bounds.final_state.of_graph",
    "formation_of_biases": "bounds.agents.formation",
    "box": "bounds.input.initial_sets",
    "ellipsoid": "bounds.input.initial_sets",
    "worst_initial_state": "bounds.input.worst_initial_state",
    "design": "gain_design.search",
    "design_agents": "gain_design.deadline_search",
    # Many graphs
    "Ensemble": "graphs.ensembles",
    "certify_many": "batch",
    # Figures
    "plot_glance": "report.plots.glance",
    "plot_motion": "report.plots.trajectory",
    "plot_formation": "report.plots.trajectory",
    "plot_trajectory": "report.plots.trajectory",
    "plot_decay": "report.plots.decay",
    "plot_run": "report.plots.trajectory",
    "plot_sliding": "report.plots.trajectory",
    "plot_trade_off": "report.plots.trade_off",
    "plot_input": "report.plots.input",
    "plot_effort": "report.plots.input",
    "plot_graph": "report.plots.graph",
    "plot_influence": "report.plots.influence",
    "plot_spectrum": "report.plots.spectrum",
    "plot_frontier": "report.plots.spectrum",
    "plot_tracking": "report.plots.tracking",
    "save_figure": "report.plots.style",
    "SINGLE_COLUMN": "report.plots.sizes",
    "DOUBLE_COLUMN": "report.plots.sizes",
    "figures_for": "report.plots.sizes",
    # Reports
    "write_report": "report.report_file",
    "explore": "report.explorer",
    "cite": "theorems.table",
    # Errors
    "PTCCError": "errors",
}
__all__ = [*_EXPORTS, "__version__"]


def modules_of(package: str) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: its modules are loaded when they are first named (PEP 562).

    Examples
    --------
    >>> ptcc.theorems.lemmas.gauge([("a", "b", -1)]).tolist()
    [1, -1]
    """

    def load(name: str) -> Any:
        if name.isidentifier() and not name.startswith("_") and find_spec(f"{package}.{name}") is not None:
            return import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=sys.modules[package])

    return load


_room = modules_of(__name__)


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        return _export(name)
    if name == "__version__":
        try:
            return version("ptcc-certify")
        except PackageNotFoundError:
            return "unknown"
    return _room(name)


@cache
def _export(name: str) -> Any:
    """Return what is public; a function with the gate for its calls, which belongs to this module, as pickle asks."""
    from ptcc_certify.errors import gated

    try:
        public = getattr(import_module(f"{__name__}.{_EXPORTS[name]}"), name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in ("", __name__, "lmi"):
            raise
        mend = "install ptcc-certify with its dependencies, without --no-deps"
        raise ModuleNotFoundError(f"{__name__}.{name} needs {error.name}; {mend}", name=error.name) from None
    if isinstance(public, FunctionType):
        public = gated(public)
        public.__module__ = __name__
    return public


def __dir__() -> list[str]:
    return __all__
