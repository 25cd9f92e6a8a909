"""Proved bounds: envelope, deviation from the final state, final state, input."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
