"""Signed digraphs: exact weights, structure, ensembles, reading and writing."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
