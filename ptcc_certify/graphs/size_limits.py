"""Sizes up to which something is done: the limits that a user may meet, in one table.

Those of the independent check stand with it, those of the exact arithmetic with :mod:`lmi.exact`, and where one way of
computing takes over from another is told where it does.
"""

#: Files: bytes after unpacking, characters of a line, nodes (a matrix has their number, not themselves).
MAX_BYTES, MAX_LINE, MAX_NODES = 2**30, 65_536, 2 * 10**6

#: Nodes up to which null vectors, final states and proofs are computed in exact rationals.
EXACT_NODES = 120
#: Nodes up to which BLAS has one thread: more take longer, many times on a busy machine, and round differently.
ONE_THREAD_NODES = 400
#: Nodes above which null vectors and eigenvalues are computed by sparse methods, eigenvalues up to so many.
DENSE_NODES, FACTOR_NODES = 500, 20_000
#: Nodes up to which the paper's certificate (dense semidefinite cones) is searched.
SEARCH_NODES = 150
#: Agents of which each is captured, one after the other, to rank them.
RANKED_NODES = 10_000
#: Nodes up to which a certificate comes with a simulated run unasked.
SIMULATED_NODES = 10_000

#: Agents up to which a report repeats the run unasked, and of every one of which it draws states and input.
REPEATED_NODES, TRACED_NODES = 1000, 100
#: Nodes of a graph that a report draws, and up to which it is drawn with nodes and arrows, above as a matrix.
DRAWN_NODES, LABELLED_NODES = 300, 40
#: Nodes of a graph that a notebook draws unasked: a layout takes seconds above.
SHOWN_NODES = 120
#: Nodes of a graph that is explored.
EXPLORED_NODES = 120
