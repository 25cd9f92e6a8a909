"""Simulated motions: CVODES, Filippov solutions, limited and sampled gains."""
