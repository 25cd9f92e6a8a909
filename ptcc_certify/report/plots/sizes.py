"""How large figures are: columns of journals and slides, and the size of their text.

Figures are drawn for text of 8 and 7 points, and scaled as a whole when they are saved.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from ptcc_certify.errors import ParameterError

#: Width and height in inches of figures as wide as a column, or two, of a journal.
SINGLE_COLUMN, DOUBLE_COLUMN = (3.5, 2.7), (7.16, 2.9)


class Sizes(NamedTuple):
    """What figures are made for.

    Attributes
    ----------
    widths : tuple of float
        Of one column and of two, in inches.
    scale : float
        The size of text over 8 points.
    shape : float, optional
        Height over width of every figure; by default each has its own.
    state_unit : str
        For the vertical axes of states.
    """

    widths: tuple[float, float]
    scale: float = 1.0
    shape: float | None = None
    state_unit: str = ""

    def of(self, size: tuple[float, float]) -> tuple[float, float]:
        """Return the size at which a figure is drawn that is ``size`` of :data:`SINGLE_COLUMN`, or wider, unscaled."""
        width = self.widths[size[0] > SINGLE_COLUMN[0]] / self.scale
        return width, width * (size[1] / size[0] if self.shape is None else self.shape)

    def scale_of(self, width: float) -> float:
        """Return by what a drawn figure is scaled that is so wide: one of a width of its own to that of two columns."""
        if self.widths == FORMATS["ieee"].widths and self.scale == 1:
            return 1.0
        full = self.widths[abs(width * self.scale - self.widths[0]) > 1e-6]
        return full / width


#: Columns of the journals of the IEEE; of Nature, 89 and 183 mm, with text of 5 to 7 points; slides of 16 to 9.
FORMATS = {
    "ieee": Sizes((SINGLE_COLUMN[0], DOUBLE_COLUMN[0])),
    "nature": Sizes((89 / 25.4, 183 / 25.4), 7 / 8),
    "slide": Sizes((40 / 3, 40 / 3), 18 / 8, 9 / 16),
}
#: Of a page of HTML, whose text has 8 points and more on paper.
PAGE = Sizes(FORMATS["ieee"].widths, 8 / 7)
_SIZES = ContextVar("sizes", default=FORMATS["ieee"])


def current_sizes() -> Sizes:
    """Return what figures are made for here."""
    return _SIZES.get()


@contextmanager
def figures_for(purpose: str = "ieee", *, width: float | None = None, state_unit: str = "") -> Iterator[Sizes]:
    """Draw and save figures for a journal or a slide.

    Parameters
    ----------
    purpose : {"ieee", "nature", "slide"}
    width : float, optional
        Of every figure in inches, in place of those of columns.
    state_unit : str
        For the vertical axes of states.

    Raises
    ------
    ParameterError
        An unknown purpose, or a width out of range.

    Examples
    --------
    >>> with figures_for("slide", state_unit="m") as sizes:
    ...     ax = plot_trajectory(certify([("a", "b", 1)], NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [1, 2]))
    >>> ax.get_ylabel(), ax.figure.get_size_inches() * sizes.scale
    ('state $x_k$ (m)', array([13.33333333,  7.5       ]))
    """
    if purpose not in FORMATS:
        raise ParameterError("purpose", f"= {purpose!r} is unknown; one of {', '.join(FORMATS)}")
    if width is not None and not 0.5 <= width <= 100:
        raise ParameterError("width", f"= {width} is out of range; give 0.5 to 100 inches")
    sizes = FORMATS[purpose]._replace(state_unit=state_unit)
    with sized(sizes if width is None else sizes._replace(widths=(width, width))):
        yield current_sizes()


@contextmanager
def sized(sizes: Sizes) -> Iterator[Sizes]:
    """Draw and save figures of these sizes."""
    before = _SIZES.set(sizes)
    try:
        yield sizes
    finally:
        _SIZES.reset(before)
