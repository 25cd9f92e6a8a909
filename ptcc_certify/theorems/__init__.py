"""Theorems 1 to 6: one file for each family, each reading like the theorem; :mod:`.table` has them all."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
