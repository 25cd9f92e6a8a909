"""Certify prescribed-time coordination control on signed digraphs."""
