"""Protocols, each kind on a page of its own, and what they are made of: gain, limits of the gain, disturbances."""

from ptcc_certify.protocols.base import Protocol, ReachingProtocol
from ptcc_certify.protocols.nominal import NominalProtocol
from ptcc_certify.protocols.sliding_mode import SlidingModeProtocol

__all__ = ["NominalProtocol", "Protocol", "ReachingProtocol", "SlidingModeProtocol"]
