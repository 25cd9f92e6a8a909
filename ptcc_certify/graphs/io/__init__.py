"""Files in and out: signed digraphs in every common format, initial states, and writing that is whole or not at all.

Every format is turned into the same rows, and one routine (:mod:`ptcc_certify.graphs.io.graph_from_rows`) checks the
rows and builds the graph; so a rule of the reader holds for all formats, and a refusal names file, place and mend.
"""

from ptcc_certify.graphs.io.conversion import as_family, as_graph
from ptcc_certify.graphs.io.family_files import read_family
from ptcc_certify.graphs.io.files import write_atomically
from ptcc_certify.graphs.io.graph_files import read_graph, write_graph
from ptcc_certify.graphs.io.states import as_state, as_states, by_label, in_node_order, random_states, read_state

__all__ = [
    "as_family",
    "as_graph",
    "as_state",
    "as_states",
    "by_label",
    "in_node_order",
    "random_states",
    "read_family",
    "read_graph",
    "read_state",
    "write_atomically",
    "write_graph",
]
