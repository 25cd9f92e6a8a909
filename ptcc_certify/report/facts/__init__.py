"""What is told of a certificate, a structure, a family or a design, said once: lists of facts, which media lay out.

One module for each thing that can be told; each yields :class:`~ptcc_certify.certificate.fact.Fact`.
:mod:`~ptcc_certify.report.facts.of_certificate` lists what is told of a certificate,
:mod:`~ptcc_certify.report.facts.graph` what is told of graphs and designs, and loads no solver.
"""
