"""Gains and deadlines from limits of the input: of single integrators, and of agents of order n."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
