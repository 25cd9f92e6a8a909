"""No file is taken for another graph in silence: what may be read in two ways is read by what tells it, or refused."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from bad_inputs import ptcc as run
from scipy import sparse
from scipy.io import mmwrite, savemat

import ptcc_certify as ptcc
from ptcc_certify.errors import FormatError, GraphError, ParameterError
from ptcc_certify.graphs.io import read_family, read_graph
from ptcc_certify.graphs.io.edge_delays import read_delays
from ptcc_certify.graphs.io.graph_files import keywords_as, reading_flags
from ptcc_certify.graphs.io.interval_rows import read_interval_rows
from ptcc_certify.graphs.io.states import read_state
from ptcc_certify.graphs.reading import OPTIONS, Reading
from ptcc_certify.simulation.switching_signals import TableSignal


@dataclass(frozen=True)
class Input:
    """A file, how it is read, and its edges ``source>target=weight``, or the words of its refusal."""

    name: str
    content: str | bytes
    edges: str = ""
    says: tuple[str, ...] = ()
    how: dict[str, Any] = field(default_factory=dict)


def npy(matrix: Any, kind: str = "f8") -> bytes:
    file = io.BytesIO()
    np.save(file, np.array(matrix).astype(kind))
    return file.getvalue()


def mat(**matrices: Any) -> bytes:
    file = io.BytesIO()
    savemat(file, matrices)
    return file.getvalue()


def npz(**matrices: Any) -> bytes:
    file = io.BytesIO()
    np.savez(file, **matrices)
    return file.getvalue()


def mtx(matrix: Any) -> bytes:
    file = io.BytesIO()
    mmwrite(file, sparse.coo_array(np.array(matrix, dtype=float)), symmetry="general")
    return file.getvalue()


def graphml(edge: str, node: str = "", keys: str = "") -> str:
    return f"""<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
<key id="w" for="edge" attr.name="weight" attr.type="double"/>
<key id="s" for="edge" attr.name="sign" attr.type="{keys or "int"}"/>
<key id="v" for="node" attr.name="name" attr.type="string"/>
<graph edgedefault="directed"><node id="n0">{node and '<data key="v">ann</data>'}</node>
<node id="n1">{node and '<data key="v">bob</data>'}</node>
<edge source="n0" target="n1">{edge}</edge></graph></graphml>"""


def gexf(kind: str = 'defaultedgetype="directed"', edge: str = 'weight="-0.5"', values: str = "") -> str:
    return f"""<?xml version="1.0"?><gexf xmlns="http://gexf.net/1.3" version="1.3"><graph {kind}>
<attributes class="edge"><attribute id="0" title="sign" type="integer"/></attributes>
<nodes><node id="0" label="ann"/><node id="1" label="bob"/></nodes>
<edges><edge id="0" source="0" target="1" {edge}>{values}</edge></edges></graph></gexf>"""


def links(key: str = "links", **more: Any) -> str:
    nodes = [{"id": "ann"}, {"id": "bob"}]
    return json.dumps({"nodes": nodes, key: [{"source": "ann", "target": "bob", "weight": -0.5}], **more})


LAPLACIAN = [[2, -1, 1], [-1, 1, 0], [0, 3, 3]]
OF_LAPLACIAN = "2>1=1 3>1=-1 1>2=1 2>3=-3"
NET = '*Vertices 3\n1 "ann"\n2 "bob"\n3 "eve"\n'

SIGNS = [
    Input("g.csv", "source,target,weight,sign\na,b,0.5,-1\nb,a,1,1\n", "a>b=-1/2 b>a=1"),
    Input("g.csv", "source,target,weight,type\na,b,0.5,inhibits\nb,a,1,activates\n", "a>b=-1/2 b>a=1"),
    Input("g.csv", "sign,source,weight,target\n-,a,2,b\n+,b,1,a\n", "a>b=-2 b>a=1"),
    Input("g.csv", "source,target,weight,sign\na,b,-2,-1\nb,a,1,1\n", "a>b=-2 b>a=1"),
    Input("g.csv", "source,target,weight,sign\na,b,-2,1\nb,a,1,1\n", says=("line 2", "disagree")),
    Input("g.csv", "source,target,weight,sign\na,b,2,\nb,a,1,1\n", says=("line 2", 'no "sign"')),
    Input("g.csv", "source,target,weight,sign\na,b,2,0\nb,a,1,-1\n", says=("line 2", "weight 0", "--drop-zeros")),
    Input("g.csv", "source,target,weight,sign\na,b,2,0\nb,a,1,1\n", says=("line 2", "no -1", "--columns")),
    Input("g.csv", "source,target,weight,type\na,b,2,1\nb,a,1,2\n", says=("line 3", '"2"', "code", "--columns")),
    Input("g.csv", "source,target,weight,type\na,b,2,friend\nb,a,1,kin\n", says=("line 3", '"kin"', "--columns")),
    Input(
        "g.csv",
        "source,target,weight,type\na,b,2,friend\nb,a,1,kin\n",
        "a>b=2 b>a=1",
        how={"columns": "source,target,weight"},
    ),
    Input("g.csv", "Source,Target,Type,Weight\na,b,Directed,-2\n", "a>b=-2"),
    Input("g.csv", "Source,Target,Type,Weight\na,b,Undirected,-2\n", says=("undirected", "--undirected")),
    Input("g.csv", "Source,Target,Type,Weight\na,b,Undirected,-2\n", "a>b=-2 b>a=-2", how={"undirected": True}),
    Input("g.csv", "source,target,type\na,b,1\nb,a,2\n", says=("line 3", '"type" holds 2', "codes")),
    Input("g.csv", "source,target,relation\na,b,0\nb,a,1\n", says=("line 2", '"relation" holds 0', "codes")),
    Input("g.csv", "source,target,type\na,b,1\nb,a,-1\n", "a>b=1 b>a=-1"),
    Input("g.csv", "source,target,sign\na,b,up\nb,a,down\n", "a>b=1 b>a=-1"),
    Input("g.csv", "a,b,+\nb,a,-\n", "a>b=1 b>a=-1"),
    Input("g.csv", "a,b,activation\nb,a,repression\n", "a>b=1 b>a=-1"),
    Input("g.csv", "a,b,activates\nb,a,binds\n", says=("line 2", '"binds"', "word for a sign")),
    Input("g.csv", "a,b,activates\nb,a,1\n", says=("line 1", '"activates"', "write 1 or -1")),
    Input("g.csv", "a,b,1\nb,c,2\nc,a,0\n", says=("line 3", "0, 1, 2", "codes of relations", "--drop-zeros")),
    Input("g.graphml", graphml('<data key="w">0.5</data><data key="s">-1</data>'), "n0>n1=-1/2"),
    Input("g.graphml", graphml('<data key="w">0.5</data><data key="s">3</data>'), says=('"3"', "code")),
    Input("g.graphml", graphml('<data key="s">inhibits</data>', keys="string"), "n0>n1=-1"),
    Input("g.graphml", graphml('<data key="w">-2</data>', node="named"), "ann>bob=-2"),
    Input(
        "g.gml",
        'graph [ directed 1 node [ id 0 name "ann" ] node [ id 1 name "bob" ] '
        "edge [ source 0 target 1 weight 0.5 sign -1 ] ]",
        "ann>bob=-1/2",
    ),
]
UNKNOWN_SIGNS = [
    case
    for word in ("+-", "-+", "+ -", "_+", "neg-", "-pos", "+/-", "_")
    for case in (
        Input("g.csv", f"source,target,weight\na,b,{word}\nb,c,-\nc,a,+\n", says=("line 2", f'"{word}"')),
        Input("g.csv", f"source,target,weight,effect\na,b,1,{word}\nb,c,1,-\nc,a,1,+\n", says=(f'"{word}"',)),
        Input("g.sif", f"a\t+\tb\nb\t{word}\tc\n", says=("line 2", f'"{word}"')),
        Input("g.txt", f"a\tb\t-\nb\tc\t+\nc\ta\t{word}\n", says=("line 3", f'"{word}"')),
    )
]
#: Headers whose second column is the source, and headers that may mean either direction.
TURNED = [
    "destination,source,weight",
    "target,regulator,weight",
    "target_gene,regulator,weight",
    "Target gene,TF,Mode",
    "target_id,tf,weight",
    "gene,TF,score",
    "destination,origin,score",
    "dest,orig,score",
    "End,Start,score",
    "influenced,influencer,score",
    "to_node,whoever,score",
    "whatever,from_id,score",
]
EITHER = [
    "node,listens_to,score",
    "child,parent,score",
    "head,tail,score",
    "agent,neighbor,score",
    "Gene2,Gene1,score",
    "target,follower,weight",
    "Trustor,Trustee,Trust",
]
DIRECTIONS = [
    *(Input("g.csv", f"{header}\na,b,2\nb,c,-3\nc,a,1\n", "b>a=2 c>b=-3 a>c=1") for header in TURNED),
    *(
        Input("g.csv", f"{header}\na,b,2\nb,c,-3\nc,a,1\n", edges, says, how)
        for header in EITHER
        for edges, says, how in [
            ("", ("line 1", "names no source and target", "--edges listens if", "--edges information"), {}),
            ("b>a=2 c>b=-3 a>c=1", (), {"columns": "2,1,3"}),
        ]
    ),
    Input("g.csv", "child,parent,score\na,b,2\nb,a,1\n", "b>a=2 a>b=1", how={"orientation": "listens"}),
    Input("g.csv", "child,parent,score\na,b,2\nb,a,1\n", "a>b=2 b>a=1", how={"orientation": "information"}),
    Input("g.csv", "id,target,weight\na,b,2\nb,c,-3\n", says=("line 1", "no source and target", "--columns")),
    Input("g.csv", "target,year,score,tf\na,9,2,b\nb,8,1,c\n", says=("line 1", "no source and target", "--columns")),
    Input("g.csv", "tf,regulator,weight\na,b,2\nb,c,-3\n", says=("line 1", "no source and target", "--columns")),
    Input("g.csv", "tf,gene,weight_min,weight_max\na,b,2,3\nb,c,-3,1\n", says=("a family of graphs",)),
    Input("g.csv", "Gene1,Gene2,score,start,end\na,b,2,3,4\nb,c,-1,3,4\n", "a>b=2 b>c=-1"),
    *(
        Input("g.csv", f"{header},score\na,b,2\nb,c,-1\n", "a>b=2 b>c=-1")
        for header in ("i,j", "u,v", "node_a,node_b", "Gene1,Gene2", "gene_symbol_1,gene_symbol_2", "TF,Gene")
    ),
    Input("g.csv", "row,column,value\na,b,2\nb,c,-3\n", says=("line 1", "no source and target", "--columns")),
    Input("g.csv", "a,b,trust\nb,c,1\n", says=("line 1", '"trust"')),
]
#: Columns beside weights that are all positive, for the edges a>b, b>c: what they make of the weights, or the refusal.
SIGNS_BESIDE = [
    *(
        Input("g.csv", f"source,target,weight,{title}\na,b,2,{one}\nb,c,1,{other}\n", "a>b=-2 b>c=1")
        for title, one, other in [
            ("mode", "inhibits", "activates"),
            ("label", "foe", "friend"),
            ("trust", "distrust", "trust"),
            ("stance", "oppose", "support"),
            ("sgn", "-1", "1"),
            ("s", "-1", "1"),
            ("Sign of edge", "-1", "+1"),
            ("x", "-", "+"),
            ("value", "-1", "1"),
        ]
    ),
    *(
        Input(
            "g.csv", f"source,target,weight,{title}\nb,c,1,{other}\na,b,2,{one}\n", says=(row, title, one, "--columns")
        )
        for row, title, one, other in [
            ("line 3", "negative", "True", "False"),
            ("line 3", "is_negative", "1", "0"),
            ("line 3", "inhibition", "yes", "no"),
            ("line 3", "positive", "0", "1"),
            ("line 3", "sgn", "0", "1"),
            ("line 3", "rating", "-5", "3"),
            ("line 3", "sgn", "-1", "0"),
            ("line 3", "kind", "inhibits", ""),
            ("line 3", "kind", "inhibits", "unknown"),
            ("line 2", "kind", "-", "-"),
        ]
    ),
    Input(
        "g.csv", "source,target,weight,p,q\na,b,2,-1,1\nb,c,1,1,-1\n", says=("line 2", '"q"', "disagree", "--columns")
    ),
    Input("g.csv", "source,target,weight,rating\na,b,2,-5\nb,c,1,3\n", "a>b=-5 b>c=3", how={"columns": "1,2,4"}),
    Input("g.csv", "source,target,weight,rating\na,b,2,-5\nb,c,1,3\n", "a>b=2 b>c=1", how={"columns": "1,2,3"}),
    Input("g.csv", "source,target,weight,negative\na,b,2,False\nb,c,1,False\n", "a>b=2 b>c=1"),
    Input("g.csv", "source,target,weight,assigned\na,b,2,1\nb,c,1,0\n", "a>b=2 b>c=1"),
    Input("g.csv", "source,target,weight,lng\na,b,2,-71.5\nb,c,1,3\n", "a>b=2 b>c=1"),
    Input("g.csv", "source,target,weight,kind\na,b,-2,inhibits\nb,c,1,activates\n", "a>b=-2 b>c=1"),
    Input(
        "g.csv", "source,target,weight,kind\na,b,-2,activates\nb,c,1,activates\nc,a,1,inhibits\n", says=("disagree",)
    ),
    Input("g.csv", "source,target,weight,party\na,b,-2,1\nb,c,1,-1\n", "a>b=-2 b>c=1"),
    Input("g.csv", "source,target,sign,type\na,b,1,negative\nb,c,-1,positive\n", says=("line 2", "disagree")),
    Input("g.csv", "source,target,weight,sign,type\na,b,2,-1,enemy\nb,c,1,1,ally\n", "a>b=-2 b>c=1"),
    Input("g.csv", "source,target,weight,sign,type\na,b,2,-1,ally\nb,c,1,1,enemy\n", says=("line 2", "disagree")),
    Input("g.csv", "source,target,weight,directed\na,b,2,true\nb,c,-1,false\n", says=("directed and undirected",)),
    Input("g.csv", "source,target,weight,directed\na,b,2,0\nb,c,-1,0\n", says=("undirected", "--undirected")),
    Input("g.csv", "source,target,weight,directed\na,b,2,1\nb,c,-1,1\n", "a>b=2 b>c=-1"),
    Input(
        "g.csv",
        "source,target,weight,rating\n" + "".join(f"a,n{k},1,{k}\n" for k in range(1500)) + "b,a,1,-5\n",
        says=('"rating" holds -5',),
    ),
    Input(
        "g.graphml",
        graphml('<data key="w">2</data><data key="s">true</data>', keys="boolean").replace('"sign"', '"negative"'),
        says=('"negative"', "--columns"),
    ),
    Input(
        "g.graphml",
        graphml('<data key="w">2</data><data key="s">-1</data>').replace('"sign"', '"mark"'),
        "n0>n1=-2",
    ),
    Input(
        "g.gml",
        'graph [ directed 1 node [ id 0 label "a" ] node [ id 1 label "b" ] '
        "edge [ source 0 target 1 weight 2 negative 1 ] edge [ source 1 target 0 weight 1 negative 0 ] ]",
        says=('"negative"', "--columns"),
    ),
    Input(
        "g.gexf",
        gexf(edge='weight="2"', values='<attvalues><attvalue for="0" value="-1"/></attvalues>').replace(
            'title="sign"', 'title="mark"'
        ),
        "ann>bob=-2",
    ),
    Input("g.json", '[{"source": "a", "target": "b", "weight": 2, "mode": "inhibits"}]', "a>b=-2"),
    Input("g.json", '[{"source": "a", "target": "b", "weight": 2, "negative": true}]', says=('"negative"',)),
]
ORDINARY = [
    Input("g.csv", "0;1,5;-1\n1;0;2\n0;1;0\n", "2>1=1.5 3>1=-1 1>2=1 3>2=2 2>3=1"),
    Input("g.csv", "source;target;weight\na;b;1,5\n", "a>b=1.5"),
    Input("g.csv", '"source";"target";"weight"\n"1,5";"b";-0,1\n', "1,5>b=-0.1"),  # as R writes it
    Input("g.csv", "a\tb\t1,5\nb\tc\t-2,125e-1\n", "a>b=1.5 b>c=-0.2125"),
    Input("g.csv", "source;target;weight;s\na;b;0,5;-1,0\nb;a;2;1,0\n", "a>b=-0.5 b>a=2"),
    Input("g.csv", "a;b;1,5\n1,5;a;2\n", says=("1,5 among nodes", "quote the names")),
    Input("g.csv", "a;b;1,500\nb;c;-2\n", says=("line 1", "write 1.500 or 1500")),
    Input("g.csv", "a;b;0,5\nb;c;1.500\n", says=("line 1", "decimals with a point, 0.5")),
    Input("g.csv", "a;b;0,5\nb;c;1.000,5\n", says=("line 2", '"1.000,5"', "decimals with a point")),
    Input("g.csv", 'a,b,"0,5"\n', says=("line 1", "decimals with a point, 0.5")),
    Input("out.a", "% asym posweighted\n1 2 1 0\n2 3 5 0\n3 1 1 0\n", "1>2=1 2>3=5 3>1=1"),
    Input("out.a", "% asym signed\n1 2 1 12345\n2 3 -5 123\n3 1 1 1\n", "1>2=1 2>3=-5 3>1=1"),
    Input("out.a", "% asym signed\n1 2 0 3\n2 3 -5 0\n3 1 1 1\n4 1 1 2\n", says=("line 2", "weight 0")),
    Input(
        "g.csv",
        "Trustor,Trustee,Trust\n1,2,4\n2,3,-4\n",
        "2>1=4 3>2=-4",
        how={"orientation": "listens"},
    ),
    Input("g.csv", "source,target,Trust\n1,2,4\n2,3,-4\n", "1>2=4 2>3=-4"),
    *(
        Input("g.txt", table, says=("line 2", "4 fields", "row.names = FALSE"))
        for table in (
            '"source" "target" "weight"\n"1" "a" "b" 4\n"2" "b" "c" -4\n',
            "source target weight\n1 a b 4\n2 b c -4\n",
            "V1 V2 V3\na 0 1 -1\nb 1 0 1\nc 1 0 0\n",
            "   V1 V2 V3\n1  0  1 -1\n2  1  0  1\n3  1  0  0\n",
        )
    ),
    # the same tables written with row.names = FALSE
    Input("g.txt", '"source" "target" "weight"\n"a" "b" 4\n"b" "c" -4\n', "a>b=4 b>c=-4"),
    Input("g.txt", '"V1" "V2" "V3"\n0 1 -1\n1 0 1\n1 0 0\n', "V2>V1=1 V3>V1=-1 V1>V2=1 V3>V2=1 V1>V3=1"),
]
LAPLACIANS = [
    Input("g.npy", npy(LAPLACIAN), says=("Laplacian", "--laplacian", "--no-laplacian")),
    Input("g.npy", npy(LAPLACIAN), says=("Laplacian", "--laplacian"), how={"drop_self_loops": True}),
    Input("g.npy", npy(LAPLACIAN), OF_LAPLACIAN, how={"laplacian": True}),
    Input("g.npy", npy(LAPLACIAN), "2>1=-1 3>1=1 1>2=-1 2>3=3", how={"laplacian": False, "drop_self_loops": True}),
    Input("g.mtx", mtx(LAPLACIAN), says=("Laplacian", "--laplacian")),
    Input("g.mtx", mtx(LAPLACIAN), OF_LAPLACIAN, how={"laplacian": True}),
    Input("g.mat", mat(L=LAPLACIAN), OF_LAPLACIAN, how={"laplacian": True}),
    Input("g.npz", npz(L=np.array(LAPLACIAN)), says=("Laplacian", "--laplacian"), how={"drop_self_loops": True}),
    Input("g.txt", "2 -1 1\n-1 1 0\n0 3 3\n", says=("Laplacian", "--laplacian")),
    Input("g.txt", "2 -1 1\n-1 1 0\n0 3 3\n", OF_LAPLACIAN, how={"laplacian": True}),
    Input("g.npy", npy(np.transpose(LAPLACIAN)), says=("columns", "--edges information"), how={"laplacian": True}),
    Input("g.npy", npy(np.transpose(LAPLACIAN)), OF_LAPLACIAN, how={"laplacian": True, "orientation": "information"}),
    Input("g.npy", npy([[0, 1], [-1, 0]]), says=("no Laplacian", "row 1"), how={"laplacian": True}),
    Input("g.npy", npy([[1, -0.5], [-0.5, 1]]), says=("no Laplacian", "row 1"), how={"laplacian": True}),
    Input("g.npy", npy([[-1, 1], [2, -2]]), says=("minus a Laplacian", "negative"), how={"laplacian": True}),
    Input("g.npy", npy([[-1, 1], [2, -2]]), says=("Laplacian", "--laplacian"), how={"drop_self_loops": True}),
    # an ordinary Laplacian of signed weights: the rows sum to 0, the weights are the same
    Input("g.npy", npy([[1, -2, 1], [0, 0, 0], [-3, 0, 3]]), says=("Laplacian",), how={"drop_self_loops": True}),
    Input("g.npy", npy([[1, -2, 1], [0, 0, 0], [-3, 0, 3]]), "2>1=2 3>1=-1 1>3=3", how={"laplacian": True}),
    Input("g.npy", npy([[1, -0.5], [-0.5, 1]]), says=("normalised Laplacian",), how={"drop_self_loops": True}),
    Input("g.npy", npy([[1, -0.5], [0.5, 1]]), says=("self-loop at node 1 (2 in all)", "--drop-self-loops")),
    Input("g.csv", "1,1,1\n1,2,-1\n2,1,-1\n2,2,1\n", says=("Laplacian",), how={"drop_self_loops": True}),
    Input("g.csv", "1,1,1\n1,2,-1\n2,1,-1\n2,2,1\n", "1>2=1 2>1=1", how={"laplacian": True}),
]
ROWS = [
    Input("g.sif", "12 1 15\n15 -1 17\n17 1 12\n", "12>15=1 15>17=-1 17>12=1"),
    Input("g.sif", "a\tactivates\tb\tc\nb\tinhibits\ta\nlone\n", "a>b=1 a>c=1 b>a=-1"),
    Input("g.sif", "a pp b\n", says=("line 1", '"pp"', "word for a sign")),
    Input("g.sif", "a 1 b\nb 2 a\n", says=("line 2", "codes")),
    Input("g.sif", "a activates\n", says=("line 1", "no row of SIF")),
    Input("g.txt", "a activates b\nb inhibits a\n", says=("signs", ".sif")),
    Input("g.txt", "12 1 15\n15 -1 17\n17 1 12\n", says=("second column", ".sif", "--columns 1,3,2")),
    Input("g.txt", "12 1 15\n15 -1 17\n17 1 12\n", "12>15=1 15>17=-1 17>12=1", how={"columns": "1,3,2"}),
    Input("g.txt", "12 1 15\n15 1 17\n", says=("second column", ".sif")),
    Input("g.txt", "2 1 0.5\n3 1 -0.5\n", "2>1=1/2 3>1=-1/2"),
    Input("g.txt", "5 7 1082040961\n7 8 1082155839\n", says=("times",)),
    Input("g.dot", "digraph G {\n a -> b [weight=1];\n}\n", says=("Graphviz DOT", "GraphML")),
    Input("g.txt", "1 2 4 6\n2 1 3 5\n3 2 4 5\n", says=("line 1", "--columns 1,2,3")),
    Input("g.txt", "1 2 3\n2 1 3\n3 1 2\n", says=("neighbours", "--columns 1,2,3")),
    Input("g.txt", "1 2 4\n2 1 3 5\n", says=("line 2", '"5"')),
    Input("g.csv", "a,b,0.5,-1\nb,a,1,1\n", says=("line 1", '"-1"', "sign")),
    Input("g.csv", "a,b,0.5,inhibits\n", says=("line 1", '"inhibits"')),
    Input("g.txt", "2001 2002 2005 2007\n2002 2001 2004 2009\n", says=("line 1", '"2007"')),
    Input("g.csv", "6,2,4,1289241911\n6,5,-2,1289241941\n", "6>2=4 6>5=-2"),
    Input("g.csv", "source,target,weight\na,b,-1,5\n", says=("line 2", "4 fields")),
    Input("g.tsv", "% sym signed\n1 2 1\n2 3 -1\n", says=("% sym", "--undirected")),
    Input("g.tsv", "% sym signed\n1 2 1\n2 3 -1\n", "1>2=1 2>1=1 2>3=-1 3>2=-1", how={"undirected": True}),
    Input("g.tsv", "% bip signed\n1 1 1\n2 1 -1\n", says=("% bip", "two sets of nodes")),
    Input("g.tsv", "% asym signed\n1 2 1\n2 3 -1\n", "1>2=1 2>3=-1"),
    Input("g.txt", "# Undirected graph: x\n1 2 1\n", says=("Undirected", "--undirected")),
    Input("g.csv", "Gene1,Gene2,Type\na,b,+\nb,c,-\n", "a>b=1 b>c=-1"),
    Input("g.csv", "TF,Gene,Effect,PMID\na,b,activates,99\nb,c,represses,7\n", "a>b=1 b>c=-1"),
    Input("g.csv", "Gene1,Gene2,Type\na,b,activates\nb,c,binds\n", says=("line 3", '"binds"')),
    Input("g.csv", "listener,speaker,weight\na,b,1\n", says=("line 1", "no source and target", "--edges listens")),
    Input("g.csv", "listener,speaker,weight\na,b,1\n", "b>a=1", how={"orientation": "listens"}),
    Input("g.csv", "ann,bob,strong\nbob,eve,1\n", says=("line 1", "bob is a title, and a node")),
    Input("g.csv", "id,from,to,score,weight\n9,a,b,-3,1\n", "a>b=-3", how={"columns": "from,to,score"}),
    Input("g.csv", "a,b,1,-3\n", "a>b=-3", how={"columns": "1,2,4"}),
    Input("g.csv", "a,b,1\n", says=("no column 4", "1 to 3"), how={"columns": "1,2,4"}),
    Input("g.csv", "source,target,weight\na,b,1\n", says=('no column "score"', "weight"), how={"columns": "1,2,score"}),
    Input(
        "g.csv",
        "a,a,1\na,b,0\nb,c,1\nb,c,2\n",
        says=("line 1: self-loop", "line 2: weight 0", "line 4: second row", "--drop-self-loops --drop-zeros --dup"),
    ),
    Input("g.csv", "a,b,0\nb,c,1\n", "b>c=1", how={"drop_zeros": True}),
    Input("g.csv", "source,target,weight\n0,1,1\n1,0,2\n2,3,0\n", "0>1=1 1>0=2", how={"drop_zeros": True}),
    Input("g.txt", "% sym\n1 2 1\n2 1 3\n", says=("% sym", "line 3: second row", "--undirected --duplicates")),
    Input("g.csv", "0.5,-0.3,1\n0.2,0.7,2\n", says=("a node called 0.5", "--columns 1,2,3")),
]
MATRICES = [
    Input("g.csv", ",ada,bo\nada,0,-0.7\nbo,0.3,0\n", "bo>ada=-7/10 ada>bo=3/10"),
    Input("g.csv", ",ada,bo\nada,0,-0.7\nbo,0.3,0\n", "ada>bo=-7/10 bo>ada=3/10", how={"orientation": "information"}),
    Input("g.csv", ",ada,bo\nbo,0.3,0\nada,0,-0.7\n", "bo>ada=-7/10 ada>bo=3/10"),
    Input("g.txt", "ada bo cy\nada 0 -1 0\nbo 1 0 0\ncy 0 1 0\n", "bo>ada=-1 ada>bo=1 bo>cy=1"),
    Input("g.csv", ",ada,bo\nada,0,\nbo,0.3,0\n", says=("row ada, column bo", "empty")),
    Input("g.csv", ",ada,bo\nada,0,1\ncy,0.3,0\n", says=("matrix with names", "different")),
    Input("g.txt", "[0 -1 1; -1 0 -1; 1 -1 0]\n", "2>1=-1 3>1=1 1>2=-1 3>2=-1 1>3=1 2>3=-1"),
    Input("g.txt", "W = [0 -1\n 2 0];\n", "2>1=-1 1>2=2"),
    Input("g.txt", "array([[ 0., -1.],\n       [ 2.,  0.]])\n", "2>1=-1 1>2=2"),
    Input("g.txt", "[[ 0. -1.]\n [ 2.  0.]]\n", "2>1=-1 1>2=2"),
    Input("g.txt", "[[0 1 ... 0]\n ...\n [1 0 ... 0]]\n", says=("printed in parts",)),
    Input("g.txt", "[0 -1 1; -1 0]\n", says=("no square matrix",)),
    Input("g.txt", "0 -1 0.5\n1/3 0 0\n0 2 0\n", "2>1=-1 3>1=1/2 1>2=1/3 2>3=2"),
    Input("g.csv", "0,+,-\n-,0,0\n0,+,0\n", "2>1=1 3>1=-1 1>2=-1 2>3=1"),
    Input("g.txt", "0 -1\n2 0\n", "2>1=-1 1>2=2"),
    Input("g.txt", "0 1\n1 0\n", says=("edge 0 -> 1 has no weight",)),
    Input("g.txt", "1 2 5 7\n2 1 6 7\n3 1 8 9\n4 1 8 9\n", says=("line 1", "--columns 1,2,3")),
    Input("g.json", "[[0, -1], [2, 0]]", "2>1=-1 1>2=2"),
    Input("g.csv", "a,b,c\n0,1,-1\n2,0,0\n0,3,0\n", "b>a=1 c>a=-1 a>b=2 b>c=3"),
]
FORMATS = [
    Input("g.json", links(directed=True), "ann>bob=-1/2"),
    Input("g.json", links("edges"), "ann>bob=-1/2"),
    Input("g.txt", links("edges"), "ann>bob=-1/2"),
    Input("g.json", links(directed=False), says=("directed", "--undirected")),
    Input("g.json", links(directed=False), "ann>bob=-1/2 bob>ann=-1/2", how={"undirected": True}),
    Input(
        "g.json",
        '{"nodes": [{"name": "a"}, {"name": "b"}], "links": [{"source": 0, "target": 1, "value": -2}]}',
        "a>b=-2",
    ),
    Input(
        "g.json",
        '{"nodes": [{"id": "a"}], "links": [{"source": "a", "target": "b", "weight": 1}]}',
        says=("is no node",),
    ),
    Input("g.json", '{"graph": 5}', says=("is JSON, not a graph", "links")),
    Input("g.json", '[{"source": "a", "target": "b", "weight": 0.1, "sign": "-"}]', "a>b=-1/10"),
    Input("g.gexf", gexf(), "ann>bob=-1/2"),
    Input(
        "g.gexf",
        gexf(edge='weight="0.5"', values='<attvalues><attvalue for="0" value="-1"/></attvalues>'),
        "ann>bob=-1/2",
    ),
    Input("g.gexf", gexf(kind=""), says=("undirected", "--undirected")),
    Input("g.xml", gexf(), "ann>bob=-1/2"),
    Input("g.net", NET + "*Arcs\n1 2 1\n*Edges\n2 3 -1\n", "ann>bob=1 bob>eve=-1 eve>bob=-1"),
    Input("g.net", NET + "*Edges\n2 3 -1\n", says=("*Edges", "--undirected")),
    Input("g.net", NET + "*Matrix\n0 -1 0\n0 0 2\n0 0 0\n", "ann>bob=-1 bob>eve=2"),
    Input("g.net", NET + "*Arcslist\n1 2 3\n", "ann>bob=1 ann>eve=1"),
    Input("g.net", NET + '*Arcs :1 "trust"\n1 2 1\n*Arcs :2 "hate"\n2 3 1\n', says=('"trust", "hate"', "--variable")),
    Input("g.net", NET + '*Arcs :1 "trust"\n1 2 1\n*Arcs :2 "hate"\n2 3 -1\n', "bob>eve=-1", how={"variable": "hate"}),
    Input("g.net", NET.replace("3\n", "3 2\n", 1) + "*Edges\n1 3 1\n", says=("two sets of nodes",)),
    Input("g.net", NET.replace('"eve"', "O'Brien") + "*Arcs\n1 3 1\n", "ann>O'Brien=1"),
    Input("g.paj", f"*Network one\n{NET}*Arcs\n1 2 -1\n*Partition p\n*Vertices 3\n1\n2\n1\n", "ann>bob=-1"),
    Input(
        "g.dl",
        "dl n=3 format=fullmatrix\nlabels:\nada,bo,cy\ndata:\n0 1 -1\n1 0 0\n0 -1 0\n",
        "bo>ada=1 cy>ada=-1 ada>bo=1 bo>cy=-1",
    ),
    Input("g.dl", "DL N = 2\nLABELS EMBEDDED\nDATA:\n     ada bo\nada 0 -2\nbo 1 0\n", "bo>ada=-2 ada>bo=1"),
    Input("g.dl", "dl n=2 format=edgelist1\nlabels embedded\ndata:\nada bo -2\n", "ada>bo=-2"),
    Input("g.dl", "dl n=3 format=nodelist1\ndata:\n1 2 3\n", "1>2=1 1>3=1"),
    Input("g.dl", "dl nr=2 nc=3\ndata:\n1 2 3\n4 5 6\n", says=("one number n",)),
    Input("g.dl", "dl n=2\ndata:\n0 1 1\n", says=("3 entries", "2 x 2")),
    Input("g.mat", mat(A=[[0, 1], [1, 0]], B=[[0, -2], [1, 0]]), "2>1=-2 1>2=1", how={"variable": "B"}),
    Input("g.mat", mat(A=[[0, 1], [1, 0]], B=[[0, -2], [1, 0]]), says=("A, B", "--variable")),
    Input("g.mat", mat(A=[[0, 1], [1, 0]]), says=("called C", "A"), how={"variable": "C"}),
    *(
        Input(f"g.{ending}", first + b"\0" * 60, says=(kind, mend))
        for ending, first, kind, mend in [
            ("xlsx", b"PK\3\4 xl/workbook.xml", "an Excel workbook", "CSV"),
            ("csv", b"\xd0\xcf\x11\xe0", "an old Excel workbook", "CSV"),
            ("RData", b"RDX3\nX\n", "R data", "write.csv"),
            ("h5", b"\x89HDF\r\n", "HDF5", ".npy"),
            ("parquet", b"PAR1", "Parquet", "read_parquet"),
            ("feather", b"ARROW1", "Feather", "read_feather"),
            ("pkl", b"\x80\x04", "a pickle", "not read"),
            ("csv", b"<!DOCTYPE html><html>", "a page", "the file itself"),
            ("csv", b"%PDF-1.7", "a PDF", "rows source,target,weight"),
            ("csv", b"\x89PNG", "an image", "rows source,target,weight"),
            ("csv", b"SQLite format 3", "SQLite", "CSV"),
            ("bz2", b"BZh91", "packed by bzip2", "gzip"),
        ]
    ),
]
#: Sizes beside signs, rows that go the other way, numbers of nodes, and numbers that wrapped round.
OTHERS = [
    Input("g.csv", "source,target,sign,strength\na,b,-1,1.5\nb,a,1,2\n", "a>b=-3/2 b>a=2"),
    Input("g.csv", "Influencer,Influenced,Valence,Magnitude\na,b,-1,4\nb,a,1,2\n", "a>b=-4 b>a=2"),
    Input("g.csv", "source,target,type,magnitude\na,b,inhibits,3\nb,a,activates,4\n", "a>b=-3 b>a=4"),
    Input("g.csv", "source,target,weight,vote\na,b,2,against\nb,a,1,for\n", "a>b=-2 b>a=1"),
    Input("g.csv", "source,target,weight,direction\na,b,2,->\nb,c,-1,->\n", "a>b=2 b>c=-1"),
    *(
        Input(
            "g.csv", f"node1,node2,weight,{title}\na,b,2,{one}\nb,c,-1,{other}\n", says=("line 3", other, "turn such")
        )
        for title, one, other in [
            ("direction", "->", "<-"),
            ("arrows", "->", "<->"),
            ("x", "->", "<-"),
            ("Dir", "forward", "both"),
            ("edge_direction", "out", "in"),
        ]
    ),
    Input("g.csv", "node1,node2,weight,group\na,b,2,out\nb,c,-1,in\n", "a>b=2 b>c=-1"),
    Input("g.csv", "i,j,a_ij\n1,2,3\n2,1,-1\n", says=("line 1", "--edges listens if i listens to j")),
    Input("g.csv", "i,j,a_ij\n1,2,3\n2,1,-1\n", "2>1=3 1>2=-1", how={"orientation": "listens"}),
    Input("g.csv", '"k","l","w(k,l)"\n1,2,3\n2,1,-1\n', says=("line 1", "--edges listens if k listens to l")),
    Input("g.csv", "listens,to,weight\n1,2,3\n2,1,-1\n", says=("line 1", "--edges listens")),
    Input("g.txt", "4\n0 1 1\n1 2 -1\n2 3 1\n3 0 1\n", says=("4 is the number of nodes or edges",)),
    Input("g.txt", "2\na b 1\nb c -1\n", says=("2 is the number of nodes or edges",)),
    Input("g.txt", "3\n1 2 1\n2 3 -1\n3 1 1\n", "1>2=1 2>3=-1 3>1=1"),
    Input("g.csv", "source,target,weight\n2\na,b,1\nb,a,-1\n", "a>b=1 b>a=-1"),
    Input("out.a", "% asym positive\n1 2 3\n2 3 1\n3 1 2\n", "1>2=3 2>3=1 3>1=2"),
    *(
        Input("g.npy", npy([[0, 1], [-1, 0]], kind), says=("is what -1 becomes in uint", "int64"))
        for kind in ("u1", "u2", "u4", "u8")
    ),
    Input("g.npy", npy([[0, 1], [200, 0]], "u1"), "2>1=1 1>2=200"),
    Input("g.npy", npy([[0, 1], [-3, 0]], "u2"), says=("65533 is what -3 becomes in uint16",)),
    Input("g.csv", "source,target,weight\n1,2.0,1\n2,3.0,-1\n3,1.0,1\n4,,\n", says=("2 and 2.0 are one number",)),
    Input("g.csv", "source,target,weight\n10,10.0,1\n10.0,beta,-1\n", "10>10.0=1 10.0>beta=-1"),
    Input("g.sif", "a\tactivates\tb\n#1\t1\tb\n", says=("line 2", "a row or a comment")),
    Input("g.csv", "source,target,weight\n1.0,2.0,1\n2.0,1.0,-1\n", "1.0>2.0=1 2.0>1.0=-1"),
    Input("g.sif", "a\tactivates\tb\nType 1 diabetes\n#version 1 of it\n", "a>b=1"),
    Input("g.csv", "sep=;\na;b;1\nb;a;-2\n", "a>b=1 b>a=-2"),
    Input("g.csv", "source,target,weight\na,b,1\n\ufeffb,a,-1\n", "a>b=1 b>a=-1"),
    Input("g.csv", "# target,source,weight\na,b,1\nb,a,-1\n", says=("a comment names the columns", "--columns")),
    Input("g.csv", "# source,target,weight\na,b,1\nb,a,-1\n", "a>b=1 b>a=-1"),
    Input("g.csv", "# trust from users to users, from 2020 to 2021\na,b,1\nb,a,-1\n", "a>b=1 b>a=-1"),
    Input("g.txt", "# downloaded from here, write to me\n1 2 1\n2 1 -1\n", "1>2=1 2>1=-1"),
    Input("g.txt", "# FromNodeId\tToNodeId\tSign\n1\t2\t1\n2\t1\t-1\n", "1>2=1 2>1=-1"),
    Input("g.csv", "Gene1,Gene2,min,max\na,b,-1,2\n", says=("a family of graphs",)),
    Input("g.csv", "source,target,weight,max\na,b,-1,2\n", "a>b=-1"),
    Input("m.csv", ";a;1,5\na;0;0,5\n1,5;1;0\n", "1,5>a=0.5 a>1,5=1"),
    Input("m.csv", ";a;b\na;0;0,5\nb;1.5;0\n", says=("row a, column b of the matrix", "write decimals with a point")),
    Input("m.csv", ",a,b\na,0,NA\nb,1,0\n", says=("row a, column b of the matrix", '"NA" is not a number')),
    Input(
        "g.csv",
        "source,target,sign,weight\na,b,1\na,,1,2\na,a,1,2\nb,a,1,0\na,c,1,2,3\n",
        says=(
            'line 2: edge a -> b has no weight (add one in column "weight")',
            "line 3: the target",
            "line 4: self-loop",
            "line 5: weight 0",
            "line 6: 5 fields",
        ),
    ),
    Input(
        "g.csv", "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n", says=("Git LFS", "git lfs pull")
    ),
]


def gml(edge: str) -> str:
    nodes = 'node [ id 0 label "a" ] node [ id 1 label "b" ]'
    return f"graph [ directed 1 {nodes} edge [ source 0 target 1 {edge} ] ]"


#: The key of another attribute of edges, with the title of the weight.
SECOND_KEY = '<key id="x" for="edge" attr.name="{}" attr.type="double"/><key id="v" '
TITLED = '<attributes class="edge"><attribute id="0" title="sign" type="integer"/>'
#: What libraries and readers of ours took for another number, merged or dropped.
NUMBERS_AND_ATTRIBUTES = [
    *(
        Input("g.gml", gml(f"weight {text}"), f"a>b={weight}")
        for text, weight in [
            ("1e-05", "1/100000"),
            ("-1e-05", "-1/100000"),
            ("1e+20", "100000000000000000000"),
            ("1E-05", "1/100000"),
            (".5", "1/2"),
            ("5.", "5"),
            ("+1", "1"),
            ("1.5E3", "1500"),
            ("-.5e-3", "-1/2000"),
            ("5.e1", "50"),
            ('"1e-05"', "1/100000"),
            ("1 # 1e-05 1x\n", "1"),
        ]
    ),
    *(Input("g.gml", gml(f"weight {text}"), says=("not a finite number",)) for text in ("INF", "-INF", "NAN", "1e400")),
    Input("g.gml", gml("weight 1e-400"), says=("outside the range of float64",)),
    Input("g.gml", gml("weight 1x 2"), says=("line 1", '"1x" is no number')),
    Input("g.gml", gml('weight 2 note "1x 1e-05"'), "a>b=2"),
    Input("g.gml", gml("weight 1 weight -1"), says=("edge a -> b", 'two attributes are named "weight" (1 and -1)')),
    Input("g.gml", gml("weight 1 Weight -1"), says=("edge a -> b", 'two attributes are named "weight" (1 and -1)')),
    Input("g.gml", gml("weight 2 Weight 2.0"), "a>b=2"),
    Input("g.gml", gml('weight 2 tag "x" tag "y"'), "a>b=2"),
    Input("g.gml", gml('weight 2 kind "activates" kind "inhibits"'), says=('named "kind" (activates and inhibits)',)),
    Input("g.graphml", graphml('<data key="w">2</data><data key="w">-2</data>'), says=('"weight" (2.0 and -2.0)',)),
    *(
        Input(
            "g.graphml",
            graphml('<data key="w">2</data><data key="x">-2</data>').replace('<key id="v" ', SECOND_KEY.format(title)),
            says=("edge n0 -> n1", 'two attributes are named "weight" (2.0 and -2.0)'),
        )
        for title in ("weight", "Weight")
    ),
    Input("g.graphml", graphml('<data key="w">1e-05</data>'), "n0>n1=1/100000"),
    Input("g.graphml", graphml('<data key="w">1e-400</data>'), says=("outside the range of float64",)),
    *(
        Input(
            "g.graphml",
            graphml('<data key="w">2</data>').replace('target="n1"', f'target="n1" directed="{told}"'),
            *is_,
        )
        for told, is_ in [
            ("1", ("n0>n1=2",)),
            ("true", ("n0>n1=2",)),
            ("0", ("", ('edge n0 -> n1 has directed="0"', "as two"))),
            ("no", ("", ('edge n0 -> n1 has directed="no"',))),
        ]
    ),
    Input(
        "g.graphml",
        graphml('<data key="w">2</data>').replace('"directed"', '"Directed"'),
        says=('edgedefault="Directed"; write edgedefault="directed"',),
    ),
    Input(
        "g.graphml",
        graphml('<data key="w">2</data>').replace(' edgedefault="directed"', ""),
        says=("no edgedefault; write",),
    ),
    Input(
        "g.json",
        '[{"source": "a", "target": "b", "weight": 2, "Weight": -2}]',
        says=("edge a -> b", 'two attributes are named "weight" (2 and -2)'),
    ),
    Input(
        "g.json",
        '[{"source": "a", "target": "b", "weight": 2, "Weight": -2}]',
        says=('"weight" (2 and -2)',),
        how={"columns": "source,target,weight"},
    ),
    Input("g.json", '[{"source": "a", "target": "b", "weight": 2, "Weight": 2.0}]', "a>b=2"),
    *(
        Input("g.gexf", gexf(edge=f'weight="2" {title}="inhibits"'), "ann>bob=-2")
        for title in ("label", "kind", "sign")
    ),
    Input("g.graphml", graphml('<data key="w">2</data>').replace(' target="n1"', ' target="n1" sign="-1"'), "n0>n1=-2"),
    Input("g.graphml", graphml("").replace(' target="n1"', ' target="n1" weight="-2"'), "n0>n1=-2"),
    Input("g.net", NET + '*Arcs\n1 2 2 l "inhibits" c Red\n2 3 1 l activates\n', "ann>bob=-2 bob>eve=1"),
    Input("g.net", NET + '*Arcs\n1 2 2 l "inhibits"\n2 3 1 c Red\n', says=('"label" holds inhibits', "signs")),
    Input("g.net", NET + '*Arcs\n1 2 -2 l "a b"\n*Edges\n2 3 1 l "c"\n', "ann>bob=-2 bob>eve=1 eve>bob=1"),
    *(
        Input("g.gexf", gexf(edge=edge, values=values).replace(TITLED, f"{TITLED}{more}"), edges, says)
        for more, edge, values, edges, says in [
            ("", 'weight="2"', '<attvalue id="0" value="-1"/>', "ann>bob=-2", ()),
            (
                '<attribute id="1" title="Weight"/>',
                'weight="2"',
                '<attvalue for="1" value="-3"/>',
                "",
                ("edge ann -> bob", '"weight" (2 and -3)'),
            ),
            ('<attribute id="1" title="Weight"/>', 'weight="2"', '<attvalue for="1" value="2.0"/>', "ann>bob=2", ()),
            (
                '<attribute id="1" title="Weight"><default>1</default></attribute>',
                'weight="2"',
                "",
                "ann>bob=2",
                (),
            ),
            (
                '<attribute id="1" title="Sign"/>',
                'weight="2"',
                '<attvalue for="0" value="1"/><attvalue for="1" value="-1"/>',
                "",
                ('"sign" (1 and -1)', "keep one"),
            ),
            (
                '<attribute id="1" title="weight"/>',
                "",
                '<attvalue for="1" value="2" start="1"/><attvalue for="1" value="-2" start="2"/>',
                "",
                ('"weight" (2 and -2)', "keep one"),
            ),
            ("", "", '<attvalue for="weight" value="-2"/>', "ann>bob=-2", ()),
        ]
    ),
]
#: Labels that are not one for each node, fields that are separated otherwise, graphs without edges, small numbers.
ROWS_AND_MATRICES = [
    *(
        Input("g.dl", f"dl n=3 format={layout}\nlabels:\na a b\ndata:\n{rows}\n", says=("same label",))
        for layout, rows in [
            ("edgelist1", "1 2 1\n2 1 -1"),
            ("edgelist1", "1 2 1\n2 3 -1"),
            ("nodelist1", "1 2\n2 3"),
            ("fullmatrix", "0 1 0\n0 0 1\n1 0 0"),
        ]
    ),
    *(
        Input("g.dl", f"dl n=3\n{labels}data:\n0 1 0\n0 0 -2\n5 0 0\n", edges, says)
        for labels, edges, says in [
            ("row labels:\na b c\ncolumn labels:\na b c\n", "b>a=1 c>b=-2 a>c=5", ()),
            ("row labels:\na b c\ncolumn labels:\nc b a\n", "", ("labels of rows and columns differ",)),
            ("ROW LABELS:\na b c\nCOL LABELS:\nc b a\n", "", ("labels of rows and columns differ",)),
            ("column labels:\na b c\n", "b>a=1 c>b=-2 a>c=5", ()),
        ]
    ),
    Input("g.dl", "dl n=4 format=edgelist1\nlabels embedded\ndata:\na b 1\nb c -1\n", says=("3 nodes, and n=4",)),
    Input("g.dl", "dl n=2 format=edgelist1\nlabels embedded\ndata:\na b 1\nb c -1\n", says=("3 nodes, and n=2",)),
    Input("g.sif", "a\tactivates\tb\nb inhibits c\n", says=("line 2", "one field here", "by tabs")),
    Input("g.sif", "a activates b\nb,inhibits,c\n", says=("line 2", "one field here", "by blanks")),
    Input("g.sif", "a\tactivates\tb\n#b c\tinhibits\td\n", says=("line 2", "a row or a comment")),
    Input("g.sif", "a\tactivates\tb\nprotein kinase C\n", "a>b=1"),
    *(
        Input("g.sif", f"b inhibits c\n#a {relation} b\n", says=("line 2", "a row or a comment", '"# "'))
        for relation in ("activates", "-1", "-")
    ),
    *(
        Input("g.sif", f"{comment}\nb inhibits c\n", "b>c=-1")
        for comment in ("# a activates b", "#", "##1 - 2", "#source interaction target", "#all of it")
    ),
    *(
        Input("g.mtx", f"%%MatrixMarket matrix {rows}\n", says=("entry -1e-400 is outside the range of float64",))
        for rows in ("array real general\n2 2\n0\n0.0e5\n-1e-400\n0", "coordinate real general\n2 2 1\n2 1 -1e-400")
    ),
    Input("g.mtx", "%%MatrixMarket matrix array real general\n2 2\n0 0.0e5\n-1e-300 -0\n", f"2>1=-1/{10**300}"),
]
UNDIRECTED = ("#undirected", "  # Undirected graph", "# directed=False", "# Undirected network of allies")
#: Words for signs as titles and in rows, and rows that lack them.
TITLES_AND_WORDS = [
    Input("g.csv", "source,target,weight,sign\na,b,NA,\n", says=("line 2", 'edge a -> b has no "sign"')),
    Input("g.csv", "source,target,sign,weight\na,b,1,2\nb,a,x,\n", says=("line 3", "edge b -> a has no weight")),
    Input("g.csv", "source,target,trust\nann,bob,trust\nbob,carl,distrust\n", "ann>bob=1 bob>carl=-1"),
    Input("g.csv", "source,target,trust\nann,bob,5\nbob,carl,-3\n", "ann>bob=5 bob>carl=-3"),
    Input("g.csv", "target,activation,source\na,5,b\nb,-3,c\n", "b>a=5 c>b=-3"),
    Input("g.csv", "source,target,5\ntarget,bob,-3\n", "source>target=5 target>bob=-3"),
    *(
        Input("g.csv", f"{header}\na,b,{rest}\n", says=("line 1", "names no weight", "--columns"))
        for header, rest in [
            ("source,target,inhibition", "5"),
            ("source,target,+", "-"),
            ("source,target,score", "5"),
            ("from,to,support,year", "1,1999"),
        ]
    ),
    Input("g.csv", "SourceGene,TargetGene,Activator\na,b,activates\nb,c,inhibits\n", "a>b=1 b>c=-1"),
    Input("g.csv", "target,influencer,trust\na,b,trust\nb,c,distrust\n", "b>a=1 c>b=-1"),
    Input("g.csv", "follower,leader,trust\na,b,trust\nb,c,distrust\n", says=("line 1", "--edges listens")),
    Input("g.csv", "gene1,gene2,activates\ngene2,gene3,inhibits\n", "gene1>gene2=1 gene2>gene3=-1"),
    Input("g.csv", "source,target,sign,type\na,b,1,activates\nb,c,1,inhibits\n", says=("line 3", "disagree")),
    Input("g.csv", "source,target,sign,type\na,b,1,activates\nb,c,-1,inhibits\n", "a>b=1 b>c=-1"),
    Input("g.csv", "source,target,weight,type\na,b,1,activates\nb,c,2,activates\n", "a>b=1 b>c=2"),
    Input("g.csv", "source,target,weight,type\na,b,1,1\nb,c,2,1\n", says=("no -1",)),
    Input("g.csv", "source,target,mor\na,b,0.5\nb,c,-1\n", "a>b=1/2 b>c=-1"),
    Input("g.csv", "source,target,mor\na,b,2\nb,c,-1\n", says=("codes of relations",)),
    *(
        Input("g.csv", f"a,b,{plus}\nb,c,{minus}\n", "a>b=1 b>c=-1")
        for plus, minus in [
            ("excitatory", "inhibitory"),
            ("excites", "Inhibitory"),
            ("excitation", "-"),
            ("upregulated", "downregulated"),
            ("cooperation", "conflict"),
        ]
    ),
    Input("g.csv", "source,target,weight,excites\na,b,2,no\nb,c,1,yes\n", says=("excites", "are these signs")),
    Input("g.csv", ",,\nsource,target,weight\na,b,2\nb,a,-1\n", "a>b=2 b>a=-1"),
    Input("g.csv", ";;\na;b;2\nb;a;-1\n", "a>b=2 b>a=-1"),
    Input("g.sif", "A\tactivates\tB\t0.5\n", says=("line 1", "0.5 is a score")),
    Input("g.sif", "1\t-1\t2\t3\n", "1>2=-1 1>3=-1"),
]


def named_nodes(links: str, *nodes: str) -> str:
    """Write nodes without an id, and links between them."""
    ends = "".join(links.split()).split(",")
    edges = [f'{{"source": {one}, "target": {other}, "value": -1}}' for one, other in (end.split(">") for end in ends)]
    return f'{{"nodes": [{",".join(nodes)}], "links": [{",".join(edges)}]}}'


ONE_TWO_THREE = '{"name": "1"}', '{"name": "2"}', '{"name": "3"}'
#: Nodes of JSON by position and by name, lists of neighbours, counts, printed matrices, corners and comments.
NODES_AND_COMMENTS = [
    Input("g.json", named_nodes('"1">"2"', *ONE_TWO_THREE), "1>2=-1"),
    Input("g.json", named_nodes("1>2", *ONE_TWO_THREE), "2>3=-1"),
    Input("g.json", named_nodes('"a">"b"', '{"label": "a"}', '{"label": "b"}'), "a>b=-1"),
    Input("g.json", named_nodes("0>1", '{"name": null}', '{"name": "b"}'), "0>1=-1"),
    *(
        Input("g.json", named_nodes(links, *nodes), says=("its own id",))
        for links, nodes in [
            ('"1">2', ONE_TWO_THREE),
            ('"1">"4"', ONE_TWO_THREE),
            ('"1">"2"', ('{"name": "1"}', '{"name": "2"}', '{"name": null}')),
            ('"1">"2"', ('{"name": "1"}', '{"name": "2"}', '{"name": "2"}')),
            ('"1">"2"', ('{"name": "1", "label": "2"}', '{"name": "2", "label": "1"}')),
            ("0>1", ('{"id": "a"}', '{"name": "b"}')),
        ]
    ),
    Input("g.json", named_nodes('null>"1"', *ONE_TWO_THREE), says=("link 1 has no source",)),
    Input("g.txt", "0 1 2\n1\n2\n", says=("lists of neighbours",)),
    Input("g.txt", "#adjlist\n0 1 2 3\n1 2 3\n2\n3\n", says=("lists of neighbours",)),
    Input("g.txt", "0 1 2\n3\n4\n", "0>1=2"),
    Input("g.txt", "4 3 1\n1 2 5\n2 3 -7\n3 4 1\n", says=("line 1", "numbers of nodes and of edges", "--columns")),
    Input("g.txt", "4 3 -1\n1 2 5\n2 3 -7\n3 4 1\n", "4>3=-1 1>2=5 2>3=-7 3>4=1"),
    Input("g.txt", "  (0, 1) 0.5\n  (1, 0) -1.0\n", says=("(0,", "sparse matrix", ".npz")),
    *(
        Input("g.csv", f"{corner},a,b\na,0,2\nb,-1,0\n", edges, says, how)
        for corner in ("source", "from", "Regulator", "leader", "from\\to", "source/target", "Source Gene")
        for edges, says, how in [
            ("", ("line 1", "the corner", "--edges information"), {}),
            ("a>b=2 b>a=-1", (), {"orientation": "information"}),
        ]
    ),
    *(Input("g.csv", f"{corner},a,b\na,0,2\nb,-1,0\n", "b>a=2 a>b=-1") for corner in ("target", "to\\from", "gene")),
    Input("g.csv", "from b\nfrom 0 2\nb -1 0\n", "b>from=2 from>b=-1"),
    *(
        Input("g.txt", f"# {titles}\n1 2 3\n2 3 -1\n", says=("a comment names the columns", "--columns"))
        for titles in (
            "follower,leader,weight",
            "target,regulator,effect",
            "i j a_ij",
            "i,j,w(i,j)",
            "rater ratee rating",
            "Gene TF Mode",
            "user followee trust",
        )
    ),
    *(
        Input("g.txt", f"# {prose}\n1 2 3\n2 3 -1\n", "1>2=3 2>3=-1")
        for prose in ("made by me", "gene1 gene2 effect", "to start with", "converted from undirected data")
    ),
    *(Input("g.txt", f"{line}\n1 2 3\n2 3 -1\n", says=(line.strip(), "--undirected")) for line in UNDIRECTED),
    *(
        Input("g.txt", f"{line}\n1 2 3\n2 3 -1\n", "1>2=3 2>3=-1")
        for line in ("# directed=True", "# undirected: no", "# undirectedness was removed")
    ),
]
#: Laplacians as edges, with the sums over those who are heard or who listen.
HEARD = "1,1,3\n2,2,1\n3,3,1\n1,2,-1\n1,3,-2\n2,1,-1\n3,2,1\n"
LISTEN = "1,1,3\n2,2,1\n3,3,1\n2,1,-1\n3,1,-2\n1,2,-1\n2,3,1\n"
LAPLACIANS_OF_EDGES = [
    Input("g.csv", LISTEN, "2>1=1 3>1=2 1>2=1 2>3=-1", how={"laplacian": True}),
    Input("g.csv", HEARD, says=("over edges of one source", "--edges listens"), how={"laplacian": True}),
    Input("g.csv", HEARD, "2>1=1 3>1=2 1>2=1 2>3=-1", how={"laplacian": True, "orientation": "listens"}),
]
#: Comments that name columns or kinds of edges, titles and edges that look like each other, wide tables.
TURNED = (
    "target source score|to from trust|target, source weight|i j a(i,j)|"
    "columns: target source weight|Format: target source weight|"
    "gene tf activation|Target,Source,Correlation|To Node, From Node, Sign|target gene,source gene,weight"
)
SAYS_UNDIRECTED = (
    "Type: undirected|weighted, undirected|is_directed: false|directed graph: no|directed false|"
    "This is an undirected signed network|Undirected graph; self-loops were removed|undirected n=4 m=3|"
    "Undirected friendship network. Edges were collected in 2019.|Undirected graph, not weighted"
)
SAYS_NOTHING = (
    "Undirected edges were replaced by two arcs|undirected: n|undirected False|Target node values|"
    "to be weighted|not undirected|directed: true|directed no self-loops|Bidirected = no|directed graph no. 3|"
    "For an undirected version see other.txt|Options: directed, undirected|Network from friends|"
    "Data from activation|target is positive|i j a_ji|j i a_ij"
)
WIDE = "lexA,-1,-1,1\ncrp,1,1,1\n"
MIRRORED = "# Undirected graph\n1 2 3\n2 1 3\n2 3 -1\n3 2 -1\n"
WORDS_OR_TITLES = [
    *(
        Input(
            "g.csv",
            f"# {line}\n" + ("1,2,3\n2,3,-1\n" if "," in line else "1 2 3\n2 3 -1\n"),
            says=("--columns 2,1,3",),
        )
        for line in TURNED.split("|")
    ),
    Input("g.txt", "# prose\n" * 300 + "# target source weight\n1 2 3\n2 3 -1\n", says=("--columns 2,1,3",)),
    *(Input("g.txt", f"# {line}\n1 2 3\n2 3 -1\n", says=("--undirected",)) for line in SAYS_UNDIRECTED.split("|")),
    *(Input("g.txt", f"# {line}\n1 2 3\n2 3 -1\n", "1>2=3 2>3=-1") for line in SAYS_NOTHING.split("|")),
    *(
        Input("g.txt", f"# {line}\n1 2 3\n2 3 -1\n", says=("--undirected",))
        for line in ("directed=False, weighted=True", "Undirected graph has 34 nodes", "Directed: No (each pair once)")
    ),
    *(
        Input("g.txt", f"# {line}\n1 2 3\n2 3 -1\n", "1>2=3 2>3=-1")
        for line in (
            *(
                "undirected=False, weighted=True",
                "undirected edges: 0",
                "If the graph is undirected, list each edge twice.",
            ),
            *("Downloaded from https://snap.stanford.edu/data/soc-sign-epinions.html", "exported from weights.csv"),
            *("Data from BitcoinTrust", "to measure influence"),
        )
    ),
    *(
        Input("g.txt", f"% {line} weight\n1 2 1.5\n2 3 -2\n", says=("--columns 2,1,3",))
        for line in ("listener speaker", "reader writer", "sink source")
    ),
    Input("g.txt", "# Undirected network was collected by Zachary\n1 2 1\n2 3 -2\n", says=("--undirected",)),
    Input("g.txt", "# converted from W\n1 2 1\n2 3 -2\n", "1>2=1 2>3=-2"),
    Input("g.csv", "# target,source,weight\ra,b,1\rb,c,-1\r", says=("--columns 2,1,3",)),
    Input("g.csv", "# edge list: (target, source, weight)\na,b,1\nb,c,-1\n", says=("--columns 2,1,3",)),
    Input("g.txt", "HDAC1 HDAC2 Repression\nTP53 MDM2 Activation\n", "HDAC1>HDAC2=-1 TP53>MDM2=1"),
    Input("g.txt", "21 22 activation\n3 4 inhibition\n", "21>22=1 3>4=-1"),
    *(
        Input("g.txt", f"{first}\n1 2 1\n2 3 -1\n3 1 1\n", says=("line 1", "text, or an edge?"))
        for first in ("n = 3", "nodes : 3", "number nodes 3")
    ),
    Input("g.txt", "1 2 1\n2 3 -1\n3 1 1\nTotal edges: 2\n", says=("line 4", "text, or an edge?")),
    Input("g.csv", "0,1,2\nAnn,Bob,1\nBob,Cat,-1\n", says=("line 1", "text, or an edge?")),
    Input("g.csv", "0,1,2\n0,1,0\n0,0,-1\n1,0,0\n", says=("line 1", "above a matrix")),
    *(
        Input("g.csv", f"{header}\n1,a,b,1\n2,b,c,-1\n", says=("line 1", "--columns"))
        for header in ("wave,sender,receiver,weight", "week,i,j,rating", "period,ego,alter,weight")
    ),
    Input("g.csv", "TF,target,effect,source\na,b,1,RegulonDB\nb,c,-1,x\n", says=("who is heard, TF or source?",)),
    Input("g.csv", "TF,study,gene,effect\na,s1,b,1\nb,s2,c,-1\n", says=("line 1", "--columns")),
    Input("g.csv", "# target,source,weight,sign\na,b,1,1\nb,c,2,-1\n", says=("remove # before target",)),
    Input("g.txt", MIRRORED, says=("--undirected --duplicates last",)),
    Input("g.txt", MIRRORED, "1>2=3 2>1=3 2>3=-1 3>2=-1", how={"undirected": True, "duplicates": "last"}),
    *(
        Input("g.csv", f"{corner},geneA,geneB,geneC\n{WIDE}", says=("line 1", "looks like a matrix with names"))
        for corner in ("Regulator", "source", "target", "TF", "gene")
    ),
    Input("g.csv", "country1,country2,cooperation\nUSA,RUS,-\nUSA,UK,+\n", "USA>RUS=-1 USA>UK=1"),
    Input("g.csv", "country1,country2,conflict\nUSA,RUS,-1\nUSA,UK,2\n", "USA>RUS=-1 USA>UK=2"),
    Input("g.csv", "Gene1,Gene2,Excitation\na,b,activates\nb,c,inhibits\n", says=("are titles, or an edge?",)),
    Input("g.csv", "P1,P2,activation\nP3,P4,inhibition\n", "P1>P2=1 P3>P4=-1"),
    Input("g.csv", "state1,state2,conflict\nUSA,USSR,1\nUSA,UK,0.5\n", says=("no negative number",)),
    Input("g.csv", "TF,target,mor\nSOX2,1,1\nMYC,0,-1\n", "SOX2>1=1 MYC>0=-1"),
    Input("g.csv", "EndNodes_1,EndNodes_2,Weight\nin,0,1\nhub,1,-1\n", "in>0=1 hub>1=-1"),
    Input("g.csv", "protein1,protein2,score\na,,1\nb,,2\n", says=("target is empty",)),
    Input("g.csv", "source,target,valence\na,b,0.5\nb,c,0.8\n", "a>b=1/2 b>c=4/5"),
    Input("g.csv", "city1,city2,travel_time\na,b,3\nb,c,4\n", "a>b=3 b>c=4"),
    Input("g.txt", "# rater,ratee,rating\n1,2,1\n2,3,-1\n", says=("--columns 1,2,3",)),
    Input(
        "g.json",
        '{"directed": true, "graph": {"directed": false}, "links": [{"source": "a", "target": "b", "weight": 2}]}',
        "a>b=2",
    ),
    Input("g.csv", "ego,alter,like\na,b,+\nb,c,-\n", says=("line 1", "--edges listens")),
    Input("g.csv", "leader,f1,trust\nleader,f2,distrust\nf1,f2,trust\n", "leader>f1=1 leader>f2=-1 f1>f2=1"),
    Input("g.csv", "Start,Cln3,activates\nMBF,Clb5,activates\n", "Start>Cln3=1 MBF>Clb5=1"),
    Input("g.csv", "leader,f1,trust\nf2,f3,distrust\n", says=("line 1", "are titles, or an edge?")),
    Input("g.csv", "user1,user2,year,trust\na,b,1999,1\nb,c,2001,-1\n", says=("line 1", "names no weight")),
    Input("g.csv", "gene1,gene2,pmid,kind\na,b,1999,x\nb,c,2001,y\n", says=("line 1", "names no weight")),
    Input("g.csv", "voter,candidate,vote\na,b,1\nb,c,-1\n", "b>a=1 c>b=-1", how={"orientation": "listens"}),
    Input("g.csv", "user,account,score\na,b,1\nb,c,-1\n", "b>a=1 c>b=-1", how={"orientation": "listens"}),
    *(
        Input("g.json", f'{{{say}, "links": [{{"source": "a", "target": "b", "weight": 2}}]}}', says=("--undirected",))
        for say in ('"undirected": true', '"graph": {"directed": false}')
    ),
]
INPUTS = [
    *(SIGNS + UNKNOWN_SIGNS + DIRECTIONS + SIGNS_BESIDE + ORDINARY + LAPLACIANS + ROWS + MATRICES + FORMATS + OTHERS),
    *NUMBERS_AND_ATTRIBUTES,
    *ROWS_AND_MATRICES,
    *TITLES_AND_WORDS,
    *NODES_AND_COMMENTS,
    *LAPLACIANS_OF_EDGES,
    *WORDS_OR_TITLES,
]


def put(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def told(graph: ptcc.SignedDigraph) -> set[tuple[str, str, Fraction]]:
    return set(graph.edges)


def expected(edges: str) -> set[tuple[str, str, Fraction]]:
    parts = [edge.replace("=", ">").split(">") for edge in edges.split(" ")]
    return {(source, target, Fraction(weight)) for source, target, weight in parts}


@pytest.mark.parametrize("one", INPUTS, ids=[f"{k} {one.name}" for k, one in enumerate(INPUTS)])
def test_a_file_is_the_graph_that_it_says_or_is_refused(tmp_path, one):
    path = put(tmp_path, one.name, one.content)
    if one.edges:
        graph = read_graph(path, **one.how)
        assert told(graph) == expected(one.edges)
        assert told(read_graph(path, **keywords_as(path, graph.read))) == expected(one.edges)
        return
    with pytest.raises(FormatError) as caught:
        read_graph(path, **one.how)
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message and caught.value.__cause__ is None
    for word in one.says:
        assert word in message


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("g.net", NET + "*Arcs\n1 2 1 [1-3]\n"),
        ("g.net", NET.replace('"eve"', '"eve" [2-*]') + "*Arcs\n1 2 1\n"),
        ("g.net", NET + "*Arcs\n1 2 1\n*Events\nTI 1\nAA 1 2\n"),
        ("g.gexf", gexf(edge='weight="1" start="2"')),
        ("g.gexf", gexf(edge='weight="1"', values='<spells><spell start="1" end="2"/></spells>')),
    ],
)
def test_a_graph_that_changes_in_time_says_that_times_are_ignored(tmp_path, name, content):
    notes = read_graph(put(tmp_path, name, content)).read["notes"]
    assert "times ignored: all edges are there at once" in notes


@pytest.mark.parametrize(
    "content", [NET.replace('"eve"', '"eve [2]"') + "*Arcs\n1 2 1\n", NET + "*Arcs\n1 2 1 c Red\n"]
)
def test_a_graph_without_times_says_nothing_of_them(tmp_path, content):
    assert not read_graph(put(tmp_path, "g.net", content)).read["notes"]


# ---------------------------------------------------------------------------------------------- in memory


def test_numbers_that_wrapped_round_are_refused_in_memory():
    with pytest.raises(GraphError, match="255 is what -1 becomes in uint8"):
        ptcc.as_graph(np.array([[0, 1], [-1, 0]]).astype("u1"), "listens")


def test_signs_beside_weights_of_networkx_edges_are_their_factors():
    graph = nx.DiGraph()
    graph.add_edge("a", "b", weight=0.5, sign=-1)
    graph.add_edge("b", "a", weight=1, sign="+")
    assert told(ptcc.as_graph(graph)) == expected("a>b=-1/2 b>a=1")
    assert told(ptcc.SignedDigraph.from_networkx(graph, "weight")) == expected("a>b=1/2 b>a=1")
    graph["b"]["a"]["sign"] = 2
    with pytest.raises(GraphError, match='"2" of edge b -> a in column "sign" is neither 1 nor -1'):
        ptcc.as_graph(graph)
    del graph["b"]["a"]["sign"]
    with pytest.raises(GraphError, match='edge b -> a has no "sign", and others have'):
        ptcc.as_graph(graph)


def test_a_type_of_networkx_edges_that_is_a_code_is_no_weight():
    graph = nx.DiGraph([("a", "b", {"type": 1}), ("b", "a", {"type": 2})])
    with pytest.raises(GraphError, match="codes of relations"):
        ptcc.as_graph(graph)
    assert told(ptcc.SignedDigraph.from_networkx(graph, "type")) == expected("a>b=1 b>a=2")


def test_networkx_graphs_take_what_the_flags_say():
    multi = nx.MultiDiGraph([("a", "b", {"weight": 1}), ("a", "b", {"weight": -3}), ("b", "b", {"weight": 1})])
    graph = ptcc.SignedDigraph.from_networkx(multi, duplicates="sum", drop_self_loops=True)
    assert told(graph) == expected("a>b=-2") and graph.read["self_loops"] == "dropped 1"
    both = ptcc.as_graph(nx.Graph([("a", "b", {"weight": -3})]), undirected=True)
    assert told(both) == expected("a>b=-3 b>a=-3")


def test_signs_beside_weights_of_a_pandas_table_are_their_factors():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame(
        {"source": [1, 2], "target": [2, 1], "weight": [0.5, 1], "type": ["inhibits", "activates"]}
    )
    assert told(ptcc.as_graph(table)) == expected("1>2=-1/2 2>1=1")
    assert told(ptcc.as_graph(table, columns="source,target,weight")) == expected("1>2=1/2 2>1=1")
    table["type"] = [1, 2]
    with pytest.raises(GraphError, match='in column "type" is neither 1 nor -1'):
        ptcc.as_graph(table)
    named = table.rename(columns={"source": "Gene1", "target": "Gene2", "weight": "score"})
    assert told(ptcc.as_graph(named, columns=("Gene1", "Gene2", "score"))) == expected("1>2=1/2 2>1=1")


def test_a_laplacian_in_memory_is_named_and_read():
    with pytest.raises(GraphError, match="as a Laplacian's; read it with as_graph"):
        ptcc.SignedDigraph.from_matrix(LAPLACIAN, orientation="listens")
    for matrix in (LAPLACIAN, np.array(LAPLACIAN, dtype=float), sparse.csr_array(np.array(LAPLACIAN))):
        graph = ptcc.SignedDigraph.from_matrix(matrix, orientation="listens", laplacian=True)
        assert told(graph) == expected(OF_LAPLACIAN)
        assert (graph.laplacian().toarray() == LAPLACIAN).all()
        assert ptcc.as_graph(matrix, "listens", laplacian=True) == graph


def test_a_laplacian_of_edges_in_memory_is_to_be_given_as_a_matrix():
    edges = [tuple(row.split(",")) for row in LISTEN.split()]
    for graph in (edges, nx.DiGraph([(a, b, {"weight": w}) for a, b, w in edges])):
        with pytest.raises(GraphError, match="give the matrix with laplacian=True, or leave the self-loops out"):
            ptcc.as_graph(graph)
    table = pd.DataFrame([row.split(",") for row in HEARD.split()], columns=["source", "target", "weight"])
    with pytest.raises(GraphError, match='Say orientation="listens"'):
        ptcc.as_graph(table, laplacian=True)


def test_titles_of_a_table_in_memory_are_read_as_those_of_a_file():
    ends = {"source": ["ann", "bob"], "target": ["bob", "carl"]}
    assert told(ptcc.as_graph(pd.DataFrame(ends | {"trust": ["trust", "distrust"]}))) == expected(
        "ann>bob=1 bob>carl=-1"
    )
    for title, says in (("inhibition", "names no weight"), (7, "is no graph; name them source, target, weight")):
        with pytest.raises(GraphError, match=says):
            ptcc.as_graph(pd.DataFrame(ends | {title: [1, 2]}))


def test_the_name_of_a_relation_of_pajek_is_told(tmp_path):
    for name, notes in (("trust", ('relation "trust"',)), ("", ())):
        content = NET + f'*Arcs :1 "{name}"\n1 2 1\n*Edges :1 "{name}"\n2 3 1\n'
        read = read_graph(put(tmp_path, "g.net", content)).read["notes"]
        assert read == (*notes, "*Edges go both ways (1)")


@pytest.mark.parametrize("comment", ["#metoo b 1", " #metoo,b,1", "\t%a;b;-1"])
def test_comments_between_blanks_or_indented_that_look_like_rows_are_told(tmp_path, comment):
    graph = read_graph(put(tmp_path, "g.txt", f"a b 1\n{comment}\n#read in May 2020\nb a -1\n"))
    assert graph.read["notes"] == (f"ignored as a comment: {comment.strip()}",)


def test_edges_in_memory_take_what_the_flags_say():
    edges = [("a", "b", 1), ("a", "b", -3), ("b", "b", 2), ("b", "c", 0)]
    with pytest.raises(GraphError) as caught:
        ptcc.as_graph(edges)
    for word in ("self-loop at node b", "weight 0 of edge b -> c", "two edges a -> b", "drop_self_loops=True"):
        assert word in str(caught.value)
    graph = ptcc.as_graph(edges, duplicates="sum", drop_self_loops=True, drop_zeros=True)
    assert told(graph) == expected("a>b=-2")
    assert told(ptcc.as_graph([("a", "b", "inhibits")], undirected=True)) == expected("a>b=-1 b>a=-1")
    with pytest.raises(ParameterError, match="laplacian"):
        ptcc.as_graph(edges, laplacian=True)


def test_a_matrix_as_text_asks_for_its_direction_in_python(tmp_path):
    path = put(tmp_path, "W.csv", MATRICES[0].content)
    with pytest.raises(GraphError, match="does not tell its direction"):
        ptcc.as_graph(path)
    assert told(ptcc.as_graph(path, "information")) == expected(MATRICES[1].edges)


def test_signs_of_any_title_in_memory_are_factors_or_refused_and_what_is_not_read_is_named():
    graph = nx.DiGraph(
        [("a", "b", {"weight": 2, "mode": "inhibits", "year": 9}), ("b", "a", {"weight": 1, "mode": "+"})]
    )
    read = ptcc.as_graph(graph)
    assert told(read) == expected("a>b=-2 b>a=1")
    assert read.read["notes"] == ('weights times column "mode"', 'columns ignored: "year"')
    assert told(ptcc.SignedDigraph.from_networkx(graph, "weight")) == expected("a>b=2 b>a=1")
    graph["a"]["b"]["negative"], graph["b"]["a"]["negative"] = True, False
    del graph["a"]["b"]["mode"], graph["b"]["a"]["mode"]
    with pytest.raises(GraphError, match='column "negative" holds True'):
        ptcc.as_graph(graph)
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"source": ["a", "b"], "target": ["b", "a"], "weight": [2, 1], "s": [-1, 1], "t": [8, 9]})
    assert told(ptcc.as_graph(table)) == expected("a>b=-2 b>a=1")
    with pytest.raises(GraphError, match='column "is_negative" holds True'):
        ptcc.as_graph(table.assign(s=9, is_negative=[True, False]))


# ---------------------------------------------------------------------------------------------- families


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("source,target,weight_min,weight_max,sign\na,b,1,2,-1\n", 'column "sign" holds -1 beside the weights'),
        ("source,target,weight,sign,optional\na,b,1,-1,yes\n", 'column "sign" holds -1 beside the weights'),
        ("source,target,type,optional\na,b,1,yes\nb,a,2,no\n", 'column "type" holds 2: codes of relations'),
        ("source,target,min,max,mode\na,b,1,2,inhibits\nb,a,-2,-1,inhibits\n", 'column "mode" holds inhibits'),
        ("source,target,min,max\na,b,1,2\nb;a;-1;-1\n", "b;a;-1;-1 is one field here"),
        ("source,target,min,max\na;b;1;2\n", "a;b;1;2 is one field here"),
        ("source,target,min,max\na,b,1,2\nb a -1 -1\n", "b a -1 -1 is one field here"),
        ("source,target,min,max\na,b,1,2\n,,5,\n", "line 3: the source is empty"),
        ("source,target,min,max\na,b,1,2\n,c,,\n", "line 3: the source is empty"),
        ("source,target,min,max,optional\na,b,1,2,\n,,,,yes\n", "line 3: the source is empty"),
        ("min,max,source,target\n1,2,a,b\n1,2,b\n", "line 3: the target is empty"),
        ("source,target,min,max\na,b,1e-320,1\n", "outside the range of float64"),
        ("source,target,weight,min,max\na,b,3,0,0\n", "its weight is always 0; leave the edge out"),
        ("source,target,weight_min,weight_max,mode\na,b,1,2,inhibits\n", 'column "mode" holds inhibits beside'),
        ("source,target,weight,is_negative,optional\na,b,1,1,yes\n", 'column "is_negative" holds 1 beside'),
        ("source,target,weight,directed,optional\na,b,-1,false,yes\n", 'column "directed" holds false beside'),
        ("source,target,weight_min,weight_max,direction\na,b,-2,-1,<-\n", 'column "direction" holds <- beside'),
        ("source,target,weight_min,weight_max\na,b,1,2,9\n", "line 2: 5 fields, and the header has 4"),
        ("% sym\nsource,target,weight_min,weight_max\na,b,1,2\n", "% sym means undirected edges"),
    ],
)
def test_files_of_families_have_the_same_guards(tmp_path, content, says):
    with pytest.raises(FormatError, match=says):
        read_family(put(tmp_path, "g.csv", content))


def test_families_in_memory_have_the_same_guards():
    pandas = pytest.importorskip("pandas")
    interval = {"weight_min": 1, "weight_max": 2}
    for more, says in (({"mode": "inhibits"}, "mode"), ({"sign": -1}, "sign"), ({"negative": True}, "negative")):
        with pytest.raises(GraphError, match=f'column "{says}" holds'):
            ptcc.as_family(nx.DiGraph([("a", "b", interval | more)]))
        with pytest.raises(GraphError, match=f'column "{says}" holds'):
            ptcc.as_family(pandas.DataFrame([{"source": "a", "target": "b"} | interval | more]))
    family = ptcc.as_family(nx.DiGraph([("a", "b", {"weight_min": -2, "weight_max": -1, "mode": "inhibits"})]))
    assert family.modes[0].edge_interval(0) == (-2, -1)


def test_a_family_of_matrices_as_text_tells_its_direction_and_its_conversions(tmp_path):
    one = put(tmp_path, "one.csv", MATRICES[0].content)
    family = read_family([one, one], uncertainty="10%")
    assert family.read["orientation"] == "listens" and "one: a 2 x 2 matrix as text" in family.notes
    out = run("classify", str(one), "--uncertainty", "10%").out
    assert "a listens to b" in out
    table = put(tmp_path, "table.csv", "ada,bo,1\n")
    with pytest.raises(GraphError, match="one is a matrix as text and table is a table of edges: say --edges"):
        read_family([one, table])


def test_words_for_signs_are_read_in_files_of_families(tmp_path):
    family = read_family(put(tmp_path, "g.csv", "source,target,weight,optional\na,b,inhibits,yes\nb,a,+,no\n"))
    mode = family.modes[0]
    ends = {
        (mode.labels[s], mode.labels[t]): mode.edge_interval(k)
        for k, (s, t) in enumerate(zip(mode.source, mode.target, strict=True))
    }
    assert ends == {("a", "b"): (-1, 0), ("b", "a"): (1, 1)}


# ---------------------------------------------------------------------------------------------- command line


FLAGS = ("--drop-self-loops", "--drop-zeros", "--duplicates", "last", "--columns", "from,to,score", "--undirected")
TABLE = "from,to,score,sign\nann,ann,1,x\nann,bob,0,x\nbob,eve,2,x\nbob,eve,-2,x\n"


def test_a_certificate_tells_how_its_graph_was_read_and_the_check_reads_it_so(tmp_path):
    path, out = put(tmp_path, "g.csv", TABLE), tmp_path / "c.json"
    done = run("certify", str(path), *FLAGS, "--no-simulation", "-o", str(out))
    assert done.code in (0, 4), done.err
    read = json.loads(out.read_text())["problem"]["graph"]["read"]
    assert (read["zeros"], read["columns"], read["self_loops"]) == ("dropped 1", "from,to,score", "dropped 1")
    flags = "--edges information --duplicates last --drop-self-loops --drop-zeros --undirected --columns from,to,score"
    assert reading_flags(read) == flags
    assert run("check", str(out), str(path), *FLAGS).code in (0, 4)
    assert run("check", str(out), str(path), *FLAGS, "--columns", "1,2,4").code == 1
    for key, wrong in (("zeros", "dropped"), ("laplacian", "yes"), ("columns", 3), ("variable", None)):
        document = json.loads(out.read_text())
        document["problem"]["graph"]["read"][key] = wrong
        assert not ptcc.check(document).accepted


def test_a_laplacian_is_checked_as_it_was_certified(tmp_path):
    path, out = put(tmp_path, "L.npy", npy([[1, -1], [-1, 1]])), tmp_path / "c.json"
    assert run("certify", str(path), "--laplacian", "--no-simulation", "-o", str(out)).code == 0
    assert json.loads(out.read_text())["problem"]["graph"]["read"]["laplacian"] is True
    assert run("check", str(out), str(path), "--laplacian").code == 0


def test_delays_of_a_column_are_those_of_the_edges_that_were_read(tmp_path):
    rows = "from,to,score,delay\nann,bob,1,0.02\nbob,ann,1,0.01\neve,ann,0,0.03\nbob,eve,-1,0.02\n"
    path = put(tmp_path, "g.csv", rows)
    graph = read_graph(path, columns="from,to,score", drop_zeros=True)
    delays = read_delays(path, graph)
    assert delays == {
        ("ann", "bob"): Fraction(1, 50),
        ("bob", "ann"): Fraction(1, 100),
        ("bob", "eve"): Fraction(1, 50),
    }


def test_a_row_that_is_dropped_for_its_sign_takes_its_delay_with_it(tmp_path):
    path = tmp_path / "e.csv"
    path.write_text("source,target,weight,sign,delay\na,b,1,1,0.01\na,b,3,0,5\nb,a,1,-1,0.02\n")
    graph = read_graph(path, drop_zeros=True)
    assert read_delays(path, graph) == {("a", "b"): Fraction(1, 100), ("b", "a"): Fraction(1, 50)}


def test_all_that_is_wrong_with_delays_is_one_message(tmp_path):
    path = tmp_path / "e.csv"
    path.write_text('source,target,weight,delay\na,b,1,"0,5"\nb,c,1,-1\nc,d,1,-2\nd,e,1,0.1\n')
    with pytest.raises(FormatError) as told:
        read_delays(path, read_graph(path))
    said = str(told.value)
    assert 'line 2: delay "0,5" of edge a -> b is not a number (write decimals with a point, 0.5)' in said
    assert "line 3: delay -1 of edge b -> c is negative (2 in all) (give a number >= 0); mend these" in said


@pytest.mark.parametrize(
    "line", ["friends (undirected)", "Edges are undirected", "nodes=3, directed=False", "symmetric", "reversed by me"]
)
def test_comments_on_directions_that_are_not_understood_are_told(tmp_path, line):
    graph = read_graph(put(tmp_path, "g.txt", f"# {line}\n1 2 3\n2 3 -1\n"))
    assert graph.read["notes"] == (f"ignored as a comment: # {line}",)


def test_names_of_a_matrix_that_are_not_read_are_told(tmp_path):
    W = np.array([[0, 1, 0], [-1, 0, 2], [0, 1, 0]])
    np.savetxt(tmp_path / "w.txt", W, header="ann bob cid")
    note = "ignored as a comment: # ann bob cid; names are a first row"
    assert read_graph(tmp_path / "w.txt").read["notes"] == ("a 3 x 3 matrix as text", note)
    np.savez(tmp_path / "w.npz", A=W, nodes=["ann", "bob", "cid"])
    assert read_graph(tmp_path / "w.npz").read["notes"] == ("array nodes is not read; names are an array labels",)
    np.savez(tmp_path / "w.npz", A=W, labels=["ann", "bob", "cid"])
    graph = read_graph(tmp_path / "w.npz")
    assert (graph.labels, graph.read["notes"]) == (("ann", "bob", "cid"), ())


def test_decimal_commas_of_intervals_and_ends_without_their_names_are_told(tmp_path):
    path = tmp_path / "e.csv"
    path.write_text('source,target,min,max\na,b,"-0,5",1\n')
    with pytest.raises(GraphError, match=r'"-0,5" is not a number; write decimals with a point, -0\.5'):
        read_family(path)
    path.write_text("node1,node2,weight_min,weight_max\na,b,1,2\n")
    with pytest.raises(FormatError, match="name the columns of the ends source and target"):
        read_family(path)


def test_comments_that_look_like_rows_and_nodes_without_edges_are_told(tmp_path):
    rows = "source,target,weight\n# a comment, say, of three\na,b,1\n#a,b,1\nb,#a,-2\nTotal 2020\n"
    told = "ignored as a comment: #a,b,1", "1 node without edges: Total 2020"
    assert {*told} <= {*read_graph(put(tmp_path, "g.csv", rows)).read["notes"]}
    intervals = rows.replace("weight", "min,max").replace(",1", ",1,1").replace("-2", "-2,-1")
    assert {f"{told[0]},1", told[1]} <= {*read_family(put(tmp_path, "g.csv", intervals)).notes}


@pytest.mark.parametrize("word", ["-", "enemy", "distrust", "down"])
def test_a_sign_in_words_beside_intervals_of_the_other_sign_is_refused(tmp_path, word):
    for title in ("weight", "value", "rating"):
        path = put(tmp_path, "g.csv", f"source,target,min,max,{title}\na,b,1,2,+\nb,a,1,2,{word}\n")
        with pytest.raises(FormatError, match=f'line 3: edge b -> a: "{word}" stands beside 1 to 2; write the sign'):
            read_family(path)
    table = pd.DataFrame({"source": ["a"], "target": ["b"], "min": [1], "max": [2], "weight": [word]})
    with pytest.raises(GraphError, match="stands beside 1 to 2"):
        ptcc.as_family(table)
    assert read_family(put(tmp_path, "g.csv", "source,target,min,max,weight\na,b,-2,-1,-\n")).n_nodes == 2


def test_rows_of_intervals_that_lost_an_end_or_go_both_ways_are_told(tmp_path):
    with pytest.raises(FormatError, match="line 3: the target is empty"):
        read_family(put(tmp_path, "g.csv", "source,target,min,max\na,b,1,2\nb,,,-2\n"))
    both = put(tmp_path, "g.csv", "source,target,min,max,type\na,b,1,2,Undirected\n")
    with pytest.raises(FormatError, match="say --undirected of all rows"):
        read_family(both)
    assert read_family(both, undirected=True).modes[0].n_edges == 2
    with pytest.raises(FormatError, match="exchange the ends of these rows"):
        read_family(put(tmp_path, "g.csv", "source,target,min,max,direction\na,b,1,2,<-\n"))
    with pytest.raises(FormatError, match="two columns tell whether edges may fail"):
        read_family(put(tmp_path, "g.csv", "source,target,min,max,optional,may_fail\na,b,1,2,no,yes\n"))


def test_what_is_several_graphs_or_no_number_in_memory_is_refused_in_one_line():
    W = np.array([[0, 1, 0], [0, 0, -1], [1, 0, 0]])
    with pytest.raises(GraphError, match="a list of graphs is a family"):
        ptcc.as_graph([W, W], "listens")
    assert len(ptcc.as_family([W, -W], "listens").modes) == 2
    for weight in (10**5000, Fraction(1, 10**5000)):
        with pytest.raises(GraphError, match="outside the range of float64"):
            ptcc.as_graph([("a", "b", weight)])
    with pytest.raises(GraphError, match="one number written in two ways"):
        ptcc.as_graph([(1, 2.0, 1), (2, 1.0, -1)])
    with pytest.raises(GraphError, match="one number written in two ways"):
        ptcc.as_family([(1, 2.0, 1, 2), (2, 1.0, -1, 0)])


def test_rows_of_intervals_may_hold_a_weight_alone_or_a_node_alone(tmp_path):
    text = "source,target,weight,weight_min,weight_max,year\na,b,3,,,1\nb,a,1,1,2,2\nc,,,,,3\n"
    table = pd.read_csv(io.StringIO(text))
    families = read_family(put(tmp_path, "g.csv", text)), ptcc.as_family(table)
    for family in families:
        assert family.labels == ("a", "b", "c") and {"1 node without edges: c"} <= {*family.notes}
        assert 'columns ignored: "year"' in family.notes
        assert sorted(family.modes[0].edge_interval(k) for k in (0, 1)) == [(1, 2), (3, 3)]
    numbers = pd.DataFrame({"source": [1, 2, 3], "target": [2, 1, None], "min": [1, 2, None], "max": [2, 3, None]})
    assert ptcc.as_family(numbers).labels == ("1", "2", "3")


def test_all_that_is_wrong_with_intervals_is_one_message(tmp_path):
    text = "source,target,weight,weight_min,weight_max\na,a,,1,2\nb,a,1,,2\nb,c,1,0,\nc,a,,2,1\nc,b,,,\na,b,,0,0\n"
    says = (
        ("self-loop at node a", "one end of its interval is missing", "the least weight 2 is above the largest"),
        ("always 0",),
    )
    with pytest.raises(FormatError) as of_file:
        read_family(put(tmp_path, "g.csv", text))
    with pytest.raises(GraphError) as of_table:
        ptcc.as_family(pd.read_csv(io.StringIO(text)))
    for part in sum(says, ()):
        assert part in str(of_file.value) and part in str(of_table.value)
    assert "--drop" not in str(of_table.value) and "row 1 of the DataFrame: self-loop" in str(of_table.value)


def test_one_end_of_intervals_is_told_and_a_column_called_max_is_ignored(tmp_path):
    with pytest.raises(FormatError, match="one end of the intervals is named alone"):
        read_family(put(tmp_path, "g.csv", "source,target,weight_min\na,b,1\n"))
    text = "source,target,weight,max\na,b,1,3\n"
    assert 'columns ignored: "max"' in read_graph(put(tmp_path, "g.csv", text)).read["notes"]
    assert ptcc.as_family(pd.read_csv(io.StringIO(text))).graph == ptcc.as_graph([("a", "b", 1)])
    assert ptcc.as_family(nx.DiGraph([("a", "b", {"weight": 1, "max": 3})])).graph == ptcc.as_graph([("a", "b", 1)])


def test_quoted_titles_in_a_comment_are_noticed(tmp_path):
    with pytest.raises(FormatError, match="a comment names the columns"):
        read_graph(put(tmp_path, "g.csv", '# "target" "source" "weight"\n1 2 3\n'))
    assert read_graph(put(tmp_path, "g.csv", '# "source" "target" "weight"\n1 2 3\n')).n_edges == 1


def test_a_minus_beside_nothing_may_be_a_sign(tmp_path):
    edge = '<edge source="{}" target="{}" weight="1"{}/>'
    edges = edge.format("a", "b", ' label="-"') + edge.format("b", "a", "")
    nodes = '<nodes><node id="a"/><node id="b"/></nodes>'
    gexf = f'<gexf><graph defaultedgetype="{{}}">{nodes}<edges>{{}}</edges></graph></gexf>'
    with pytest.raises(FormatError, match="are these signs"):
        read_graph(put(tmp_path, "g.gexf", gexf.format("directed", edges)))
    with pytest.raises(FormatError, match='edges of type "mutual" means undirected'):
        read_graph(put(tmp_path, "g.gexf", gexf.format("mutual", edge.format("a", "b", ""))))


def test_an_empty_list_of_pajek_is_no_relation(tmp_path):
    graph = read_graph(put(tmp_path, "g.net", '*Vertices 2\n*Arcs :1 "a"\n1 2 1\n*Arcs :2 "b"\n'))
    assert graph.n_edges == 1


def test_a_row_that_is_a_comment_is_told_above_all_others_too(tmp_path):
    graph = read_graph(put(tmp_path, "g.csv", "#1,b,1\nb,#1,-1\n"))
    assert graph.read["notes"] == ("ignored as a comment: #1,b,1",)


def test_labels_that_begin_with_a_byte_order_mark_are_read_back(tmp_path):
    graph = ptcc.as_graph([("x", "\ufeffa", 1), ("\ufeffa", "x", -1)])
    ptcc.write_graph(graph, tmp_path / "g.csv")
    assert read_graph(tmp_path / "g.csv") == graph


def test_a_node_that_looks_like_a_row_is_written_so_that_it_is_read_back(tmp_path):
    graph = ptcc.as_graph([("a", "b", 1)])
    graph = ptcc.SignedDigraph.from_edges(graph.edges, nodes=["north wing 12"])
    ptcc.write_graph(graph, tmp_path / "g.csv")
    assert read_graph(tmp_path / "g.csv") == graph


def test_nodes_that_are_declared_above_the_header_of_intervals_are_read(tmp_path):
    family = read_family(put(tmp_path, "g.csv", "z\nsource,target,min,max\na,b,1,2\ny\nb,a,1,2\n"))
    assert sorted(family.labels) == ["a", "b", "y", "z"] and family.modes[0].n_edges == 2


@pytest.mark.parametrize("end", [None, float("nan"), "", " "])
def test_edges_in_memory_whose_ends_have_no_name_are_refused(end: object):
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"source": ["a", end], "target": ["b", "b"], "min": [1, 1], "max": [2, 2]})
    with pytest.raises(GraphError, match=r"names no node|the source is empty"):
        ptcc.as_family(table)
    if not isinstance(end, str):
        with pytest.raises(GraphError, match="names no node"):
            ptcc.Family.from_intervals([(end, "b", 1, 2)])


def test_all_that_is_wrong_with_the_rows_of_a_graph_is_one_message(tmp_path):
    path = put(tmp_path, "g.csv", "a,b,x\nc,c,1\na,d,1\na,d,2\nd,a,0\nb,a,y\n")
    with pytest.raises(FormatError) as refused:
        read_graph(path)
    for part in (
        'line 1: weight "x" of edge a -> b is not a number (2 in all)',
        "line 2: self-loop",
        "line 5: weight 0",
    ):
        assert part in str(refused.value)
    assert str(refused.value).endswith("all but line 1 with --drop-self-loops --drop-zeros --duplicates sum|last")


def test_intervals_of_networkx_are_read_under_the_titles_that_files_may_have():
    graph = nx.DiGraph([("a", "b", {"weight": 1, "min": 0, "max": 2}), ("b", "a", {"weight": 1, "min": 1, "max": 1})])
    assert sorted(ptcc.as_family(graph).modes[0].edge_interval(k) for k in (0, 1)) == [(0, 2), (1, 1)]


LATE = ptcc.LateMessages(delay="0.1")


@pytest.mark.parametrize(
    "call",
    [
        lambda file: read_graph(file, undirected="no"),
        lambda file: read_graph(file, laplacian="no"),
        lambda file: read_family(file, optional=["ab"]),
        lambda file: read_family(file, optional="a,b"),
        lambda file: read_family(file, optional=None),
        lambda _: read_family(None),
        lambda _: read_family(3),
        lambda _: ptcc.Family.switching(None),
        lambda _: ptcc.Family.from_intervals(None),
        lambda _: ptcc.Family.from_intervals([("a", "b", 1, 2)], 3),
        lambda _: ptcc.certify("fig1a", ptcc.NominalProtocol(), agents=ptcc.Agents),
        lambda _: ptcc.LateMessages(delay="0.1", vehicles=3),
        lambda _: ptcc.simulate_late("fig1a", ptcc.NominalProtocol(), LATE, [1] * 6, leaders=0.5),
        lambda _: ptcc.simulate_late("fig1a", ptcc.NominalProtocol(), LATE, [1] * 6, deadlines=1),
    ],
)
def test_arguments_that_are_none_of_what_is_asked_are_refused(call: Any):
    with pytest.raises(ParameterError):
        call(io.StringIO("a,b,1"))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("g.csv", "a\nb\nc\n"),
        ("g.csv", "0 0 0\n0 0 0\n0 0 0\n"),
        ("g.txt", "[0 0 0; 0 0 0; 0 0 0]"),
        ("g.npy", npy(np.zeros((3, 3)))),
        ("g.npy", npy(np.zeros((3, 3)), "i8")),
        ("g.mtx", mtx(np.zeros((3, 3)))),
        ("g.sif", "a\nb\nc\n"),
        ("g.dl", "dl n=3\ndata:\n0 0 0\n0 0 0\n0 0 0\n"),
        ("g.gml", "graph [ directed 1 node [ id 0 ] node [ id 1 ] node [ id 2 ] ]"),
    ],
)
def test_a_graph_without_edges_is_its_own_laplacian(tmp_path, name, content):
    graph = read_graph(put(tmp_path, name, content), laplacian=True)
    assert (graph.n_nodes, graph.n_edges) == (3, 0)
    assert ptcc.as_graph(np.zeros((2, 2)), "listens", laplacian=True).n_edges == 0
    with pytest.raises(FormatError, match="no Laplacian"):
        read_graph(put(tmp_path, "g.npy", npy(np.eye(3))), laplacian=True)


@pytest.mark.parametrize("command", ["classify", "certify", "simulate", "design", "plot", "check", "batch", "explore"])
def test_every_command_that_reads_a_graph_has_all_options_of_reading(command):
    from ptcc_certify.cli import cli
    from ptcc_certify.cli.options import READING

    names = {parameter.name for parameter in cli.commands[command].params}
    assert {*READING} <= names and len(READING) == len(OPTIONS)


def test_a_scenario_has_all_options_of_reading(tmp_path):
    put(tmp_path, "g.csv", TABLE)
    scenario = put(
        tmp_path,
        "s.toml",
        '[graph]\nfile = "g.csv"\nduplicates = "last"\ndrop_self_loops = true\ndrop_zeros = true\nundirected = true\n'
        'columns = "from,to,score"\n',
    )
    assert "3 nodes, 2 edges" in run("classify", str(scenario)).out
    put(tmp_path, "L.npy", npy([[1, -1], [-1, 1]]))
    scenario.write_text('[graph]\nfile = "L.npy"\nlaplacian = true\n')
    assert "2 nodes, 2 edges" in run("classify", str(scenario)).out
    assert "Laplacian" in run("classify", str(scenario), "--no-laplacian").err + run("classify", str(scenario)).out
    put(tmp_path, "g.mat", mat(A=[[0, 1], [1, 0]], B=[[0, -2], [0, 0]]))
    scenario.write_text('[graph]\nfile = "g.mat"\nvariable = "B"\n')
    assert "2 nodes, 1 edge " in run("classify", str(scenario)).out


def test_a_batch_reads_as_it_is_told(tmp_path):
    put(tmp_path, "g.csv", TABLE)
    done = run("batch", str(tmp_path / "*.csv"), *FLAGS)
    assert "ann,ann" not in done.out and "g.csv" in done.out and "from,to" not in done.err
    rows = ptcc.certify_many(
        str(tmp_path / "g.csv"),
        ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2),
        duplicates="last",
        drop_self_loops=True,
        drop_zeros=True,
        columns="from,to,score",
    )
    assert rows[0]["error"] is None and rows[0]["edges"] == 1


def test_the_read_line_tells_in_full_what_makes_another_graph(tmp_path):
    header = "source,target,weight,sign," + ",".join(f"a_long_title_of_a_column_{k}" for k in range(30))
    rows = "".join(f"ann,bob,0.5,-1,{'7,' * 29}7\n" for _ in range(3)) + f"bob,bob,1,1,{'7,' * 29}7\n"
    path = put(tmp_path, "g.csv", header + "\n" + rows)
    for command in (["classify"], ["certify", "--no-simulation"], ["classify", "-v"]):
        out = " ".join(run(*command, str(path), "--duplicates", "sum", "--drop-self-loops", "--undirected").out.split())
        for word in ('weights times column "sign"', "2 repeated rows were merged (sum)", "self-loops dropped 1"):
            assert word in out, (command, out)


def test_the_text_of_the_terminal_names_the_columns_of_a_header_that_was_guessed(tmp_path):
    out = run("classify", str(put(tmp_path, "g.csv", "Gene1,Gene2,Type\na,b,+\nb,c,-\n"))).out
    assert "columns Gene1, Gene2, Type" in out and "3 nodes" in out


def test_the_text_of_the_terminal_names_columns_that_a_header_turns_round(tmp_path):
    out = run("classify", str(put(tmp_path, "g.csv", "End,Start,score\na,b,2\nb,a,-1\n"))).out
    assert "columns Start, End, score" in out


def test_notes_on_columns_are_not_cut_but_for_the_names_of_those_that_are_no_signs(tmp_path):
    many = ",".join(f"a_long_title_of_a_column_{k}" for k in range(30))
    path = put(
        tmp_path,
        "g.csv",
        f"id,source,target,weight,kind,sign_of_the_first_year,{many}\n"
        f"1,a,b,2,inhibits,0.3,{'7,' * 29}7\n2,b,a,1,activates,0.1,{'7,' * 29}7\n",
    )
    lines = [line.strip() for line in run("classify", str(path)).out.splitlines()]
    text = " ".join(lines)
    for whole in (
        "columns by header: ",
        'weights times column "kind"',
        'perhaps signs, ignored: "sign_of_the_first_year"',
    ):
        assert whole in text
    (ignored,) = [line for line in lines if line.startswith('columns ignored: "id", "a_long_title')]
    assert ignored.endswith("...")
    short = run("classify", str(put(tmp_path, "s.csv", "RATER,RATEE,RATING,TIME\n1,2,4,99\n2,1,-4,98\n"))).out
    assert "raters listen? --edges listens" in short and 'columns ignored: "TIME"' in short


def half_of_a_laplacian(name: str) -> bytes:
    """Write a Laplacian whose entries beside the diagonal stand once, in a format that the ending tells."""
    entries = {(0, 0): 2, (0, 1): -1, (0, 2): 1, (1, 1): 3, (1, 2): -2, (2, 2): 3}
    file, graph = io.BytesIO(), nx.Graph()
    graph.add_weighted_edges_from((str(u), str(v), weight) for (u, v), weight in entries.items())
    whole = np.array([[entries[min(u, v), max(u, v)] for v in range(3)] for u in range(3)], dtype=float)
    if name.endswith(".mtx"):
        mmwrite(file, sparse.coo_array(whole), symmetry="symmetric")
    elif name.endswith(".npy"):
        np.save(file, np.triu(whole))
    elif name.endswith(".csv"):
        file.write("".join(f"{u},{v},{weight}\n" for (u, v), weight in entries.items()).encode())
    else:
        write = {"gml": nx.write_gml, "graphml": nx.write_graphml, "gexf": nx.write_gexf, "net": nx.write_pajek}
        write[name.rpartition(".")[2]](graph, file)
    return file.getvalue()


@pytest.mark.parametrize("name", ["L.mtx", "L.npy", "L.csv", "L.gml", "L.graphml", "L.gexf", "L.net"])
def test_a_laplacian_whose_entries_stand_once_asks_for_both_directions(tmp_path, name):
    path = put(tmp_path, name, half_of_a_laplacian(name))
    with pytest.raises(FormatError, match="as a Laplacian's; read it with --laplacian --undirected, or add --no-lapl"):
        read_graph(path)
    with pytest.raises(FormatError, match="means undirected edges; let each go both ways with --undirected"):
        read_graph(path, laplacian=True)
    graph = read_graph(path, laplacian=True, undirected=True)
    a, b, c = graph.labels
    assert told(graph) == expected(f"{a}>{b}=1 {b}>{a}=1 {a}>{c}=-1 {c}>{a}=-1 {b}>{c}=2 {c}>{b}=2")


def test_a_laplacian_among_the_edges_of_a_table_is_mended_as_the_table_is_read():
    edges = [("a", "a", 1), ("b", "b", 1), ("a", "b", -1), ("b", "a", -1)]
    table = pd.DataFrame(edges, columns=["source", "target", "weight"])
    with pytest.raises(GraphError, match=r"read it with as_graph\(.., laplacian=True\), or add laplacian=False"):
        ptcc.as_graph(table)
    assert told(ptcc.as_graph(table, laplacian=True)) == expected("a>b=1 b>a=1")
    assert told(ptcc.as_graph(table, laplacian=False, drop_self_loops=True)) == expected("a>b=-1 b>a=-1")


@pytest.mark.parametrize(
    "corner",
    ["From To", "from_to", "from→to", "from vs to", "source target", "source-target", "Source (rows)", "rows: from"],
)
def test_a_corner_that_says_from_in_any_spelling_asks_for_the_direction(tmp_path, corner):
    path = put(tmp_path, "g.csv", f"{corner},a,b\na,0,2\nb,-1,0\n")
    with pytest.raises(FormatError, match=r"the corner .* says that rows are heard"):
        read_graph(path)


def test_a_corner_that_says_to_first_is_one_of_listeners(tmp_path):
    path = put(tmp_path, "g.csv", "to from,a,b\na,0,2\nb,-1,0\n")
    assert told(read_graph(path)) == expected("b>a=2 a>b=-1")


def test_a_matrix_whose_corner_asks_is_read_as_another_was(tmp_path):
    path = put(tmp_path, "g.csv", "from,a,b\na,0,2\nb,-1,0\n")
    whole = read_graph(put(tmp_path, "h.csv", "to,a,b\na,0,2\nb,-1,0\n"))
    assert read_graph(path, **keywords_as(path, whole.read)) == whole
    certificate = str(tmp_path / "c.json")
    run("certify", str(tmp_path / "h.csv"), "--no-simulation", "-o", certificate)
    checked = run("check", certificate, str(path), "--edges", "information")
    assert "another graph" in checked.out + checked.err and "--edges listens" in checked.out + checked.err


INTERVALS = {
    "source,target,weight,weight_min,weight_max\na,b,1,0,2\nb,a,1,NA,NA\n": [(1, 1), (0, 2)],
    "source,target,weight,weight_min,weight_max\na,b,n/a,0,2\nb,a,1,,\nc,,NA,NA,NA\n": [(1, 1), (0, 2)],
    "source,target,weight,optional\na,b,1,1\nb,a,2,\n": [(2, 2), (0, 1)],
    "source,target,sign,optional\na,b,activates,yes\nb,a,inhibits,\nc,,,\n": [(-1, -1), (0, 1)],
}


@pytest.mark.parametrize("content", INTERVALS)
def test_a_file_of_intervals_and_its_table_are_the_same_family(content):
    texts = pd.read_csv(io.StringIO(content), dtype=str, keep_default_na=False)
    for family in (
        read_family(io.StringIO(content)),
        ptcc.as_family(pd.read_csv(io.StringIO(content))),
        ptcc.as_family(texts),
    ):
        assert [family.modes[0].edge_interval(k) for k in (0, 1)] == INTERVALS[content]


def test_codes_of_relations_are_refused_beside_a_node_alone_of_a_table():
    table = pd.read_csv(io.StringIO("source,target,type,optional\na,b,1,yes\nb,a,2,\nc,,,\n"))
    with pytest.raises(GraphError, match="codes of relations"):
        ptcc.as_family(table)


@pytest.mark.parametrize(
    ("attributes", "interval"),
    [({"sign": "inhibits"}, (-1, 0)), ({"weight": "activates"}, (0, 1)), ({"Weight": 2}, (0, 2))],
)
def test_networkx_edges_that_may_fail_have_their_weights_under_any_title_of_weights(attributes, interval):
    graph = nx.DiGraph()
    graph.add_edge("a", "b", **attributes, optional=True)
    assert ptcc.as_family(graph).modes[0].edge_interval(0) == interval


@pytest.mark.parametrize("row", ["1956 activates 2885 0.93", "1 + 2 -0.3", "1\tactivates\t2\t3\t1.0"])
def test_a_score_beside_nodes_with_numbers_is_no_target(tmp_path, row):
    with pytest.raises(FormatError, match="is a score, not a target"):
        read_graph(put(tmp_path, "g.sif", f"{row}\n"))
    assert read_graph(put(tmp_path, "h.sif", "1956 activates 2885 207\n")).n_edges == 2


@pytest.mark.parametrize(
    ("said", "name", "content"),
    [
        ("are these signs", "g.csv", "source,target,weight,is_conflict\na,b,2,1\nb,a,1,0\n"),
        ("are these signs", "g.csv", "source,target,weight,conflict\na,b,2,yes\nb,a,1,no\n"),
        ("are these signs", "g.csv", "source,target,weight,cooperation\na,b,2,0\nb,a,1,1\n"),
        ("are these signs", "g.json", '{"links": [{"source": 0, "target": 1, "weight": 2, "conflict": true}]}'),
        ("codes of relations, not signs", "g.csv", "source,target,type\na,b,1.1\nb,a,2.3\n"),
        (
            "codes of relations, not signs",
            "g.gml",
            "graph [ directed 1 node [ id 0 ] node [ id 1 ] edge [ source 0 target 1 type 1.1 ] ]",
        ),
        ("codes of relations, not signs", "g.json", '{"links": [{"source": 0, "target": 1, "type": 0.5}]}'),
        ("codes of relations, not signs", "g.sif", "a\t0.5\tb\n"),
    ],
)
def test_what_may_be_signs_or_codes_is_no_weight_in_silence(tmp_path, said, name, content):
    with pytest.raises(FormatError, match=said):
        read_graph(put(tmp_path, name, content))


def test_a_number_that_nodes_write_in_two_ways_is_told_beside_names(tmp_path):
    with pytest.raises(FormatError, match=r"1 and 1\.0 are one number"):
        read_graph(put(tmp_path, "g.csv", "source,target,weight\n1.0,2,1\n1,NA,-1\n"))
    named = put(tmp_path, "g.csv", "source,target,weight\n1.0,2,1\n1,ann,-1\n")
    assert "1 and 1.0 are two nodes" in read_graph(named).read["notes"]
    bounds = "source,target,weight_min,weight_max\n1,1.0,1,2\n1.0,1.1,-1,0\n"
    assert "1 and 1.0 are two nodes" in read_family(io.StringIO(bounds)).notes
    assert "1 and 1.0 are two nodes" in ptcc.as_family([(1, "1.0", 1, 2), ("1.0", "1.1", -1, 0)]).notes


@pytest.mark.parametrize("content", ["source,target,type\na,b,1.1\nb,a,-2\n", "source,target,mor\na,b,1.1\nb,a,2\n"])
def test_fractions_beside_a_negative_number_or_modes_of_regulation_are_weights(tmp_path, content):
    assert read_graph(put(tmp_path, "g.csv", content)).weights[0] in (2, -2)


def test_integers_of_json_that_are_names_and_positions_of_other_nodes_are_refused(tmp_path):
    nodes = '{"name": 2}', '{"name": 0}', '{"name": 1}'
    with pytest.raises(FormatError, match="positions, or names"):
        read_graph(put(tmp_path, "g.json", named_nodes("0>1", *nodes)))
    graph = read_graph(put(tmp_path, "g.json", named_nodes("0>1", '{"name": 0}', '{"name": 1}')))
    assert told(graph) == expected("0>1=-1")


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_a_first_row_of_two_decimal_commas_is_not_split_at_them(tmp_path, separator):
    content = "a;b;0,5;0,7\nb;a;0,5;0,9\n".replace(";", separator)
    with pytest.raises(FormatError, match="decimals with a point"):
        read_graph(put(tmp_path, "g.csv", content))
    assert told(read_graph(put(tmp_path, "h.csv", "a,b,0.5\nb,a,2\n"))) == expected("a>b=0.5 b>a=2")


@pytest.mark.parametrize("content", ["a,0,5\nb,1,5\n", "node,value\na,0,5\nb,1\n"])
def test_states_do_not_lose_what_follows_a_decimal_comma(tmp_path, content):
    (tmp_path / "x.csv").write_text(content)
    with pytest.raises(FormatError, match="3 fields, and 2 are meant; separate fields by semicolons"):
        read_state(tmp_path / "x.csv", read_graph(put(tmp_path, "g.csv", "a,b,1\n")))


def test_decimal_commas_beside_semicolons_are_read_wherever_a_number_stands(tmp_path):
    edges = put(tmp_path, "e.csv", "source;target;weight;delay\na;b;0,5;0,02\nb;a;-1;0\n")
    graph = read_graph(edges)
    assert graph.read["notes"][:1] == ("decimal commas: 0,5 is 0.5",)
    assert read_delays(edges, graph) == {("a", "b"): Fraction(1, 50), ("b", "a"): Fraction(0)}
    (tmp_path / "x.csv").write_text("a;0,25\nb;-1\n")
    assert read_state(tmp_path / "x.csv", graph) == [Fraction(1, 4), Fraction(-1)]
    (tmp_path / "i.csv").write_text("source;target;min;max\na;b;-0,5;1,25\nb;a;1;2\n")
    intervals = read_interval_rows(tmp_path / "i.csv", Reading(), Fraction(0))
    assert intervals.edges[0] == ("a", "b", Fraction(-1, 2), Fraction(5, 4))
    (tmp_path / "s.csv").write_text("t;mode\n0;day\n0,5;night\n")
    assert TableSignal.read(tmp_path / "s.csv").rows[1][:2] == (0.5, "night")


def test_what_is_no_weight_is_told_of_its_own_line_beside_the_question_of_the_direction(tmp_path):
    path = put(tmp_path, "g.csv", "von;zu;gewicht\na;b;0,5\nb;c;stark\n")
    with pytest.raises(FormatError) as told:
        read_graph(path)
    assert "line 1: the header von, zu, .. names no source and target (say --edges listens if von" in str(told.value)
    assert 'line 3: weight "stark" of edge b -> c is not a number' in str(told.value)
    with pytest.raises(FormatError, match='line 3: weight "stark" of edge c -> b is not a number'):
        read_graph(path, orientation="listens")
