"""How large the input gets: from one initial state or a set, whether it stays finite, under limits and disturbances."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
