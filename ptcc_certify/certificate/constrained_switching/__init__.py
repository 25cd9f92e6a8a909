"""Signals that are restricted: what is claimed for these alone, searched, written and told."""
