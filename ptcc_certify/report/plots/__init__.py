"""Figures: Axes in, Axes out, and how they are saved.

Without ``ax`` a figure of one column is made in the style of ``ptcc.mplstyle``; for figures of your own
``plt.style.use("ptcc_certify.ptcc")``, with ``figsize=ptcc.SINGLE_COLUMN`` or ``ptcc.DOUBLE_COLUMN``.
"""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
