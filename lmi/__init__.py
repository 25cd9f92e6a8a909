"""Diagonal Lyapunov matrices of real matrices."""
