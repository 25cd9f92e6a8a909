"""What is asked of what: protocols, agents, messages, leaders, limits; each field declares its option once."""

from ptcc_certify.model.base import NominalProtocol, Protocol, ReachingProtocol, SlidingModeProtocol

__all__ = ["NominalProtocol", "Protocol", "ReachingProtocol", "SlidingModeProtocol"]
