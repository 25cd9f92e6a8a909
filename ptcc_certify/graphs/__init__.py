"""Signed digraphs: exact weights, structure, ensembles, reading and writing."""
