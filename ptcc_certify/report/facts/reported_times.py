"""The instants at which screen, page and statement tell what is left."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ptcc_certify.model.base import Protocol

#: 1 - t/T and its name; the last instants are told of one graph alone.
_INSTANTS = ((0.5, "0.5 T"), (0.1, "0.9 T"), (0.01, "0.99 T"), (1e-6, "T(1-1e-6)"), (1e-9, "T(1-1e-9)"))
#: How many of them page and statement tell, and which one the short screen.
FEW, SHORT = 3, 2


def told_instants(protocol: Protocol, direct: bool) -> list[tuple[float, str]]:
    """Return ``1 - t/T`` and its name: with a reaching phase (not ``direct``) counted from ``T_r`` on.

    Examples
    --------
    >>> p = SlidingModeProtocol(T_r=1, T_s=3, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> told_instants(p, True)[0], told_instants(p, False)[0]
    ((0.5, '0.5 T'), (0.375, 'T_r + 0.5 T_s'))
    """
    if direct:
        return list(_INSTANTS)
    share = float(protocol.span / protocol.T)
    return [(left * share, f"T_r + {name.replace('T', 'T_s')}") for left, name in _INSTANTS]
