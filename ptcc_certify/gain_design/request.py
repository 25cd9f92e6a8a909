"""What is asked of an input, and what a certificate proves of its gains."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from ptcc_certify.checker.input_formulas import InitialSet, InputBounds
from ptcc_certify.graphs.declared_option import option

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is asked of an input from a given initial state.

    Attributes
    ----------
    max_input : Fraction
        ``U``, of the Euclidean norm of every agent's input; in units of the input.
    deadline, residual : Fraction or None
        In units of time and of the states; None where nothing is asked. The residual is that of every agent at the
        deadline, of agents of order n that of positions.
    """

    section: ClassVar = "design"
    max_input: Fraction
    deadline: Fraction | None = option("--deadline T", "Ask for this deadline ..", required=True, unit="time")
    residual: Fraction | None = option(
        "--residual r",
        "Every agent may be so far from its final state at the deadline.",
        required=True,
        example="0.01",
        unit="state",
    )

    def met_by(self, fit: Any) -> bool:
        """Tell whether what is proved of some gains suffices: ``fit.peak`` and ``fit.residual``, None if unknown."""
        if fit.peak is None or fit.residual is None:
            return False
        return fit.peak <= self.max_input and fit.residual <= (self.residual or 0)


@dataclass(frozen=True, kw_only=True)
class DesignRequest(Request):
    """What is asked of an input from all initial states of a set.

    Attributes
    ----------
    input_norm : {2, None}
        2: ``max_input`` is of ``||u||_2``. None: of every agent's input.
    initial_set : InitialSet
        For all of which it is to hold.
    """

    section: ClassVar = "design"
    input_norm: int | None = option(
        "--input-norm", "2: U bounds ||u||, not each |u_k|.", required=True, example='"2"', choices=("2",)
    )
    initial_set: InitialSet


class Fit(NamedTuple):
    """Gains at a deadline, and what is proved of them; None where nothing is."""

    deadline: Fraction
    certificate: Certificate
    peak: Fraction | None
    residual: Fraction | None


def fit_of(cert: Certificate, request: DesignRequest) -> Fit:
    """Return what a certificate proves of its gains: the peak of the input, and what is left at the deadline."""
    T, effort = cert.protocol.T, cert.graph_proof.effort
    by_norm = request.input_norm == 2
    if not cert.limits:
        if effort is None or effort.peak is None:
            moves = any(input_bounds(cert, request.initial_set).error_bounds)
            return Fit(T, cert, None if moves else Fraction(0), Fraction(0))
        return Fit(T, cert, effort.peak.norm if by_norm else effort.peak.largest, Fraction(0))
    cap = cert.limits[0].gain_cap
    entries = effort.residual if effort is not None else ()
    if cap is None or not entries or entries[0].agents is None:
        return Fit(T, cert, None, None)
    peak = cap * input_bounds(cert, request.initial_set).error_norm if by_norm else entries[0].largest
    return Fit(T, cert, peak, max(entries[0].agents))


def input_bounds(base: Certificate, initial_set: InitialSet) -> InputBounds:
    """Return what bounds the input."""
    proof = base.graph_proof
    constants = proof.effort.constants if proof.effort is not None else ()
    rows = proof.graph.exact_rows(range(proof.graph.n_nodes))
    return InputBounds(rows, base.protocol.gain.exact, proof.forms, constants, initial_set)
