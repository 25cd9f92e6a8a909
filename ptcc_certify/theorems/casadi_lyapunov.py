"""The Lyapunov functions of the theorem rows as CasADi expressions, and their derivatives along the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csc_matrix

from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model import Protocol
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.theorems.table import theorem_for

if TYPE_CHECKING:
    import casadi as ca

#: Digits of the coefficients that a notebook shows.
_DIGITS = 4


@dataclass(frozen=True, eq=False, repr=False)
class SymbolicLyapunov:
    """A Lyapunov function along the closed loop, symbolically.

    Attributes
    ----------
    protocol : NominalProtocol
    t, x : casadi.SX
        The instant, in units of time, and the states (N, 1).
    gain : casadi.SX
        ``rho1 + rho2 phi'/phi``.
    E : (N, 1) casadi.SX
        ``-L x``.
    z : (n, 1) casadi.SX
        The coordinates of ``V``: rows of ``E``, or the weighted deviation ``eps``.
    agents : tuple of int
        The node index of every coordinate.
    weights : (n,) array
        The diagonal of ``Omega``.
    decrease : (n, n) array
        ``Omega A + A' Omega``, where ``z' = -gain A z``.
    V : casadi.SX
        ``z' Omega z``.
    V_dot : casadi.SX
        ``grad V . x'`` with ``x' = gain E``, by CasADi's differentiation of ``V``.
    proof_form : casadi.SX
        What the proof says ``V_dot`` is: ``-gain z'(Omega A + A' Omega)z``.
    bounding_form : casadi.SX
        What the proof bounds it by: ``-gain z'Sz`` with ``S`` the matrix whose smallest eigenvalue gives the rate.

    References
    ----------
    The proofs of Theorems 1 to 3 of [Zhu]_.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, 4)]))
    >>> form = symbolic_lyapunov(st, theorem_for(st).lyapunov(st), NominalProtocol(T=1, rho1=1, rho2=0, kappa=1))
    >>> import casadi as ca
    >>> [float(ca.substitute(V, form.x, ca.DM([1, 3]))) for V in (form.V, form.V_dot)]  # V' = -8 V, gain 1
    [64.0, -512.0]
    """

    protocol: Protocol
    t: ca.SX
    x: ca.SX
    gain: ca.SX
    E: ca.SX
    z: ca.SX
    agents: tuple[int, ...]
    weights: np.ndarray
    decrease: np.ndarray
    V: ca.SX
    V_dot: ca.SX
    proof_form: ca.SX
    bounding_form: ca.SX

    def latex(self, digits: int | None = None) -> str:
        r"""Return the coordinates ``e_{k}``, ``V``, ``V'`` and the gain ``g`` in LaTeX, printed from expressions.

        Agents are numbered from 1; ``V'`` is the form of the proof, written in the coordinates.

        Parameters
        ----------
        digits : int, optional
            Of the coefficients of ``V`` and ``V'``, to nearest, by default all: what is rounded is said to be
            approximately so.

        Examples
        --------
        >>> st = analyse(SignedDigraph.from_edges([(1, 2, 4), (2, 3, "1/3")]))
        >>> form = symbolic_lyapunov(st, theorem_for(st).lyapunov(st), NominalProtocol(T=1, rho1=1, rho2=0, kappa=1))
        >>> print(form.latex(digits=3).splitlines()[4])
        \dot V &\approx -g \left(8 e_{2}^{2} - 0.667 e_{2} e_{3} + 0.667 e_{3}^{2}\right) \\
        """
        import casadi as ca

        def short(entries: np.ndarray) -> tuple[np.ndarray, str]:
            rounded = entries if digits is None else np.vectorize(lambda x: float(f"{x:.{digits}g}"))(entries)
            return rounded, "=" if np.array_equal(rounded, entries) else r"\approx"

        n, (weights, of_value) = len(self.agents), short(self.weights)
        S, of_form = short(self.decrease * (2 - np.eye(n)))  # each pair of coordinates once
        e = [ca.SX.sym(f"e{k + 1}") for k in self.agents]
        pairs = [(i, j) for i in range(n) for j in range(i, n) if S[i, j]]
        squares = [e[i] ** 2 for i in range(n)]
        value = sum((weights[i] * squares[i] for i in range(n)), ca.SX(0))
        form = sum((S[i, j] * (squares[i] if i == j else e[i] * e[j]) for i, j in pairs), ca.SX(0))
        rows = [f"{to_latex(e[i])} &= {to_latex(self.z[i])}" for i in range(n)]
        rows.append(f"V &{of_value} {to_latex(value)}")
        rows.append(rf"\dot V &{of_form} -g \left({to_latex(form)}\right)")
        rows.append(rf"g &= {self.protocol.gain.latex()}")
        return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"

    def __repr__(self) -> str:
        return f"SymbolicLyapunov({len(self.agents)} coordinates of {self.x.numel()} agents)"

    def _repr_latex_(self) -> str:
        return f"${self.latex(_DIGITS)}$"


def symbolic_lyapunov(structure: Any, V: LyapunovFunction, protocol: Protocol) -> SymbolicLyapunov:
    """Write ``E``, ``V`` and ``V'`` of a theorem row as CasADi expressions.

    Parameters
    ----------
    structure : Structure or graph-like
    V : LyapunovFunction
        From the theorem that applies to the graph (``certificate.lyapunov``).
    protocol : NominalProtocol or SlidingModeProtocol
        Of the sliding-mode protocol, the motion on the sliding manifold: the nominal one with ``T = T_r + T_s``.

    Returns
    -------
    SymbolicLyapunov

    References
    ----------
    The proofs of Theorems 1 to 3 of [Zhu]_.

    Examples
    --------
    >>> st = analyse(SignedDigraph.from_edges([(1, 2, 4)]))
    >>> V = theorem_for(st).lyapunov(st)
    >>> form = symbolic_lyapunov(st, V, NominalProtocol(T=1, rho1=1, rho2=1, kappa=2))
    >>> import casadi as ca
    >>> float(ca.substitute(form.V, form.x, ca.DM([1, 3])))
    64.0
    """
    import casadi as ca

    structure = analyse(structure)
    graph = structure.graph
    protocol = protocol.nominal
    loop = protocol.closed_loop(graph)
    t, x = loop["t"], loop["x"]
    gain = protocol.gain.expression(t)
    L = ca.DM(csc_matrix(graph.laplacian()))  # CasADi reads matrices, not sparse arrays, of older SciPy
    E = -ca.mtimes(L, x)
    nodes, weights = list(V.nodes), np.array([float(w) for w in V.weights])
    if V.coordinates == "E":
        z, A = E[nodes], L[nodes, nodes]
    else:
        assert structure.gauge is not None
        g = structure.gauge.astype(float)
        z, A = x - ca.DM(g) * ca.dot(ca.DM(g * weights / weights.sum()), x), L
    product = ca.mtimes(ca.diag(ca.DM(weights)), A)
    decrease = product + product.T
    value = ca.sum1(ca.DM(weights) * z**2)
    S = ca.DM(theorem_for(structure).decrease(structure, V))
    return SymbolicLyapunov(
        protocol=protocol,
        t=t,
        x=x,
        gain=gain,
        E=E,
        z=z,
        agents=tuple(nodes),
        weights=weights,
        decrease=decrease.full(),
        V=value,
        V_dot=ca.jtimes(value, x, loop["ode"]),
        proof_form=-gain * ca.bilin(decrease, z, z),
        bounding_form=-gain * ca.bilin(S, z, z),
    )
