"""Simulated motions: CVODES, Filippov solutions, limited and sampled gains."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
