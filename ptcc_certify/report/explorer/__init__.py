"""The explorer: graph, run, input and proved bound, which follow the parameters while they are moved.

:mod:`~ptcc_certify.report.explorer.settings` is what can be moved, :mod:`~ptcc_certify.report.explorer.model` what is
then shown. Two thin views show it: :mod:`~ptcc_certify.report.explorer.widgets` in a notebook,
:mod:`~ptcc_certify.report.explorer.server` as a page in the browser (``ptcc explore``).
"""

from ptcc_certify.report.explorer.model import Explorer, View
from ptcc_certify.report.explorer.settings import GIVEN, Settings
from ptcc_certify.report.explorer.widgets import explore

__all__ = ["GIVEN", "Explorer", "Settings", "View", "explore"]
