"""Lyapunov functions: searches, large graphs, upper bounds on the decay rate."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
