"""Lyapunov functions: searches, large graphs, upper bounds on the decay rate."""
