"""Theorems 2 and 3: quasi-strongly, and weakly connected signed digraphs: one closed component, or several.

The block-triangular argument needs no weak connectivity, so the same Lyapunov functions serve disconnected graphs.
"""

from ptcc_certify.theorems.leaders_and_followers import BalancedComposite, Composite


class BalancedWeak(BalancedComposite):
    """Theorem 3.1: weakly connected, at least one closed component balanced: bipartite containment at T.

    ``V = Eb' H Eb`` over all rows but those of one-node closed components, ``H = diag(H_k .., rho H_F)`` with
    ``H_k = diag(eta_k)`` for balanced ones; with ``Gamma`` the block diagonal of ``2 a(L_Lk) lmin(H_k) I`` and
    ``lmin(H_k L_Lk + L_Lk' H_k) I``, ``Pi = [[Gamma, rho L_FLb' H_F], [rho H_F L_FLb, rho (H_F L_F + L_F' H_F)]]`` and
    the rate is ``lmin(Pi) / lmax(H)``. All closed components single: ``V = E_F' H_F E_F``.
    """

    number = "3.1"
    statement = "Weakly connected, some closed component balanced: bipartite containment at T."
    conditions = (
        ("more than one closed component", lambda s: len(s.closed_components) > 1),
        ("at least one closed component balanced", lambda s: any(c.balanced for c in s.closed_components)),
    )
    leader, follower, matrix, product = "H_{k}", "H_F", "H", "Pi"
    positive = "the decrease of {block}"
    uniform = True


class UnbalancedWeak(Composite):
    """Theorem 3.2: weakly connected, all closed components unbalanced: stability at T.

    ``V = E' Th E``, ``Th = diag(Th_L1 .. Th_Lm, rho Th_F)``; rate ``lmin(Th L + L' Th) / lmax(Th)``.
    """

    number = "3.2"
    statement = "Weakly connected, all closed components unbalanced: stability at T."
    conditions = (
        ("more than one closed component", lambda s: len(s.closed_components) > 1),
        ("all closed components unbalanced", lambda s: not any(c.balanced for c in s.closed_components)),
    )
    leader, follower, matrix, product = "Theta_L{k}", "Theta_F", "Theta", "Theta L + L' Theta"


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
