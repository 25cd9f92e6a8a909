"""Theorem 2: quasi-strongly connected signed digraphs: one closed component, and followers."""

from ptcc_certify.theorems.leaders_and_followers import BalancedComposite, Composite


class BalancedQuasiStrong(BalancedComposite):
    """Theorem 2.1: quasi-strongly connected, leaders structurally balanced: interval bipartite consensus at T.

    K >= 2: ``V = E' Xi E``, ``Xi = diag(Xi_L, rho Xi_F)``, ``Xi_L = diag(nu)``, ``nu' M(L_L) = 0``; with
    ``Phi = [[2 a(L_L) Xi_L, rho L_FL' Xi_F], [rho Xi_F L_FL, rho (Xi_F L_F + L_F' Xi_F)]]`` the rate is
    ``lmin(Phi) / lmax(Xi)``. K = 1: ``V = E_F' Xi_F E_F``, rate ``lmin(Xi_F L_F + L_F' Xi_F) / lmax(Xi_F)``.
    """

    number = "2.1"
    statement = "Quasi-strongly connected, leaders structurally balanced: interval bipartite consensus at T."
    conditions = (
        ("quasi-strongly connected", lambda s: s.connectivity == "quasi-strong"),
        ("leaders structurally balanced", lambda s: s.closed_components[0].balanced),
    )
    leader, follower, matrix, product = "Xi_L", "Xi_F", "Xi", "Phi"
    positive = "2 a(L_L)"
    uniform = False


class UnbalancedQuasiStrong(Composite):
    """Theorem 2.2: quasi-strongly connected, leaders structurally unbalanced: stability at T.

    ``V = E' Xit E``, ``Xit = diag(Xit_L, rho Xi_F)``; rate ``lmin(Psi) / lmax(Xit)``, ``Psi = Xit L + L' Xit``.
    """

    number = "2.2"
    statement = "Quasi-strongly connected, leaders structurally unbalanced: stability at T."
    conditions = (
        ("quasi-strongly connected", lambda s: s.connectivity == "quasi-strong"),
        ("leaders structurally unbalanced", lambda s: not s.closed_components[0].balanced),
    )
    leader, follower, matrix, product = "Xit_L", "Xi_F", "Xit", "Psi"
