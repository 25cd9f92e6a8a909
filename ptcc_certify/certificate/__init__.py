"""Certificates: made, written, read back, judged."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
