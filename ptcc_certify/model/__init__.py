"""What is asked of what: the classes that a user gives, each field of which declares its option once."""

from ptcc_certify import modules_of

__getattr__ = modules_of(__name__)
