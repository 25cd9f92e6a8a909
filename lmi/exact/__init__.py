"""The kernel: exact numbers, and proofs of definiteness that everything else asks for."""
