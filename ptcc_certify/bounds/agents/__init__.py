"""Agents of order n: what a proof says of each, how they move together, formations, the cascade, how long they need."""
