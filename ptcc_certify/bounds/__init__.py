"""Proved bounds: envelope, deviation from the final state, final state, input."""
