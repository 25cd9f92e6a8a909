"""How sliding variables drive the agents of a family, for every signal and every disturbance; proved and verified here.

``y = x - sigma`` obeys ``y' = -gain L (y + sigma)``, and ``|sigma_k| <= psi |sigma_k(0)|``, which no graph enters. With
``sqrt(V)`` a norm that decays by ``e^(-rate s / 2)`` where nothing drives, and ``m_k`` the largest
``sum_l w+_kl (|sigma_k(0)| + |sigma_l(0)|)`` of a mode,

    sqrt(V(y(t)))  <=  e^(-rate s(t) / 2) sqrt(V(y(0))) + c int_0^t e^(-rate (s(t) - s(r)) / 2) gain(r) psi(r) dr

where ``c^2`` is the largest ``V`` of all states with ``|x_k| <= m_k``, of every mode.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, Protocol

from lmi.exact.decimal_rounding import up
from lmi.exact.elementary_enclosures import rounded
from lmi.exact.numbers import longest
from lmi.exact.work import spend
from ptcc_certify.checker.document import Document
from ptcc_certify.checker.family import Family
from ptcc_certify.checker.family_rows import Function as VerifiedFunction
from ptcc_certify.checker.input_formulas import (
    BITS,
    PrescribedGain,
    Reaching,
    decay_above,
    root_above,
    stretches,
)
from ptcc_certify.checker.protocol import Begin, check_sliding
from ptcc_certify.checker.protocol import Protocol as Parameters
from ptcc_certify.checker.reading import Interval, need

Sizes = Mapping[int, Fraction]
#: Stretches into which the time is cut while sliding variables move.
STRETCHES = 64
#: Below these ``psi``, and what a stretch leaves of a norm, are not made smaller: shorter numbers.
LEAST, MOST_DECAY = Fraction(1, 2**200), Fraction(100)


class Function(Protocol):
    """What a Lyapunov function says: see :class:`~ptcc_certify.checker.family_function.FamilyFunction`."""

    @property
    def rate(self) -> Fraction:
        """The proved rate."""

    def largest(self, sizes: Sizes) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``."""


def nominal_gain(gains: Mapping[str, Fraction]) -> PrescribedGain:
    """Return the gain of the nominal part of the input."""
    T = gains["T_r"] + gains["T_s"] if "T_r" in gains else gains["T"]
    return PrescribedGain(T, gains["rho1"], gains["rho2"] * gains["kappa"])


def drive_sizes(edges: Iterable[tuple[int, int, Fraction]], sigma0: Sizes) -> dict[int, Fraction]:
    """Return ``m_k = sum_l w+ (|sigma_k(0)| + |sigma_l(0)|)`` of sources, targets and largest sizes of edges.

    ``|(L sigma)_k| <= psi m_k`` for every member. Entries of ``C L`` may cancel at ``w+`` and not elsewhere, so that
    this is formed before ``C`` is.

    Examples
    --------
    >>> drive_sizes([(0, 1, Fraction(2))], {0: Fraction(3), 1: Fraction(-1)})
    {0: Fraction(0, 1), 1: Fraction(8, 1)}
    """
    total = dict.fromkeys(sigma0, Fraction(0))
    for source, target, size in edges:
        total[target] += size * (abs(sigma0[source]) + abs(sigma0[target]))
    return total


class Stretch(NamedTuple):
    """A stretch of the time while sliding variables move.

    The gain at its two ends and ``psi`` at its begin, from above; how far the clock goes, at least and at most.
    """

    first: Fraction
    last: Fraction
    psi: Fraction
    least: Fraction
    most: Fraction


def reaching_stretches(gains: Mapping[str, Fraction], quiet: Fraction | None) -> list[Stretch]:
    """Cut the time until all sliding variables are 0, ``quiet`` or ``T_r``, into stretches."""
    power, push = gains["mu3"] * gains["kappa"], gains["mu1"] + gains["delta"]
    reaching = Reaching((), gains["T_r"], gains["T_s"], gains["mu2"], power, push, quiet)
    result = []
    for part in stretches(nominal_gain(gains), reaching, reaching.quiet, STRETCHES):
        low, high = part.clock
        first, last, psi, most = (
            rounded(x, BITS, up=True) for x in (part.first, part.last, max(part.psi[1], LEAST), high)
        )
        result.append(Stretch(first, last, psi, rounded(low, BITS, up=False), most))
    return result


@dataclass(frozen=True, eq=False)
class Drive:
    """What sliding variables that are not 0 at first do to the agents of a family, or of a component of it.

    Attributes
    ----------
    stretches : sequence of Stretch
        Of the time while some sliding variable of the family moves, rounded outwards.
    sigma0 : mapping of int to Fraction
        By node.
    modes : sequence of mapping of int to Fraction
        ``m_k`` of :func:`drive_sizes` by node, of every mode.
    """

    stretches: Sequence[Stretch]
    sigma0: Sizes
    modes: Sequence[Sizes]
    _constants: dict[int, tuple[Function, Fraction]] = field(default_factory=dict)

    @cached_property
    def sizes(self) -> dict[int, Fraction]:
        """The largest ``m_k`` of all modes."""
        return {k: max(mode[k] for mode in self.modes) for k in self.sigma0}

    @cached_property
    def integral(self) -> Fraction:
        """``int gain psi dt`` from above."""
        return sum((part.psi * part.most for part in self.stretches), Fraction(0))

    @cached_property
    def largest(self) -> Fraction:
        """``max gain psi`` from above."""
        return max(part.last * part.psi for part in self.stretches)

    def constant(self, V: Function) -> Fraction:
        """Return ``c`` of a function, rounded up."""
        if id(V) not in self._constants:
            self._constants[id(V)] = V, root_above(max(V.largest(mode) for mode in self.modes))
        return self._constants[id(V)][1]

    def sum(self, V: Function, root: Fraction) -> Fraction:
        """Bound ``int gain sqrt(V(y)) dt`` from a bound of ``sqrt(V(y(0)))``, for a positive rate."""
        return 2 / V.rate * (root + self.constant(V) * self.integral)

    def peak(self, V: Function, root: Fraction) -> Fraction:
        """Bound ``gain sqrt(V(y))`` for all times from a bound of ``sqrt(V(y(0)))``, for ``rate rho2 kappa >= 2``.

        Then ``gain e^(-rate s / 2)`` does not grow: in a stretch the product is at most the gain at its begin times the
        root there, and the gain at its end times what the stretch adds.
        """
        half, c = V.rate / 2, self.constant(V)
        most, v = Fraction(0), root
        for stretch in self.stretches:
            added = c * stretch.psi * min(stretch.most, 1 / half)
            most = max(most, stretch.first * v + stretch.last * added)
            v = rounded(v * decay_above(min(half * stretch.least, MOST_DECAY)) + added, BITS, up=True)
        return rounded(max(most, self.stretches[-1].last * v), BITS, up=True)

    def ends(self, camps: Mapping[int, int], y: Sequence[Fraction]) -> Interval:
        """Return ends of ``g_k x_k(T)`` from ``y(0)``, of agents that hear nobody else and all end at the same number.

        The extremes of ``g_k y_k`` move outwards by at most ``gain psi m_k``; and ``x(T)`` is a mean of ``g_k x_k(0)``
        plus means of what the ``g_k sigma_k`` lose, each of which goes to 0 without turning.
        """
        values, reach = [g * y[k] for k, g in camps.items()], max(self.sizes[k] for k in camps) * self.integral
        sigma, zero = [g * self.sigma0[k] for k, g in camps.items()], Fraction(0)
        first = [value + s for value, s in zip(values, sigma, strict=True)]
        lost, won = (sum((max(sign * s, zero) for s in sigma), zero) for sign in (1, -1))
        return max(min(values) - reach, min(first) - lost), min(max(values) + reach, max(first) + won)

    @classmethod
    def of(
        cls,
        gains: Mapping[str, Fraction],
        sigma0: Sizes,
        quiet: Fraction | None,
        modes: Sequence[Iterable[tuple[int, int, Fraction]]],
    ) -> Drive:
        """Return what sliding variables do to all agents.

        Parameters
        ----------
        gains : mapping
            The parameters of the protocol.
        sigma0 : mapping of int to Fraction
            By node.
        quiet : Fraction or None
            From when on all are 0, ``ln(T_r/(T_r - t))``; None: ``T_r``.
        modes : sequence of edges
            Source, target and largest size, of every mode.
        """
        return cls(reaching_stretches(gains, quiet), sigma0, [drive_sizes(edges, sigma0) for edges in modes])

    def restricted(self, nodes: Sequence[int]) -> Drive:
        """Return what they do to agents that hear nobody else, numbered anew."""
        sigma0, *modes = ({k: of[v] for k, v in enumerate(nodes)} for of in (self.sigma0, *self.modes))
        return Drive(self.stretches, sigma0, modes)


def last_time(times: Sequence[Fraction | None], sigma0: Iterable[Fraction]) -> Fraction | None:
    """Return the last reaching time of the sliding variables that are not 0 at first; None: ``T_r``."""
    own = [z for z, s in zip(times, sigma0, strict=True) if s]
    return None if None in own else max((z for z in own if z is not None), default=Fraction(0))


# ---------------------------------------------------------------------- the check


def check_drive(
    doc: Document, family: Family, functions: Sequence[VerifiedFunction], protocol: Parameters, begin: Begin
) -> Drive | None:
    """Verify the sliding variables, and how they drive every Lyapunov function."""
    graph = family.modes[0].structure.graph
    check_sliding(doc, graph, protocol, begin)
    result = None
    if begin.sigma is not None and any(begin.sigma):
        sigma0 = dict(enumerate(begin.sigma))
        bits = longest(edge[4] for mode in family.modes for edge in mode.edges)
        spend(10 * sum(len(mode.edges) for mode in family.modes), bits, 128, "what sliding variables do")
        times = doc.sections["reaching_time"].z
        edges = ([(s, t, Fraction(high, mode.unit)) for s, t, _, _, high in mode.edges] for mode in family.modes)
        result = Drive.of(protocol.gains, sigma0, last_time(times, begin.sigma), list(edges))
    doc.at = "lyapunov.drives"
    drives = doc.sections["lyapunov"].drives
    need((result is None) == (drives is None), "drives belong to sliding variables that move")
    if result is not None:
        need(len(drives) == len(functions), f"drives has not {len(functions)} entries")
        for k, (V, drive) in enumerate(zip(functions, drives, strict=True)):
            doc.open("family-drive", f"lyapunov.functions[{k}]")
            need(drive >= result.constant(V), "what drives the function is not proved")
            doc.done(f"c = {up(drive)}")
    return result
