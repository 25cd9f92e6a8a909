"""Diagonal Lyapunov matrices of real matrices: search, coupling of blocks, proof in exact arithmetic.

The package knows nothing of graphs and is useful on any matrix: ``Omega A + A' Omega > 0`` with a positive diagonal
``Omega`` certifies that ``x' = -A x`` decays.

.. [Zhu] Z.-H. Zhu, H. Wu, Z.-H. Guan, Z.-W. Liu, Y. Chen, X. Zheng: Robust prescribed-time coordination control of
   cooperative-antagonistic networks with disturbances, manuscript; ``ptcc cite`` prints the BibTeX entry.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "errors": "LMIError MatrixError NoCertificate NotAnHMatrix NotAnMMatrix OutOfTime",
    "search_time": "time_limit",
    "diagonal_solution": "DiagonalCertificate diagonal_margin diagonal_rate",
    "matrix_classes": "comparison_matrix irreducible_blocks is_h_matrix is_m_matrix is_z_matrix m_matrix_witness",
    "closed_form": "h_matrix_certificate h_matrix_frontier h_matrix_diagonal "
    "m_matrix_certificate perron_certificate perron_vectors",
    "leader_follower_search": "CoupledCertificate FixedLeader FreeLeader coupled_lyapunov",
    "diagonal": "diagonal_lyapunov diagonal_rate_limit h_matrix_lyapunov rate_frontier refute_diagonal_lyapunov",
    "full": "FullCertificate full_frontier",
    "schur_coupling": "Coupling RhoInterval couple_blocks schur_positive_definite",
    "definiteness_proofs": "DefinitenessProof ResidualWitness SparseDefinitenessProof "
    "no_diagonal_rate_above prove_generalized_margin prove_margin prove_positive_definite "
    "prove_sparse_positive_definite",
    "dyadic": "dyadic_integers round_to_bits",
}
_EXPORTS = {name: f"lmi.{module}" for module, names in _MODULES.items() for name in names.split()}
__all__ = sorted(_EXPORTS)


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
