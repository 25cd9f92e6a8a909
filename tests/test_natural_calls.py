"""Calls that a newcomer types, and what each gives: a result, or one line that names the mend, no error of Python's.

Five people share one small certificate: a control researcher, a network scientist with networkx and pandas, an engineer
with limits of actuators, a student, and a reviewer.
"""

import copy
from contextlib import nullcontext
from fractions import Fraction
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse

import ptcc_certify as ptcc
from ptcc_certify.errors import PTCCError

pytestmark = pytest.mark.usefixtures("quick_search")

#: What is typed, and a part of what is shown: of a refusal, its class and beginning, or "... " and a part.
CONTROL_RESEARCHER = {
    "ptcc.__version__": ".",
    "ptcc.NominalProtocol()": "NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)",
    "ptcc.NominalProtocol(T=0.6)": "NominalProtocol(T=0.6, rho1=1",
    "ptcc.NominalProtocol(0)": "ParameterError: T = 0 is outside its domain",
    "ptcc.NominalProtocol('fast')": "ParameterError: T = fast is not a finite number; T must be a number > 0",
    "ptcc.NominalProtocol(rho2='2,5')": "ParameterError: rho2 = 2,5 is not a finite number; write 2.5",
    "p.replace(T=3)": "NominalProtocol(T=3, rho1=1, rho2=2, kappa=1)",
    "p.replace(rho=3)": "ParameterError: NominalProtocol has no parameter rho; did you mean rho2 or rho1?",
    "ptcc.SlidingModeProtocol(mu1=1, delta=2)": "ParameterError: mu1 = 1 does not exceed delta = 2",
    "ptcc.certify(W, p)": 'GraphError: a matrix does not tell its direction: write as_graph(W, orientation="listens")',
    "ptcc.certify(ptcc.as_graph(W, 'listens'), p, asks=fast)": "Certificate(certified; bipartite consensus, Theorem 1",
    "ptcc.as_graph(W, 'rows')": "ParameterError: orientation",
    "ptcc.certify(W, p, orientation='listens')": "... certify has no parameter orientation; give it to as_graph(",
    "ptcc.certify(ptcc.as_graph(sparse.csr_matrix(W), 'information'), p, asks=fast)": "Certificate(certified; bi",
    "ptcc.analyse(W, 'listens')": "Structure(2 nodes, strong",
    "ptcc.simulate(ptcc.as_graph(W, 'listens'), p, [3, 1], times=[0, 1])": "Trajectory(2 agents, 2 instants",
    "ptcc.simulate(g, p, [1, 2])": "ParameterError: the initial state x0 has 2 values for 3 agents; give one number",
    "ptcc.simulate(g, p, np.ones((3, 2)), times=[0, 1]).states.shape": "(3, 2, 2)",
    "ptcc.simulate(g, p, 'random', times=[0, 1])": "Trajectory(3 agents",
    "ptcc.simulate(g, p, None)": "ParameterError: the initial state x0 is missing; give one number for each of ann",
    "ptcc.simulate(g, 0.6, x0)": "ParameterError: protocol = 0.6 is none; give NominalProtocol(",
    "ptcc.simulate(g, p, x0, sigma0=[1, 1, 1])": "ParameterError: sigma0 belongs to the sliding-mode protocol",
    "ptcc.certify(g, p, [[5, 1], [2, 0], [-4, 2]])": "... each coordinate has a certificate of its own",
    "ptcc.NominalProtocol(T='1e500')": 'ParameterError: T: the exponent of "1e500" is beyond 400',
    "cert.rate > 0": "True",
    "cert.norm_bound([0.1]) < cert.norm_bound([1.0])": "True",
    "float(cert.norm_bound(0.1)) > 0": "True",
    "p.gain(0.5)": "5.0",
    "ptcc.as_graph([['0', '-0.3'], ['1/3', '0']], 'listens').edges[0][2]": "-3/10",
    "ptcc.as_graph(np.array([['0', 'x'], ['1', '0']]), 'listens')": 'GraphError: row 1, column 2 of the matrix: "x" is',
    "cert.report()": "... for a page or LaTeX: write_report(certificate, path)",
    "repr(cert.theorem)": "Theorem(2.1: Quasi-strongly connected",
    "repr(cert.effort)": "Effort(bounded, |u_k| <= 43.98",
    "repr(cert.effort.peak)": "Peak(|u_k| <= 43.98",
    "repr(cert.influence)": "Influence(3 nodes, 2 leaders, 1 balanced groups, exact)",
    "cert.deviation_bound([0.1, 0.01]).shape": "(3, 2)",
    "cert.envelope.compare(cert.trajectory).violated": "False",
    "ptcc.theorems.table.theorem_for(g, p).number": "2.1",
    "ptcc.theorems.lemmas.gauge(g).tolist()": "[1, -1, -1]",
    "ptcc.theorems.lemmas.laplacian_spectrum(g).kernel_dimension": "1",
}
NETWORK_SCIENTIST = {
    "ptcc.certify(G, p, asks=fast)": "Certificate(certified; bipartite consensus",
    "ptcc.analyse(G)": "Structure(3 nodes, quasi-strong, 1 closed component,",
    "ptcc.analyse(G).to_pandas().loc['bob'].astype(str).tolist()": "['leader', '1', '-1', '1']",
    "ptcc.analyse(G).to_pandas().loc['eve', 'role']": "follower",
    "ptcc.influence(G).to_pandas().loc['eve', 'ann']": "-0.666",
    "ptcc.as_graph(df.set_axis(['rater', 'rated', 'rating'], axis=1)) == g": "True",
    "ptcc.explore(G).verdict": "certified",
    "ptcc.explore('fig1a').settings.graph": "fig1a",
    "ptcc.explore('fig9')": "FormatError: fig9: no such file, and no packaged graph",
    "ptcc.explore(W)": "GraphError: a matrix does not tell its direction",
    "ptcc.analyse(G.to_undirected())": "GraphError: the networkx graph is undirected; give graph.to_directed()",
    "ptcc.analyse(nx.MultiDiGraph(G))": "GraphError: the networkx graph is a multigraph",
    "ptcc.analyse(nx.DiGraph([(1, 2)]))": 'GraphError: edge 1 -> 2 has no attribute "weight"; give each edge',
    "ptcc.SignedDigraph.from_networkx(df)": "GraphError: a DataFrame is no networkx graph",
    "ptcc.certify(df, p, asks=fast)": "Certificate(certified; bipartite consensus",
    "ptcc.analyse(df.assign(year=1999)).graph.read['notes']": 'columns ignored: "year"',
    "ptcc.analyse(df.rename(columns={'source': 'who'}))": "GraphError: a DataFrame with the columns who",
    "ptcc.analyse(df[['source', 'target']])": "FormatError: the DataFrame: the header names no weight",
    "ptcc.analyse(df, orientation='listens')": "Structure(3 nodes",
    "ptcc.as_graph(nx.to_pandas_adjacency(G))": "GraphError: a matrix does not tell its direction",
    "ptcc.as_graph(nx.to_pandas_adjacency(G), 'information') == g": "True",
    "ptcc.as_graph([('ann', 'bob', -1), ('bob', 'ann', -1)])": "SignedDigraph(2 nodes, 2 edges, 2 negative)",
    "ptcc.as_graph([('ann', 'bob')])": "GraphError: edge ('ann', 'bob') is not a triple (source, target, weight)",
    "ptcc.as_graph({'ann': {'bob': 1}})": "GraphError: {'ann': {'bob': 1}} is not read as a graph; give",
    "g.to_networkx().edges['ann', 'bob']['weight']": "-2.0",
    "g.to_pandas()": "source target  weight",
    "g.edges() == g.edges and set(g.edges()) == set(edges)": "True",
    "[label for label in g.labels()]": "['ann', 'bob', 'eve']",
    "g.labels": "('ann', 'bob', 'eve')",
    "ptcc.analyse(G).graph.edges()[0]": "('bob', 'ann', Fraction(-1, 1))",
    "day.labels()": "('ann', 'bob')",
    "list(g)": "['ann', 'bob', 'eve']",
    "len(g)": "3",
    "'ann' in g": "True",
    "g.adjacency().toarray()[1, 0]": "-2.0",
    "ptcc.simulate(G, p, {'ann': 5, 'bob': 2, 'eve': -4}, times=[0, 1])['eve'][0]": "-4.0",
    "ptcc.simulate(G, p, {'ann': 5}, times=[0, 1])": "ParameterError: the initial state x0: no value for bob, eve",
    "ptcc.simulate(G, p, pd.Series({'eve': 1, 'bob': 2, 'ann': 3}), times=[0, 1]).states[:, 0]": "[3. 2. 1.]",
    "ptcc.final_state(G, pd.Series([1, 2, 3]))": "ParameterError: the initial state x0: no value for ann, bob, eve",
    "cert.final_state['ann']": "8/3",
    "cert.final_state['joe']": "UnknownAgentError: no agent is called 'joe'; there are ann, bob, eve",
    "dict(cert.final_state)": "{'ann': Fraction(8, 3)",
    "cert.final_state.to_pandas()": "ann ",
    "cert.trajectory.to_pandas().columns": "'ann', 'bob', 'eve'",
    "(cert.trajectory.to_pandas('input').to_numpy().T == cert.trajectory.input).all()": "True",
    "cert.trajectory.to_pandas('speed')": "ParameterError: what = 'speed' is unknown; one of states, input, error",
    "ptcc.certify_many({'team': G}, p, method='perron').to_pandas()['verdict'].tolist()": "['certified']",
    "ptcc.certify_many(G, p, method='perron')[0]['nodes']": "3",
    "ptcc.write_graph(g, folder / 'team.csv')": "None",
    "ptcc.read_graph('nowhere.csv')": "FormatError: nowhere.csv: no such file; check the path",
    "ptcc.read_graph(StringIO('a,b,1'))": "SignedDigraph(2 nodes",
}
ENGINEER = {
    "ptcc.design(g, max_input=10, initial_bound=1)": "Design(met",
    "ptcc.design(W, max_input=10, initial_bound=1, orientation='listens')": "Design(met",
    "ptcc.design(g, max_input=-1, initial_bound=1)": "ParameterError: max_input = -1 is outside its domain",
    "ptcc.design(g, max_input=10, initial_bound=x0)": "ParameterError: the bound of initial states",
    "ptcc.GainLimits(gain_cap=50)": "GainLimits(gain_cap=50)",
    "ptcc.simulate(g, p, x0, actuator=ptcc.GainLimits(gain_cap=50), times=[0, 1])": "Trajectory(3 agents",
    "ptcc.certify(g, p, x0, limits=[ptcc.GainLimits(50)], asks=fast).effort.residual[0].agents is None": "False",
    "ptcc.certify(g, p, x0, limits=None, asks=fast).verdict": "certified",
    "ptcc.certify(g, p, x0, limits=ptcc.GainLimits(gain_cap=50), asks=fast).effort.residual[0].agents is None": "False",
    "ptcc.certify(g, p, asks=ptcc.Asks(initial_set=3, simulation=False)).effort.bounded": "True",
    "ptcc.certify(g, p, asks=ptcc.Asks(initial_set=ptcc.box([0] * 3, [1] * 3))).effort.bounded": "True",
    "ptcc.box({'ann': 0, 'bob': 0, 'eve': 0}, {'ann': 1, 'bob': 1, 'eve': 1}, g).radius[0]": "1/2",
    "ptcc.box({'ann': 0}, {'ann': 1})": "ParameterError: low has labels",
    "ptcc.box(0, 1)": "ParameterError: low is 0; give one number for each agent",
    "ptcc.worst_initial_state(g, p, 1).size > 0": "True",
    "ptcc.simulate(g, robust, x0, sigma0=[1, 0, 1], disturbance='sin(2*k*t)', times=[0, 1])": "Trajectory(3 agents",
    "ptcc.simulate(g, robust, x0, disturbance='sin(2*k*')": "ParameterError: disturbance",
    "ptcc.simulate(g, robust, x0, disturbance=lambda t, x, sigma: 0 * x, times=[0, 1])": "Trajectory(3 agents",
    "ptcc.simulate(g, robust, x0, disturbance=lambda t: 0)": "... give a function of (t, x, sigma)",
    "ptcc.simulate(g, robust, x0, disturbance='2', times=[0, 1])": "... beyond delta = 1.0; lower it or raise delta",
}
STUDENT = {
    "ptcc.certify('fig1b', p, 'random', asks=fast)": "Certificate(certified; bipartite consensus",
    "pd.Series(cert.final_state).index.tolist()": "['ann', 'bob', 'eve']",
    "'joe' in cert.final_state, cert.final_state.get('joe')": "(False, None)",
    "ptcc.certify('fig1b', p, '5,2,-4,3,-2,1', asks=fast).final_state": "FinalState(1=",
    "ptcc.certify('fig9', p)": "FormatError: fig9: no such file, and no packaged graph (fig1a, fig1b",
    "ptcc.certify(None, p)": "GraphError: None is not read as a graph; give a SignedDigraph, a path",
    "ptcc.analyse('fig1a').claim.behaviour": "stability",
    "cert": "Certificate(certified; bipartite consensus, Theorem 2.1",
    "cert.summary()": "verdict",
    "cert.plot()": "Figure",
    "cert.plot('states')": "Axes",
    "cert.plot(what='input')": "Axes",
    "cert.plot('graph')": "Axes",
    "cert.plot('spectrum')": "Axes",
    "cert.plot('pretty')": "ParameterError: what = 'pretty' is unknown; one of glance, decay, input",
    "cert.trajectory.plot()": "Axes",
    "ptcc.plot_decay('c.json')": "Axes",
    "ptcc.plot_graph(folder / 'c.json')": "Axes",
    "ptcc.plot_graph('fig1a')": "Axes",
}
REVIEWER = {
    "ptcc.check(cert).accepted": "True",
    "ptcc.check(cert.to_dict()).accepted": "True",
    "ptcc.check(folder / 'c.json').accepted": "True",
    "ptcc.check('nowhere.json')": "FormatError: nowhere.json",
    "repr(ptcc.check(cert))": "CheckReport(accepted, certified, ",
    "ptcc.cite('2.1')": "@unpublished{zhu",
    "ptcc.cite('9')": 'ParameterError: no theorem "9"',
    "ptcc.check(5)": "FormatError: 5 is no certificate; give its path",
    "ptcc.check({'claim': 'all is well'}).accepted": "False",
    "ptcc.read_certificate(folder / 'c.json') == cert": "True",
    "ptcc.read_certificate(cert.to_dict()).verdict": "certified",
    "ptcc.read_certificate({'claim': 'all is well'})": '... the key "schema" is missing',
    "ptcc.write_report(cert, folder / 'c.docx')": "... a report is written to .html or .tex",
    "ptcc.write_report(cert, folder / 'c.tex', simulation=False)": "certified",
    "cert.save(folder / 'again.json')": "None",
    "ptcc.read_graph('c.json')": "FormatError: c.json: is a certificate, not a graph; ptcc check c.json checks it",
    "ptcc.certify(folder / 'c.json', p)": "... in Python read_certificate(path)",
    "ptcc.as_family('c.json')": "... is a certificate, not a graph",
    "ptcc.write_graph(g, 'forty.csv') or ptcc.check('forty.csv')": "... not a readable certificate; if it is a graph",
    "ptcc.write_graph(g, 'forty.csv') or ptcc.read_certificate('forty.csv')": "... ptcc certify forty.csv -o",
    "ptcc.read_certificate('fig1b')": "FormatError: fig1b: is a packaged graph, not a certificate; ptcc certify fig1b",
    "ptcc.check(cert.to_json())": "... is JSON text, not a path; give json.loads(text), a path or a Certificate",
    "ptcc.read_certificate(cert.to_json())": "... is JSON text, not a path; give json.loads(text), a path or a Certi",
    "cert.save(folder / 'nowhere' / 'c.json')": "FormatError: ",
    "{cert: 1}[ptcc.read_certificate(folder / 'c.json')]": "1",
}
#: Arguments that no function has, too many, too few, or of another kind.
MISTAKES = {
    "ptcc.certify(G, T=2)": "ParameterError: certify has no parameter T; give it to NominalProtocol(T=...)",
    "ptcc.certify(G, p, x0, gain_cap=50)": "ParameterError: certify has no parameter gain_cap; give it to GainLimits(",
    "ptcc.certify(G, p, x0, min_rate=1)": "... give it to Expectations(min_rate=...)",
    "ptcc.certify(G, p, x_0=x0)": "ParameterError: certify has no parameter x_0; did you mean x0?",
    "ptcc.certify(G, p, x0, 'listens')": "ParameterError: certify takes graph, protocol, x0 without a name; write any",
    "ptcc.certify(G, p, x0, x0=x0)": "ParameterError: certify takes graph, protocol, x0 without a name, each once",
    "ptcc.certify(G)": "ParameterError: certify asks for protocol; write certify(graph, protocol)",
    "ptcc.certify_many(G, p, progress=True)": "ParameterError: progress = True is no function; give print, say",
    "ptcc.certify(G, p, x0, method='perron')": "... certify has no parameter method; give it to Asks(method",
    "ptcc.certify(G, p, x0, noise=1)": "... certify has no parameter noise; give it to Asks(noise=...)",
    "ptcc.certify(G, p, x0, sigma0=x0)": "... certify has no parameter sigma0; give it to InitialState(sigma0=...)",
    "ptcc.certify(G, p, asks='stability')": "ParameterError: asks = 'stability' is none; give Asks(method=",
    "ptcc.certify(G, p, asks=ptcc.Asks(method='best of all'))": 'ParameterError: method "best of all" is unknown; one',
    "ptcc.certify_many(G, p, methd='perron')": "ParameterError: certify_many has no parameter methd; did you mean meth",
    "ptcc.certify_many(G, p, uncertainty='20%')": "ParameterError: certify_many has no parameter uncertainty, which ma",
    "ptcc.certify(pd.DataFrame({'from': list('aa'), 'to': list('aa'), 'w': 1}), p)": "... drop_self_loops=True)",
    "ptcc.certify([('a', 'a', 1), ('b', 'b', 1)], p)": "GraphError: self-loop at node a (2 in all); remove them",
    "ptcc.certify(p, G)": "ParameterError: graph and protocol are exchanged; write certify(graph, protocol)",
    "ptcc.model.constrained_switching.DwellTime(0.5)": "DwellTime(0.5, clock='t')",
    "ptcc.model.constrained_switching.JointWindows(2, on=0.5)": "JointWindows(2, on=0.5, clock='s')",
    "ptcc.DwellTime(0.5)": "DwellTime(0.5, clock='t')",
    "ptcc.certify({'ann': ['bob'], 'bob': ['eve']}, p)": "... a dict is a family of graphs by name; give the edges",
    "ptcc.certify({'ann': {'bob': 1}}, p)": "... a dict is a family of graphs by name; give the edges",
    "ptcc.certify_many(G, p, output=5)": "FormatError: 5 names no file; give a path",
    "ptcc.certify_many(G, p, progress=None, method='perron')[0]['nodes']": "3",
    "ptcc.read_graph('x.csv', edges='listens')": "ParameterError: read_graph has no parameter edges; ",
    "ptcc.read_graph('x.csv', sep=';')": "ParameterError: read_graph has no parameter sep; it has path, orientation, ",
    "ptcc.read_graph()": "ParameterError: read_graph asks for path; write read_graph(path)",
    "ptcc.read_graph(G)": "... a DiGraph is no file; ptcc_certify.as_graph takes other data",
    "ptcc.read_graph('fig1a')": "FormatError: fig1a: no such file; ptcc_certify.as_graph takes the packaged graph",
    "ptcc.SignedDigraph.from_edges(df)": "... is not a triple (source, target, weight); as_graph takes tables",
    "ptcc.certify(G, p, ptcc.graphs.io.random_states(3, 3), asks=fast)": "Certificate(certified; bipartite consensus",
    "ptcc.certify(G, p, colour='red')": "ParameterError: certify has no parameter colour; it has graph, protocol",
    "ptcc.plot_decay(G, p, x0)": "... without a name; write any other as name=value",
    "ptcc.plot_decay(G)": "... not from DiGraph; give certify(graph, protocol, x0)",
    "ptcc.write_report(g, 'c.html')": "... is a graph, no certificate; give certify(graph, protocol, x0)",
    "ptcc.read_certificate(G)": "... is a graph, no certificate; give certify(graph, protocol, x0)",
    "ptcc.simulate(G, p)": "ParameterError: simulate asks for x0; write simulate(graph, protocol, x0)",
    "ptcc.simulate(G, p, x0, samples='many')": "ParameterError: samples = many is outside its domain; it must be an",
    "ptcc.simulate(G, p, x0, past=None)": "ParameterError: past = None is outside its domain; it must be a number from",
    "cert.simulate(sample=5)": "ParameterError: simulate has no parameter sample; did you mean samples?",
    "cert.envelope.compare(cert)": "... is no run; give what simulate returned",
    "cert.plot('graph', layout='spring')": "ParameterError: plot_graph has no parameter layout; it has subject, ax",
    "cert.norm_bound()": "ParameterError: norm_bound asks for remaining; write norm_bound(remaining)",
    "cert.save()": "ParameterError: save asks for path; write save(path)",
    "cert.save('c.zip')": "ParameterError: c.zip: a certificate is saved as .json",
    "cert.changed(T=3)": "ParameterError: Certificate has no parameter T; give it to NominalProtocol(T=...)",
    "ptcc.NominalProtocol(rho=2)": "ParameterError: NominalProtocol has no parameter rho; did you mean rho2 or rho1?",
    "ptcc.SlidingModeProtocol(T=1)": "ParameterError: SlidingModeProtocol has no parameter T; it has T_r, T_s, rho1",
    "ptcc.Expectations(rate=3)": "ParameterError: Expectations has no parameter rate; did you mean min_rate?",
    "ptcc.Ensemble()": "ParameterError: Ensemble asks for count, nodes; write Ensemble(count, nodes)",
    "ptcc.design(G, 10, 1)": "... write design(graph, max_input=..., initial_bound=...)",
    "ptcc.plot_graph(G, ax='top')": "ParameterError: ax = 'top' is none; give axes of Matplotlib, or leave it out",
    "ptcc.plot_trade_off(cert)": "ParameterError: this figure is drawn from a design, not from Certificate; ask design",
    "ptcc.save_figure(cert, 'c.png')": "ParameterError: a Certificate is no figure; give what a plot_ function",
    "ptcc.final_state(G, x0, matrix=5)": "ParameterError: matrix is not the influence of this graph; leave it out",
    "ptcc.final_state(G, x0, matrix=ptcc.influence('fig1a'))": "ParameterError: matrix is not the influence of this",
    "ptcc.explore(G, p)": "ParameterError: settings = NominalProtocol(T=1, rho1=1, rho2=2, kap... is none; give",
    "ptcc.check(cert, memory='1 GB')": "ParameterError: memory in GB = 1 GB is outside its domain",
    "ptcc.check(cert, 'team.csv')": "ParameterError: check takes source without a name",
    "ptcc.write_report(cert, 'c.html', title='Team')": "ParameterError: write_report has no parameter title; it has",
    "ptcc.analyse(G).holds('peace')": 'ParameterError: unknown behaviour "peace"; one of stability',
    "ptcc.SignedDigraph([('ann', 'bob', 1)])": "ParameterError: SignedDigraph asks for source, target, weights; write",
    "ptcc.SignedDigraph.from_edges(5)": "GraphError: 5 is no list of edges; give triples (source, target, weight)",
    "ptcc.SignedDigraph.from_matrix(W, direction='listens')": "... from_matrix has no parameter direction; did you",
    "g.subgraph(['anne'])": "UnknownAgentError: no agent is called 'anne'",
    "g.subgraph([3])": "GraphError: a node of a subgraph is an index from 0 to 2, or a label, a text",
    "ptcc.as_graph([('ann', None, 1)])": "GraphError: an edge names no node (None); leave it out or name the node",
    "ptcc.as_graph(df.set_axis(['ego', 'alter', 'tie'], axis=1))": '... as_graph(.., columns="ego,alter,tie"), with or',
    "ptcc.as_graph(df.assign(source=pd.NA))": "GraphError: row 1, source of the DataFrame names no node (<NA>); leave",
    "ptcc.certify(df, p, columns='ego,alter,tie')": "... has no parameter columns; give it to as_graph(columns=...)",
    "ptcc.certify(df, p, edges='listens')": "... certify has no parameter edges; give it to as_graph(orientation=...)",
    "ptcc.as_graph(df, edges='listens')": "... has no parameter edges; it is called orientation",
    "ptcc.as_graph(np.ma.masked_equal([[0, 1], [1, 0]], 1), 'listens')": "GraphError: an entry of the adjacency matrix",
    "ptcc.as_state(np.ma.masked_equal(x0, 2), g)": "ParameterError: the initial state x0 has masked entries; give one",
    "sparse.save_npz('m.npz', g.adjacency()) or ptcc.as_graph('m.npz')": "GraphError: m.npz: a matrix does not tell",
}
FAMILIES = {
    "day": "Family(2 nodes, 1 of 2 weights uncertain)",
    "len(day), list(day), 'ann' in day, 'ed' in day": "(2, ['ann', 'bob'], True, False)",
    "day == ptcc.as_family(day) and hash(day) == hash(ptcc.as_family(day))": "True",
    "day.to_pandas().iloc[1].astype(str).tolist()": "['', 'ann', 'bob', '-2.0', '-1.0']",
    "ptcc.Family.switching({'day': day, 'day two': day}).modes[0] == day.modes[0]": "True",
    "ptcc.Family.switching([day, day]), ptcc.Family.switching({'on': g, 'off': g})": "Family(3 nodes, 2 modes)",
    "ptcc.Family.switching({'day': edges, 'night': edges})": "GraphError: mode day: [('ann', 'bob', -2), ('bob', 'ann'",
    "ptcc.Family.switching([edges, edges])": '... SignedDigraph; ptcc_certify.as_family({"day": edges, "night": edg',
    "ptcc.Family.switching(g, g)": "... switching takes modes without a name; write any other as name=value",
    "ptcc.Family.switching(modes=[day])": "Family(2 nodes",
    "ptcc.certify([edges, edges], p)": '... a dict, {"day": edges, "night": edges2}',
    "ptcc.certify([edges, edges, edges], p)": '... a dict, {"day": edges, "night": edges2}',
    "ptcc.certify({'day': edges, 'night': edges}, p)": "Certificate(certified; bipartite consensus for every signal",
    "ptcc.as_family({'day': edges, 'typo': [('ann', 'bbo', 1), ('ann', 'eve', 1)]})": "... has; did you mean bob?",
    "ptcc.certify(day, p, [1, 2]).final_state": "FinalEnds(ann in [-0.500001, 0.100001], bob in [-0.10",
    "ptcc.certify(day, p, [1, 2]).final_state['ann'] == ptcc.certify(day, p, [1, 2]).final_state[0]": "True",
    "ptcc.certify(day, p, [1, 2]).final_state['joe']": "UnknownAgentError: no agent is called 'joe'",
    "ptcc.certify(day, p, [1, 2]).final_state[::-1][0] == ptcc.certify(day, p, [1, 2]).final_state['bob']": "True",
    "copy.deepcopy(ptcc.certify(day, p, [1, 2]).final_state)['bob'] == ptcc.certify(day, p, [1, 2]).final_state[1]": (
        "True"
    ),
    "ptcc.certify(day, p)": "Certificate(certified; bipartite consensus for every signal",
    "ptcc.certify(day, p).plot()": "Figure",
    "ptcc.certify(day, p).plot('decay')": "ParameterError: the certificate has no initial state; certify the family",
    "ptcc.certify(day, p, [1, 2]).plot('graph')": "Axes",
    "ptcc.certify(day, p, [1, 2]).plot('spectrum')": "ParameterError: eigenvalues of single graphs do not tell what",
    "ptcc.certify(day, p, [1, 2]).plot('picture')": "ParameterError: what = 'picture' is unknown; one of glance, decay",
    "ptcc.certify(day, p, [1, 2]).to_pandas().shape": "(2, 10)",
    "ptcc.certify(day, p).to_pandas()[['least', 'largest']].isna().all(axis=None)": "True",
    "cert.to_pandas().loc['eve', ['role', 'x(0)']].tolist()": "-4.0",
    "ptcc.certify(day, p).report": "... for a page or LaTeX: write_report(certificate, path)",
    "ptcc.certify(day, p).summary()": "claim      bipartite consensus at T = 1 for every signal",
    "ptcc.write_report(ptcc.certify(day, p), 'f.html')": "certified",
    "ptcc.plot_graph(day)": "Axes",
    "ptcc.plot_input(ptcc.certify(day, p, [1, 2]))": "Axes",
    "ptcc.plot_spectrum(day)": "ParameterError: this figure is of one graph; of families draw plot_graph",
    "ptcc.plot_decay(ptcc.certify(day, p, [1, 2]))": "Axes",
    "ptcc.plot_trajectory(day)": "ParameterError: this figure is of one graph; of families draw plot_graph",
    "ptcc.decide(day)[0].plot()": "ParameterError: the component has no counterexample",
    "ptcc.analyse(day)": "GraphError: Family(2 nodes, 1 of 2 weights uncertain) is several graphs",
}
CALLS = CONTROL_RESEARCHER | NETWORK_SCIENTIST | ENGINEER | STUDENT | REVIEWER | MISTAKES | FAMILIES


@pytest.fixture(scope="module")
def names(tmp_path_factory) -> dict[str, Any]:
    """What stands above in the notebook of all five."""
    nx, pd = pytest.importorskip("networkx"), pytest.importorskip("pandas")
    pytest.importorskip("matplotlib").use("Agg")
    edges = [("ann", "bob", -2), ("bob", "ann", -1), ("bob", "eve", 1)]
    digraph = nx.DiGraph()
    digraph.add_weighted_edges_from(edges)
    g, p, x0 = ptcc.as_graph(edges), ptcc.NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [5, 2, -4]
    folder = tmp_path_factory.mktemp("notebook")
    cert = ptcc.certify(g, p, x0, asks=ptcc.Asks(method="perron"))
    cert.save(folder / "c.json")
    return {
        **{"ptcc": ptcc, "np": np, "nx": nx, "pd": pd, "sparse": sparse, "Fraction": Fraction, "StringIO": StringIO},
        **{
            "copy": copy,
            "edges": edges,
            "g": g,
            "G": digraph,
            "p": p,
            "x0": x0,
            "cert": cert,
            "folder": folder,
            "Path": Path,
        },
        "df": pd.DataFrame(edges, columns=["source", "target", "weight"]),
        "day": ptcc.as_family([("ann", "bob", -2, -1), ("bob", "ann", -1, -1)]),
        "W": np.array([[0, -2.0], [-1, 0]]),
        "robust": ptcc.SlidingModeProtocol(T_r="0.5", T_s="0.5", kappa=1),
        "fast": ptcc.Asks(method="perron", simulation=False),
    }


def test_a_hundred_calls_are_listed():
    assert len(CALLS) >= 100


@pytest.mark.few(100)
@pytest.mark.parametrize("call", CALLS)
def test_a_natural_call_gives_a_result_or_one_line_that_names_the_mend(call, names, monkeypatch):
    monkeypatch.chdir(names["folder"])
    refused = "Error: " in CALLS[call] or CALLS[call].startswith("... ")
    with pytest.raises(PTCCError) if refused else nullcontext() as caught:
        shown = str(eval(call, dict(names)))  # noqa: S307 - a call of the list above
    if caught is not None:
        shown = f"{caught.type.__name__}: {caught.value}"
        assert "\n" not in shown
    assert CALLS[call].removeprefix("... ") in shown
