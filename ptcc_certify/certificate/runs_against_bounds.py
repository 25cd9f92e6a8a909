"""A simulated run of a family against what its certificate proves for every signal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ptcc_certify.bounds.decay import ReachingPhase
from ptcc_certify.bounds.envelope import FLOOR_FACTOR
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.lyapunov.common_forms import CommonForm
from ptcc_certify.simulation.member_laplacians import Members
from ptcc_certify.simulation.switching_signals import WorstCaseSignal
from ptcc_certify.simulation.trajectory import Trajectory

#: A bound is exceeded by more than rounding from this ratio on.
VIOLATION = 1 + 1e-6


@dataclass(frozen=True)
class FamilyComparison:
    """The worst ratios of what a run shows to what is proved; None where nothing is proved, or judged.

    Everything is judged above ``floor``, below which the integrator resolves nothing: the tolerance times 1000 times
    the largest entry of the initial state, and what that makes of ``V`` and of inputs.

    Attributes
    ----------
    deviation_ratio : float or None
        ``max |x_k(t) - x_k(T)|`` over :meth:`FamilyProof.deviation_bound
        <ptcc_certify.certificate.family_proof.FamilyProof.deviation_bound>`; None if the run has no state
        at ``T`` that has settled.
    final_ratio : float or None
        The distance of ``x_k(T)`` from the middle of its interval, over half the length.
    input_ratio : float or None
        ``max |u_k(t)|`` over the proved peak.
    lyapunov_ratio : float or None
        ``max sqrt(V(s) / (e^(-r s) V(0)))`` for ``s > 0``, over all quadratic Lyapunov functions.
    mode_ratio : float or None
        The same with ``sum_i r_i s_i`` instead of ``r s``, ``s_i`` the clock spent in mode ``i``.
    floor : float
    judged : int
        How many of the deviations rose above the floor.
    sliding_ratio : float or None
        ``max |sigma_k(t)|`` over ``psi(t) |sigma_k(0)|``; infinite where one is not 0 by its proved reaching time. None
        if no sliding variable moves.

    Where sliding variables move, ``lyapunov_ratio`` is of ``y = x - sigma`` and what drives it, and there is no
    ``mode_ratio``.
    """

    deviation_ratio: float | None
    final_ratio: float | None
    input_ratio: float | None
    lyapunov_ratio: float | None
    mode_ratio: float | None
    floor: float
    judged: int
    sliding_ratio: float | None = None

    @property
    def worst_ratio(self) -> float:
        """The largest of the ratios; 0 if there is none."""
        ratios = (self.deviation_ratio, self.final_ratio, self.input_ratio, self.lyapunov_ratio, self.mode_ratio)
        return max((ratio for ratio in (*ratios, self.sliding_ratio) if ratio is not None), default=0.0)

    @property
    def violated(self) -> bool:
        """Whether a bound was exceeded by more than rounding."""
        return self.worst_ratio > VIOLATION


def compare(certificate: Certificate, run: Trajectory) -> FamilyComparison:
    """Compare a run with the bounds for every signal.

    Parameters
    ----------
    certificate : Certificate
        With an initial state.
    run : Trajectory
        Of the same family, protocol and initial state.

    Returns
    -------
    FamilyComparison

    Raises
    ------
    ParameterError
        The run is of something else.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")])
    >>> cert = certify(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2])
    >>> seen = [compare(cert, simulate(unsure, cert.protocol, [1, 2], s)) for s in worst_case_signals(cert)]
    >>> any(one.violated for one in seen), 0.9 < max(one.lyapunov_ratio for one in seen) < 1.000001
    (False, True)
    """
    _require_same(certificate, run)
    sizes = [np.abs(run.states[:, 0]).max(), *([] if run.sliding is None else np.abs(run.sliding.sigma0))]
    floor = FLOOR_FACTOR * run.rtol * (float(max(sizes)) or 1.0)
    before = np.isfinite(run.clock)
    deviation, judged = None, 0
    if run.deadline_index is not None and run.deadline_resolved:
        moved = np.abs(run.states[:, before] - run.final_state[:, None]) - floor
        judged = int((moved > 0).sum())
        deviation = _worst(moved, certificate.proof.deviation_bound(run.remaining[before]))
    modes = None
    if certificate.direct:
        ratios = [_lyapunov_ratios(*one, run, floor) for one in functions_of(certificate)]
        decays, modes = [one for one, _ in ratios], max((mode for _, mode in ratios), default=None)
    else:
        decays = list(_driven_ratios(certificate, run, floor))
    return FamilyComparison(
        deviation,
        _final_ratio(certificate, run, floor),
        _input_ratio(certificate, run, floor),
        max(decays, default=None),
        modes,
        floor,
        judged,
        _sliding_ratio(certificate, run),
    )


def worst_case_signals(certificate: Certificate, step: float | None = None) -> list[WorstCaseSignal]:
    """Return the searches for worst cases: against every quadratic Lyapunov function, and against the largest state.

    Parameters
    ----------
    certificate : Certificate
    step : float, optional
        On the clock, as for :class:`~ptcc_certify.simulation.switching_signals.WorstCaseSignal`.
    """
    n = certificate.family_proof.family.n_nodes
    against = [WorstCaseSignal.against(V, nodes, n, step) for nodes, V in functions_of(certificate)]
    return [*against, WorstCaseSignal(step=step)]


def functions_of(certificate: Certificate) -> Iterator[tuple[np.ndarray, CommonForm]]:
    """Yield every quadratic Lyapunov function with the nodes of its component."""
    for part in certificate.family_proof.parts:
        for V in part.forms:
            yield part.component.nodes, V


def _require_same(certificate: Certificate, run: Trajectory) -> None:
    if not isinstance(run, Trajectory) or run.played is None:
        raise ParameterError(f"{shorten(repr(run))} is no run of a family; give what simulate returned of one")
    if certificate.initial_state is None:
        raise ParameterError("the certificate has no initial state; certify the family with x0")
    if (
        run.played.family is not certificate.family_proof.family
        and run.played.family != certificate.family_proof.family
    ):
        raise ParameterError("the run is of another family than the certificate")
    for name, same in (
        ("protocol", _same_protocol(certificate, run)),
        ("initial state", run.t[0] == 0 and _close(run.states[:, 0], certificate.initial_state)),
    ):
        if not same:
            raise ParameterError(f"the run is of another {name} than the certificate")


def _same_protocol(certificate: Certificate, run: Trajectory) -> bool:
    if run.sliding is None or certificate.sigma0 is None:
        return run.sliding is None and certificate.sigma0 is None and run.protocol.gain == certificate.protocol.gain
    return run.protocol == certificate.protocol and _close(run.sliding.sigma0, certificate.sigma0)


def _close(x: np.ndarray, exact: tuple[Fraction, ...]) -> bool:
    return bool(np.allclose(x, [float(value) for value in exact], rtol=1e-14, atol=0))


def _worst(values: np.ndarray, bounds: np.ndarray) -> float | None:
    """Return the largest ratio of values that are positive; None if nothing bounds them."""
    if not np.isfinite(bounds).any():
        return None
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return float(np.where(values > 0, values / bounds, 0.0).max(initial=0.0))


def _final_ratio(certificate: Certificate, run: Trajectory, floor: float) -> float | None:
    ends = tuple(certificate.proof.final_state or ())
    if run.deadline_index is None or not run.deadline_resolved:
        return None
    known = [k for k, interval in enumerate(ends) if interval is not None]
    if not known:
        return None
    low, high = (np.array([float(ends[k][side]) for k in known]) for side in (0, 1))  # type: ignore[index]
    away = np.abs(run.final_state[known] - (low + high) / 2) - floor
    return _worst(away, (high - low) / 2)


def _input_ratio(certificate: Certificate, run: Trajectory, floor: float) -> float | None:
    """Return the worst ratio of inputs, and of their nominal parts, to their peaks."""
    proof = certificate.family_proof
    gain = run.protocol.gain.value_at_remaining(run.remaining)
    error, ratios = np.multiply.outer(2 * Members(proof.family).in_weight * floor, gain), []
    for values, peaks in (
        (run.input, proof.input_peaks),
        (gain * run.error, proof.nominal_peaks),
    ):
        if peaks is not None:
            ratios.append(_worst(np.abs(values) - error, np.array([[float(peak)] for peak in peaks])))
    return max((ratio for ratio in ratios if ratio is not None), default=None)


def _sliding_ratio(certificate: Certificate, run: Trajectory) -> float | None:
    """Return the worst ratio of sliding variables to ``psi |sigma_k(0)|``."""
    sliding = run.sliding
    reaching, protocol = certificate.proof.reaching, certificate.protocol.reaching
    if sliding is None or reaching is None or protocol is None or certificate.direct:
        return None
    certain = np.array([np.inf if r.z is None else float(r.z) for r in reaching])
    if not (sliding.reaching_z <= certain * (1 + 1e-9)).all():
        return float("inf")
    with np.errstate(divide="ignore"):
        share = ReachingPhase(protocol, reaching, certificate.sigma0 or ()).share(-np.log(sliding.reaching_remaining))
    return _worst(np.abs(sliding.sigma), np.multiply.outer(np.abs(sliding.sigma0), share))


def _driven_ratios(certificate: Certificate, run: Trajectory, floor: float) -> Iterator[float]:
    """Yield the worst ratio of ``sqrt(V(x - sigma))`` to its bound, of every quadratic function that decays."""
    proof = certificate.family_proof
    assert run.sliding is not None
    before = np.isfinite(run.clock)
    y = (run.states - run.sliding.sigma)[:, before]
    for number, part in enumerate(proof.parts):
        for V in part.forms:
            if V.rate > 0:
                root, size = _roots(part.component.nodes, V, y, floor)
                bound = proof.norm_bound(V, number, run.remaining[before])
                yield _worst(root - size, bound) or 0.0


def _roots(nodes: np.ndarray, V: CommonForm, x: np.ndarray, floor: float) -> tuple[np.ndarray, float]:
    """Return ``sqrt(V)`` of states, and what an error of the floor in every one of them makes of it."""
    signal, quotient = WorstCaseSignal.against(V, nodes, len(x)), V.quotient
    assert signal.form is not None
    coordinates = [1 + sum((abs(b) for b in quotient.basis[v]), Fraction(0)) for v in quotient.nodes]
    size = float(V.highest) ** 0.5 * float(np.linalg.norm([float(c) for c in coordinates])) * floor
    return np.sqrt(np.maximum((x * (signal.form @ x)).sum(axis=0), 0.0)), size


def _lyapunov_ratios(nodes: np.ndarray, V: CommonForm, run: Trajectory, floor: float) -> tuple[float, float]:
    """Return the worst ratios of ``sqrt(V)`` to its bounds by one rate, and by those of the modes."""
    root, size = _roots(nodes, V, run.states[:, np.isfinite(run.clock)], floor)
    assert run.played is not None
    clock, spent = run.clock[: root.size], run.played.clock_of_modes(run.clock)[:, : root.size]
    rates = np.array([float(rate) for rate in V.rates])
    excess, result = np.maximum(root - size, 0.0)[1:], []
    for decay in (float(V.rate) * clock, rates @ spent):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            bound = root[0] * np.exp(-decay / 2)
            result.append(float(np.where(excess > 0, excess / bound[1:], 0.0).max(initial=0.0)))
    return result[0], result[1]
