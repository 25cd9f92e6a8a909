"""A certificate as something to send to a person: one page of HTML, or a statement in LaTeX.

Both are made from a file that the independent check accepts (:mod:`ptcc_certify.certificate.certificate`). What was
proved is told apart from what is numerical: a simulated run, repeated for the figures. The page is
one file that loads nothing and runs no script; every text that stands in the certificate is shown as text, whatever
it holds.

:mod:`~ptcc_certify.report.report_file` checks the file and writes either. :mod:`~ptcc_certify.report.page` fills the
templates of the page; :mod:`~ptcc_certify.report.statement` is the LaTeX. Both take numbers and words from
:mod:`~ptcc_certify.report.html_text`, which rounds what was proved to the safe side, and figures from
:mod:`~ptcc_certify.report.page_figures`. This package itself loads none of them: the screen needs no template.
"""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
