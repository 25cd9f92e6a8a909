"""Protocols: gain, nominal, sliding mode, disturbances."""
