"""Diagonal Lyapunov matrices of real matrices: search, coupling of blocks, proof in exact arithmetic.

The package knows nothing of graphs and is useful on any matrix: ``Omega A + A' Omega > 0`` with a positive diagonal
``Omega`` certifies that ``x' = -A x`` decays.
"""

from importlib import import_module
from typing import Any

_EXPORTS = {
    "LMIError": "lmi.errors",
    "MatrixError": "lmi.errors",
    "NoCertificate": "lmi.errors",
    "NotAnHMatrix": "lmi.errors",
    "NotAnMMatrix": "lmi.errors",
    "OutOfTime": "lmi.errors",
    "time_limit": "lmi.deadline",
    "DiagonalCertificate": "lmi.certificate",
    "diagonal_margin": "lmi.certificate",
    "diagonal_rate": "lmi.certificate",
    "comparison_matrix": "lmi.matrices",
    "irreducible_blocks": "lmi.matrices",
    "is_h_matrix": "lmi.matrices",
    "is_m_matrix": "lmi.matrices",
    "is_z_matrix": "lmi.matrices",
    "m_matrix_witness": "lmi.matrices",
    "h_matrix_certificate": "lmi.closed_form",
    "h_matrix_frontier": "lmi.closed_form",
    "h_matrix_diagonal": "lmi.closed_form",
    "m_matrix_certificate": "lmi.closed_form",
    "perron_certificate": "lmi.closed_form",
    "perron_vectors": "lmi.closed_form",
    "CoupledCertificate": "lmi.coupled",
    "FixedLeader": "lmi.coupled",
    "FreeLeader": "lmi.coupled",
    "coupled_lyapunov": "lmi.coupled",
    "diagonal_lyapunov": "lmi.diagonal",
    "diagonal_rate_limit": "lmi.diagonal",
    "h_matrix_lyapunov": "lmi.diagonal",
    "rate_frontier": "lmi.diagonal",
    "refute_diagonal_lyapunov": "lmi.diagonal",
    "FullCertificate": "lmi.full",
    "full_frontier": "lmi.full",
    "Coupling": "lmi.coupling",
    "RhoInterval": "lmi.coupling",
    "couple_blocks": "lmi.coupling",
    "schur_positive_definite": "lmi.coupling",
    "DefinitenessProof": "lmi.witness",
    "DominanceProof": "lmi.sparse_witness",
    "ResidualWitness": "lmi.witness",
    "SparseDefinitenessProof": "lmi.sparse_witness",
    "definite_by_polynomial": "lmi.witness",
    "dyadic_integers": "lmi.exact.numbers",
    "no_diagonal_rate_above": "lmi.witness",
    "prove_dominance": "lmi.sparse_witness",
    "prove_generalized_margin": "lmi.witness",
    "prove_margin": "lmi.witness",
    "prove_positive_definite": "lmi.witness",
    "prove_sparse_positive_definite": "lmi.sparse_witness",
    "round_to_bits": "lmi.exact.numbers",
}
__all__ = sorted(_EXPORTS)


def __getattr__(name: str) -> Any:
    if name in _EXPORTS:
        return getattr(import_module(_EXPORTS[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
