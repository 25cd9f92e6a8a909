"""Certificates: made, written, read back, judged."""
