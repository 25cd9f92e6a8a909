"""How near agents are to where they end, for restricted signals: from the forms of the modes that are claimed.

References
----------
docs/theory/families.md, "Dwell times".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.exact.numbers import integers
from ptcc_certify.bounds.deviation.component_bounds import ComponentBounds, FunctionOf
from ptcc_certify.bounds.instants import Instants
from ptcc_certify.certificate.constrained_switching.claims import RateClaim
from ptcc_certify.certificate.family_proof import ComponentProof, FamilyProof
from ptcc_certify.checker.common_forms import Scaled
from ptcc_certify.checker.common_kernel_ends import WeightedMean
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient
from ptcc_certify.lyapunov.mode_forms import mode_functions
from ptcc_certify.model.constrained_switching import DwellTime

#: Longest product of the factors at all switches, in bits.
_BITS = 2000


@dataclass(frozen=True)
class SwitchedFunction:
    """``V`` of the present mode, as the formulas of bounds take a function: ``V <= factor e^(-rate s) V(0)``.

    Attributes
    ----------
    functions : sequence of CommonForm
        Of each mode its form.
    rate, factor : Fraction
    """

    functions: Sequence[CommonForm]
    rate: Fraction
    factor: Fraction

    @property
    def speeds(self) -> list[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)`` in every mode."""
        return [_largest([scaled for V in self.functions for scaled in V.speeds])]

    @property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)`` in every mode."""
        return [_largest([scaled for V in self.functions for scaled in V.sizes])]

    @property
    def means(self) -> list[WeightedMean]:
        """None: final states are those of every signal."""
        return []

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(factor V(0))`` of a state, whatever the first mode."""
        return root_above(self.factor) * max(V.root(x) for V in self.functions)

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Bound ``factor V(0)`` of all states with ``|x_k| <= sizes_k``."""
        return self.factor * max(V.largest(sizes) for V in self.functions)


def deviation_of_signal(proof: FamilyProof, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
    """Bound ``|x_k(t) - x_k(T)|`` for the signals that were asked for, (N, M); what holds for every signal counts.

    Parameters
    ----------
    proof : FamilyProof
        With an initial state.
    remaining : (M,) array_like
        ``1 - t/T`` at the instants, in [0, 1].

    Examples
    --------
    >>> from ptcc_certify.model.constrained_switching import DwellTime
    >>> one, other = [("a", "b", 1), ("b", "c", -4)], [("b", "a", 1), ("a", "c", -1)]
    >>> modes = {"one": SignedDigraph.from_edges(one), "other": SignedDigraph.from_edges(other)}
    >>> cert = certify(modes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2, 3], signal=DwellTime(1, clock="t"))
    >>> bool((deviation_of_signal(cert, [0.01]) <= cert.deviation_bound([0.01])).all())
    True
    """
    bounds = proof.deviation_bound(remaining)
    if not (claims := claims_with_forms(proof)):
        return bounds
    clock = np.asarray(proof.protocol.gain.clock_at_remaining(np.atleast_1d(remaining)))
    for claim in claims:
        part = proof.parts[claim.component]
        nodes = part.component.nodes
        x = [proof.initial_state[v] for v in nodes.tolist()]  # type: ignore[index]
        bounds[nodes] = np.minimum(bounds[nodes], _deviation(proof, claim, part, x, Instants(clock)))
    return bounds


def nearer_for_signal(proof: FamilyProof) -> bool:
    """Tell whether more is proved of the decay for the signals that were asked for than for every signal."""
    return proof.common and proof.rate_of_signal is not None and bool(claims_with_forms(proof))


def claims_with_forms(proof: FamilyProof) -> list[RateClaim]:
    """Return the claims of rates that no function for every signal proves."""
    rates = (claim for claim in proof.restricted if isinstance(claim, RateClaim))
    return [claim for claim in rates if claim.forms is not None and claim.rate > 0]


def _deviation(
    proof: FamilyProof, claim: RateClaim, part: ComponentProof, x: Sequence[Fraction], at: Instants
) -> np.ndarray:
    """Bound the agents of a component; infinite where so many switches are allowed that nothing would be said."""
    assert claim.forms is not None
    functions = mode_functions(Quotient.of(part.component), claim.forms)
    everybody, nothing = np.arange(len(x)), np.full((len(x), at.clock.size), np.inf)

    def by(V: CommonForm | SwitchedFunction) -> np.ndarray:
        return ComponentBounds([FunctionOf(everybody, V, part.rest_states)], x).by_functions(at)

    if not all(V.input_constants for V in functions):
        return nothing
    if not isinstance(claim.signal, DwellTime):  # one mode acts for ever
        return np.max([by(V) for V in functions], axis=0)
    switches = claim.signal.switches(proof.protocol.T) if claim.signal.clock == "t" else 1
    if switches * max(map(int.bit_length, claim.ratio.as_integer_ratio())) > _BITS:
        return nothing
    return by(SwitchedFunction(functions, claim.rate, claim.ratio**switches))


def _largest(some: Sequence[Scaled]) -> Scaled:
    """Return the largest of the bounds of every node."""
    largest: dict[int, Fraction] = {}
    for vector, unit in some:
        for k, value in vector.items():
            largest[k] = max(largest.get(k, Fraction(0)), value * unit)
    (values,), scale = integers([list(largest.values())])
    return dict(zip(largest, values, strict=True)), Fraction(1, scale)
