"""Facts about the documentation: what every public name tells, compared with what the name is.

numpydoc validates the form: sections and their order, summaries, parameters and results. What it knows nothing of is
asked here: a source, a unit, the shape of an array, an example that uses the name, and what contradicts the code.
"""

import ast
import builtins
import dataclasses
import doctest
import inspect
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any, get_origin

import pytest
from numpydoc.docscrape import NumpyDocString, Parameter, get_doc_object
from numpydoc.validate import ERROR_MSGS, validate

import lmi
import ptcc_certify

#: Names of the rooms that are documented like those at the top.
IN_ROOMS = {
    "errors": ("NumberError", "GraphError", "FormatError", "ParameterError", "HypothesisError", "SimulationError"),
    "graphs.io": ("read_state",),
    "graphs.structure": ("ClosedComponent", "WeakComponent"),
    "theorems.claims": ("Claim",),
    "model.constrained_switching": ("DwellTime", "JointWindows", "ClockShares"),
    "theorems.table": ("THEOREMS", "theorem_for"),
    "theorems.lemmas": (
        "gauge",
        "left_vector",
        "exact_left_vector",
        "laplacian_spectrum",
        "algebraic_connectivity",
        "unbalanced_lyapunov",
        "follower_lyapunov",
        "containment_weights",
        "exact_containment_weights",
    ),
    "theorems.casadi_lyapunov": ("SymbolicLyapunov", "symbolic_lyapunov"),
    "model.gain": ("Gain", "prescribed_time_bound"),
    "model.disturbance": ("WorstCaseDisturbance",),
    "model.reaching_time": ("ReachingTime", "certified_reaching_times"),
    "simulation.trajectory": ("Sliding",),
    "bounds.final_state.of_graph": ("FinalState", "Influence"),
    "bounds.final_state.captured": ("Captured", "Reach"),
    "bounds.envelope": ("Envelope", "Comparison"),
    "bounds.input.effort": ("Effort",),
    "bounds.input.initial_sets": ("initial_set_within",),
    "bounds.input.worst_initial_state": ("WorstInitialState",),
    "certificate.assessment": ("Assessment",),
    "certificate.certificate": ("RejectedCertificate",),
    "checker": ("CheckReport",),
    "checker.input_formulas": ("InitialSet",),
    "gain_design.answer": ("Design",),
    "graphs.frustration": ("frustration_index", "FrustrationIndex", "NegativeCycle"),
    "report.page": ("report_html",),
    "report.statement": ("report_latex",),
}
PUBLIC = [(package, name) for package in (ptcc_certify, lmi) for name in package.__all__ if name != "__version__"]
PUBLIC += [(import_module(f"ptcc_certify.{module}"), name) for module, names in IN_ROOMS.items() for name in names]
ROOTS = {"ptcc_certify", "lmi", __name__.split(".")[0]}


def of_modules(*modules: str) -> set[str]:
    """Return the public names of modules of these names, whatever their room."""
    places = [*ptcc_certify._EXPORTS.items(), *((name, room) for room, names in IN_ROOMS.items() for name in names)]
    return {name for name, module in places if set(module.split(".")) & set(modules)}


#: Names that cite nothing, and why.
NO_SOURCE = {
    "errors state what is wrong with an input, not mathematics": {
        *("PTCCError", *IN_ROOMS["errors"]),
        *("LMIError", "MatrixError", "NoCertificate", "NotAnHMatrix", "NotAnMMatrix", "OutOfTime"),
    },
    "a time limit is what its definition says": {"time_limit"},
    "what is asked, and where agents begin, is what their definitions say": {"Asks", "InitialState"},
    "BibTeX is the source": {"cite"},
    "families are new here: their page is docs/theory/families.md": {
        *("Family", "decide", "DwellTime", "JointWindows", "ClockShares")
    },
    "agents of order n are new here: their page is docs/theory/agents.md": {
        *("Agents", "companion_form", "formation_of_biases")
    },
    "files and numbers are converted": {
        *(
            "as_family",
            "read_family",
            "as_graph",
            "as_state",
            "read_graph",
            "write_graph",
            "read_state",
            "dyadic_integers",
            "round_to_bits",
        )
    },
    "figures, pages and tables show what was computed elsewhere": of_modules("plots", "report", "explorer", "batch"),
    "certificates that are read back state what was proved before": {"read_certificate", "RejectedCertificate"},
    "sets of starts are what their definition says": {"InitialSet", "initial_set_within", "box", "ellipsoid"},
    "disturbances and random graphs are data": {
        *("ExpressionDisturbance", "SampledDisturbance", "StateDependent", "telegraph_noise"),
        *of_modules("ensembles"),
    },
    "the check names the lemma of each step in its report": {"check", "CheckReport"},
}

#: How an example may refer to a public name: imported by itself, or with its package.
PLACES = ("", "ptcc.", "ptcc_certify.", "lmi.")
#: What numpydoc's validation is not asked for, and why.
LEFT_OUT = {
    "a docstring says each thing once: type and name may be enough": {"ES01", "PR07", "PR08", "RT03", "RT04", "SA01"},
    "entries of one type stand together, in a phrase of their own": {"PR03", "PR09", "RT05"},
    "what a with statement or a loop gets stands under Returns": {"YD01"},
    "takes any word that ends with s for a verb": {"SS05"},
}
#: Quantities of time, rate or input: their entry tells the unit.
DIMENSIONED = {
    *("T", "T_r", "T_s", "deadline", "t", "at", "times", "until", "sample_period", "stop_before"),
    *("rho1", "mu1", "mu2", "delta", "gain_cap", "rate", "rates", "numerical_rate", "spectral_rate"),
}
UNIT = re.compile(r"\bunits? of \w|\b1/(time|weight)\b|\bdimensionless\b", re.IGNORECASE)
LENGTH = r"\w+( ?[-+] ?\w+)?"
SHAPE = re.compile(rf"\({LENGTH},( {LENGTH}(, {LENGTH})*)?\)|\b[Oo]f (any shapes?|the shape (of|to))\b")
NUMBERED = r"(Theorem|Lemma|Corollar(y|ie)|Definition|Proposition|Example|Section|Remark)s?"
EQUATION = r"\b([Ee]quation|[Pp]rotocol|[Nn]etwork|[Ss]ystem)s?\s+\([0-9]{1,2}\)"
DATED = re.compile(r"\b(18|19|20)[0-9]{2}\b")
CITATION = re.compile(rf"\b{NUMBERED}\s+([0-9]|[IVX]+\b)|{EQUATION}")
#: Words for types, and the names in an annotation of which one justifies each.
TYPE_WORDS = {
    r"bools?": {"bool"},
    r"ints?|integers?": {"int", "ndarray", "ArrayLike"},
    r"floats?": {"float", "ndarray", "ArrayLike"},
    r"str|strings?|texts?": {"str"},
    r"bytes": {"bytes"},
    r"Fractions?": {"Fraction"},
    r"[Pp]aths?": {"Path", "PathLike"},
    r"mappings?|dicts?": {"Mapping", "dict"},
    r"tuples?": {"tuple", "Sequence", "Iterable"},
    r"lists?": {"list", "Sequence", "Iterable"},
    r"sequences?|iterables?": {"tuple", "list", "Sequence", "Iterable"},
    r"arrays?|array_like": {"ndarray", "ArrayLike"},
    r"callables?": {"Callable"},
}
#: What an entry must say if its annotation admits the type: its word, a word for more, or choices.
SAID = {
    "bool": r"\bbools?\b",
    "int": r"\b(ints?|integers?|numbers?)\b|\{[^}]*\d",
    "float": r"\b(floats?|numbers?)\b",
    "str": r"\b(str|[Pp]aths?)\b|\"",
    "bytes": r"\bbytes\b",
    "Mapping": r"\b(mapping|dict)\b",
    "dict": r"\b(mapping|dict)\b",
    "Callable": r"\bcallable\b",
    "None": r"\b(None|optional)\b",
}
#: A default as an entry states it; words that are no literal ("by default up to 10 agents") state none.
VALUE = r"(``[^`]+``|\"[^\"]*\"|[-+]?\.?\d[\d,._]*(?:e[-+]?\d+)?|\w+)(?!\w)"
STATED = (
    rf"\bdefault(?:s to| is|:|=)? ?{VALUE}(?! and\b)",
    rf"(?<![\w`\",.]){VALUE} (?:by default|\(the default\))(?! [\d`\"]| up\b)",
)


@cache
def parsed(doc: str) -> NumpyDocString:
    """Return the sections of a docstring."""
    return NumpyDocString(doc)


def entries(section: Iterable[Parameter]) -> dict[str, str]:
    """Return the names that a section documents: the type on the first line of each text, then the description."""
    texts = [("\n".join([one.type, *map(str.strip, one.desc)]), one.name.split(",")) for one in section]
    return {name.strip().lstrip("*"): text for text, names in texts for name in names}


def faults_of_form(thing: Any) -> Iterator[str]:
    """Return what numpydoc finds, but for what is left out; fields of a class may be documented as attributes."""
    left_out = set().union(*LEFT_OUT.values()) | ({"PR01"} if isinstance(thing, type) else set())
    yield from (f"{code} {text}" for code, text in validate(get_doc_object(thing))["errors"] if code not in left_out)


def parameters(function: Any) -> list[str]:
    """Return the names of the parameters that a caller gives."""
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def raises(function: Any) -> bool:
    """Tell whether a function's own source has a raise statement."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    return any(isinstance(node, ast.Raise) for node in ast.walk(tree))


def ours(function: Any) -> bool:
    """Tell whether a function was written in one of the packages, rather than generated or inherited from Python."""
    module = getattr(function, "__module__", None) or ""
    return isinstance(function, FunctionType) and module.split(".")[0] in ROOTS


def plain(function: Any) -> Any:
    """Return the function behind a method, property, cached property or gate for its calls."""
    if isinstance(function, classmethod | staticmethod):
        function = function.__func__
    elif isinstance(function, property | cached_property):
        function = function.fget if isinstance(function, property) else function.func
    return inspect.unwrap(function) if callable(function) else function


def own_docs(cls: type, name: str | None = None) -> list[str]:
    """Return the docstrings that a class (or a member) has itself and from those it inherits from."""
    places = [vars(base).get(name) if name else base for base in cls.__mro__ if base.__module__.split(".")[0] in ROOTS]
    docs = [
        vars(place).get("__doc__") if isinstance(place, type) else plain(place).__doc__ for place in places if place
    ]
    return [inspect.cleandoc(doc) for doc in docs if doc]


def that_run(found: NumpyDocString) -> list[doctest.Example]:
    """Return the examples of a docstring that are not skipped."""
    examples = doctest.DocTestParser().get_examples("\n".join(found["Examples"]))
    return [one for one in examples if not one.options.get(doctest.SKIP)]


def used(examples: Iterable[doctest.Example], kind: type[ast.AST], part: str) -> set[str]:
    """Return a part of every node of a kind in the code of examples, as text; comments and strings are no such node."""
    nodes = [node for one in examples for node in ast.walk(ast.parse(one.source)) if isinstance(node, kind)]
    parts = [getattr(node, part) for node in nodes]
    return {ast.unparse(part) if isinstance(part, ast.AST) else str(part) for part in parts}


def literal(text: str) -> Any:
    """Return the value that a text writes down; a text that is no literal is returned as it is, without backquotes."""
    bare = re.sub(r"(?<=\d),(?=\d{3})", "", text.strip("`").rstrip(".,"))
    try:
        return ast.literal_eval(bare)
    except (SyntaxError, ValueError):
        return bare


@cache
def aliases(module_name: str) -> dict[str, Any]:
    """Return the names that the annotations of a module may use, with those imported for type checkers only."""
    module = import_module(module_name)
    tree = ast.parse(inspect.getsource(module))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
    found = {
        name.asname or name.name: getattr(import_module(node.module), name.name, None)
        for node in imports
        if node.module.split(".")[0] in ROOTS
        for name in node.names
    }
    return found | vars(module)


def annotation_text(annotation: Any) -> str:
    """Return an annotation as it is written, whether Python kept it as a text or not."""
    return annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)


def written_out(annotation: str, names: dict[str, Any]) -> str:
    """Return an annotation with the aliases of types in it written out."""

    def alias(word: re.Match) -> str:
        value = names.get(word[0])
        return written_out(annotation_text(value), names) if get_origin(value) else word[0]

    return re.sub(r"(?<![\w.\"'])[A-Z]\w*", alias, annotation)


def union(annotation: ast.expr) -> list[str]:
    """Return the members of a union."""
    if isinstance(annotation, ast.BinOp):
        return [*union(annotation.left), *union(annotation.right)]
    return [ast.unparse(annotation)]


def faults_of_type(name: str, kind: str, annotation: str) -> Iterator[str]:
    """Compare the type that an entry tells with the annotation, its aliases written out."""
    said = re.sub(r"\{.*?\}|\".*?\"|``.*?``", "", kind)
    known = set(re.findall(r"\w+", annotation))
    if "Any" not in known:
        for word, types in TYPE_WORDS.items():
            found = re.search(rf"\b({word})\b", said)
            if found and not known & types:
                yield f"{name} is documented as {found[0]}, not {annotation}"
    for function in union(ast.parse(annotation, mode="eval").body):
        head = function.split("[")[0]
        if head in SAID and not re.search(SAID[head], kind):
            yield f"{name} is {head}, its entry does not say so"
        public = function.removeprefix("lmi.") in {name for _, name in PUBLIC}
        if public and not re.search(rf"\b{re.escape(function)}\b", kind):
            yield f"{name} is {function}, its entry does not say so"
        if function.startswith("Literal["):
            choices = ast.literal_eval(function.removeprefix("Literal"))
            if choices_of(kind) != {*choices}:
                yield f"{name} has other choices than documented"


def choices_of(kind: str) -> set[Any]:
    """Return the choices that an entry tells in braces."""
    found = re.match(r"\{.*?\}", kind)
    return set(literal(found[0])) if found else set()


def faults_of_default(name: str, text: str, default: Any) -> Iterator[str]:
    """Compare the default and the choices that an entry tells with the default there is."""
    kind = text.split("\n")[0]
    required = default is inspect.Parameter.empty
    if re.search(r"\boptional\b", kind) and required:
        yield f"{name} is not optional"
    if not required and not isinstance(default, bool | int | float | str | None):
        return
    sentences = " ".join(text.split())
    stated = [literal(found[1]) for pattern in STATED for found in re.finditer(pattern, sentences, re.IGNORECASE)]
    for value in stated:
        # A word that is no literal tells a default only where that is a text; "by default up to 10 agents" tells none.
        telling = isinstance(default, str) or not isinstance(value, str)
        if telling and required:
            yield f"{name} has no default, not {value!r}"
        elif telling and (value != default or isinstance(value, bool) != isinstance(default, bool)):
            yield f"{name} is {default!r} by default, not {value!r}"
    choices = choices_of(kind)
    if choices and not required and default is not None and default not in choices:
        yield f"{name} is {default!r} by default, which is none of its choices"


def faults_of_unit(name: str, text: str, alone: bool) -> Iterator[str]:
    """Ask for a unit; in an entry of several names behind the name, in its clause, where the entry names it."""
    clauses = [clause for clause in re.split(r"[.;](?=\s|$)", text) if f"``{name}``" in clause and not alone]
    places = [clause.split(f"``{name}``", 1)[1] for clause in clauses] or [text]
    if not any(UNIT.search(place) for place in places):
        yield f"{name} has no unit"


def faults_of_entries(
    documented: dict[str, str], there: Mapping[str, inspect.Parameter], names: dict[str, Any]
) -> Iterator[str]:
    """Find entries without type, shape or unit, and those that contradict the parameters or fields that are there."""
    for name, text in documented.items():
        kind = text.split("\n")[0]
        if not re.sub(r"\W*optional\W*", "", kind):
            yield f"{name} has no type"
        if re.search(r"\barrays?\b", kind) and not SHAPE.search(text):
            yield f"{name} is an array without a shape"
        if name in DIMENSIONED:
            yield from faults_of_unit(name, text, alone=[*documented.values()].count(text) == 1)
        if name not in there:
            continue
        default, annotation = there[name].default, there[name].annotation
        yield from faults_of_default(name, text, default)
        if annotation is not inspect.Parameter.empty:
            yield from faults_of_type(name, kind, written_out(annotation_text(annotation), names))
        elif isinstance(default, bool | int | float | str):
            yield from faults_of_type(name, kind, type(default).__name__)


def faults_of_result(function: Any, found: NumpyDocString) -> Iterator[str]:
    """Compare what a function is documented to return with its annotation."""
    results, annotation = found["Returns"], inspect.signature(function).return_annotation
    if len(results) == 1 and annotation is not inspect.Signature.empty:
        names = aliases(function.__module__)
        yield from faults_of_type("the result", results[0].type, written_out(annotation_text(annotation), names))
    body = "\n".join(line for one in results for line in (one.name, one.type, *one.desc))
    if re.search(r"\barrays?\b", body) and not SHAPE.search(body):
        yield "the result is an array without a shape"


def is_error(name: str) -> bool:
    """Tell whether a name is a public or built-in exception, or one of another package with its full name."""
    places: list[Any] = [ptcc_certify, ptcc_certify.errors, ptcc_certify.certificate.certificate, lmi, builtins]
    if "." in name:
        module, _, name = name.rpartition(".")
        places = [import_module(module)]
    found = [getattr(place, name) for place in places if hasattr(place, name)]
    return any(isinstance(kind, type) and issubclass(kind, Exception) for kind in found)


def faults_of_parts(name: str, doc: str) -> Iterator[str]:
    """Find what every name owes besides its form: an example that runs, a source, errors that exist."""
    found = parsed(doc)
    if not any(one.want for one in that_run(found)):
        yield "no example that shows something"
    elsewhere = doc.partition("Examples\n---")[0]
    exempt = any(name in names for names in NO_SOURCE.values())
    if not exempt and not DATED.search("\n".join(found["References"])) and not CITATION.search(elsewhere):
        yield "no source"
    yield from (f"{one.type} is no public exception" for one in found["Raises"] if not is_error(one.type))


def faults_of_function(function: Any, found: NumpyDocString) -> Iterator[str]:
    """Compare a function's sections with its signature and its source."""
    signature, names = inspect.signature(function), aliases(plain(function).__module__)
    yield from faults_of_entries(entries(found["Parameters"]), signature.parameters, names)
    yield from faults_of_result(function, found)
    if not found["Raises"] and raises(function):
        yield "no Raises"
    if not used(that_run(found), ast.Call, "func") & {f"{place}{function.__name__}" for place in PLACES}:
        yield "its example does not call it"


def fields_of(cls: type) -> dict[str, inspect.Parameter]:
    """Return the parameters of a class's constructor, and its properties and other annotated names as if they were."""
    kinds: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        kinds |= inspect.get_annotations(base)
        properties = {name: plain(function) for name, function in vars(base).items() if ours(plain(function))}
        kinds |= {
            name: inspect.signature(function).return_annotation
            for name, function in properties.items()
            if isinstance(vars(base)[name], property | cached_property)
        }
    keyword = inspect.Parameter.KEYWORD_ONLY
    found = {name: inspect.Parameter(name, keyword, annotation=kind) for name, kind in kinds.items()}
    given = {} if issubclass(cls, BaseException) else inspect.signature(cls).parameters
    return found | {name: one.replace(annotation=kinds.get(name, one.annotation)) for name, one in given.items()}


def is_shown(cls: type, examples: list[doctest.Example]) -> bool:
    """Tell whether examples call or catch a class, call its constructors, read a member of it, or print its name."""
    called = used(examples, ast.Call, "func") | used(examples, ast.ExceptHandler, "type")
    made = {call.removeprefix(place).split(".")[0] for call in called for place in PLACES}
    read = used(examples, ast.Attribute, "attr") & {*dir(cls), *fields_of(cls)}
    return cls.__name__ in made or bool(read) or any(re.search(rf"\b{cls.__name__}\b", one.want) for one in examples)


def faults_of_class(cls: type, found: NumpyDocString) -> Iterator[str]:
    """Compare a class's sections with its fields, its constructor and its public members."""
    constructor = {} if issubclass(cls, BaseException) else inspect.signature(cls).parameters
    attributes, arguments = (entries(found[title]) for title in ("Attributes", "Parameters"))
    yield from faults_of_entries(attributes, fields_of(cls), aliases(cls.__module__))
    yield from faults_of_entries(arguments, constructor, aliases(cls.__module__))
    own = attributes | arguments
    documented = set(own)
    for doc in own_docs(cls)[1:]:
        documented |= set(entries(parsed(doc)["Attributes"]))
    makers = [plain(vars(cls)[name]) for name in ("__init__", "__post_init__") if name in vars(cls)]
    makers = [maker for maker in makers if ours(maker) and maker.__code__.co_filename != "<string>"]
    given = [] if issubclass(cls, BaseException) else parameters(cls)
    fields = [field.name for field in dataclasses.fields(cls)] if dataclasses.is_dataclass(cls) else []
    assigned = {name for maker in makers for name in re.findall(r"\bself\.(\w+)\b.* = ", inspect.getsource(maker))}
    for name in dict.fromkeys([*fields, *given]):
        if not name.startswith("_") and name not in documented:
            yield f"field {name} is not documented"
    for name in own:
        if name not in {*fields, *given, *assigned} and not hasattr(cls, name):
            yield f"documented {name} is no field"
    if not found["Raises"] and any(map(raises, makers)):
        yield "no Raises"
    if not is_shown(cls, that_run(found)):
        yield "its example does not show it"
    for name in dir(cls):
        function = inspect.getattr_static(cls, name)
        if not name.startswith("_") and ours(plain(function)):
            yield from (f"{name}: {fault}" for fault in faults_of_member(function, own_docs(cls, name)))


def faults_of_member(function: Any, docs: list[str]) -> Iterator[str]:
    """Compare a method or property with its docstring and those of what it overrides."""
    if not docs or not re.search(r"[.:](\s|$)", docs[0]):
        yield "no docstring of one sentence"
        return
    found = [parsed(doc) for doc in docs]
    documented = entries(found[0]["Parameters"])
    function = plain(function)
    yield from faults_of_entries(documented, inspect.signature(function).parameters, aliases(function.__module__))
    yield from faults_of_result(function, found[0])
    if raises(function) and not any(one["Raises"] for one in found):
        yield "no Raises"
    if not isinstance(function, property | cached_property):
        there = parameters(function)
        named = {name for one in found for name in entries(one["Parameters"])}
        named |= {
            word for doc in docs for quoted in re.findall(r"``(.+?)``", doc) for word in re.findall(r"\w+", quoted)
        }
        yield from (f"{name} is not named" for name in there if name not in named)
        yield from (f"documented {name} is no parameter" for name in documented if name not in there)


def faults_of_constant(package: Any, name: str) -> Iterator[str]:
    """Ask for a comment ``#:`` above a constant where it is defined."""
    exports = getattr(package, "_EXPORTS", {})
    module = import_module(f"{package.__name__}.{exports[name]}") if name in exports else package
    source = Path(inspect.getfile(module)).read_text("utf-8")
    if not re.search(rf"^#: .*\n([\w, ]+, )?{name}\b.* = ", source, re.MULTILINE):
        yield "a constant without a comment #: above it"


def faults(name: str, thing: Any) -> list[str]:
    """Return everything that the documentation of a public class or function lacks."""
    doc = vars(thing).get("__doc__") if isinstance(thing, type) else thing.__doc__
    if not doc:
        return ["no docstring"]
    doc = inspect.cleandoc(doc)
    kind = faults_of_class if isinstance(thing, type) else faults_of_function
    return [*faults_of_form(thing), *faults_of_parts(name, doc), *kind(thing, parsed(doc))]


def stale(x, rate):
    """Return something.

    Parameters
    ----------
    x : array
    y
        Gone long since.
    rate : float

    Raises
    ------
    ColourError
        Never.

    Examples
    --------
    >>> 1 + 1
    2
    """
    if x:
        raise ValueError
    return x


@dataclasses.dataclass
class Poor:
    """Hold two numbers.

    Attributes
    ----------
    a : float
    c : float

    Examples
    --------
    >>> poor = Poor(1, 2)
    """

    a: float
    b: float

    def __post_init__(self) -> None:
        if self.a < 0:
            raise ValueError

    @property
    def unsaid(self) -> float:
        return self.a

    def scaled(self, factor: float) -> float:
        """Return more of ``a``.

        Parameters
        ----------
        share : float
        """
        if not factor:
            raise ValueError
        return factor * self.a


def test_the_rule_sees_what_is_missing_and_what_is_stale():
    assert set(faults("stale", stale)) == {
        *("no source", "ColourError is no public exception"),
        *("PR02 Unknown parameters {'y'}", 'PR04 Parameter "y" has no type', "y has no type"),
        *("x is an array without a shape", "rate has no unit"),
        *("RT01 No Returns section found", "its example does not call it"),
    }
    assert set(faults("Poor", Poor)) == {
        *("no source", "no example that shows something", "field b is not documented", "documented c is no field"),
        *("no Raises", "unsaid: no docstring of one sentence"),
        *("scaled: factor is not named", "scaled: documented share is no parameter", "scaled: no Raises"),
    }
    assert faults("silent", lambda: None) == ["no docstring"]
    assert list(faults_of_constant(ptcc_certify, "PTCCError")) == ["a constant without a comment #: above it"]


def misshapen(a: int, *, b: int) -> int:
    """return one (Lemma 1)

    Examples
    --------
    >>> misshapen(1, b=2)
    1

    Parameters
    ----------
    a : int

    Example
    -------
    >>> 1
    1
    """
    return a


@pytest.mark.filterwarnings("ignore:Unknown section")
def test_numpydoc_sees_what_is_out_of_form():
    assert {fault.split()[0] for fault in faults_of_form(misshapen)} >= {"SS02", "SS03", "GL06", "GL07", "PR01", "RT01"}
    assert set().union(*LEFT_OUT.values()) <= {*ERROR_MSGS}


def contradicted(a=3, b: bool = False, kind: str = "x", at: float | None = None) -> bool:
    """Return whether ``a`` is large (Lemma 1).

    Parameters
    ----------
    a : dict of bytes, default 99
    b : int
        True by default.
    kind : {"y", "z"}
        What is done.
    at : str
        Many times.

    Returns
    -------
    list of int

    Examples
    --------
    >>> 1 + 1  # contradicted(
    2
    >>> "contradicted()"
    'contradicted()'
    """
    return bool(a) == b


class Hidden:
    """Hold parts (5) of the best of 3 (equations).

    Examples
    --------
    >>> 1 + 1  # Hidden(
    2
    """

    def part(self, a: int, it: int, of: int) -> int:
        """Return a part of it, ``self`` as it is (``abs``)."""
        return a + it + of

    def power(self, a: int, it: int, of: int) -> int:
        """Return ``a ** it`` in units of ``of``."""
        return a**it * of


def test_the_rule_sees_what_contradicts_the_code():
    assert set(faults("contradicted", contradicted)) == {
        *("a is documented as bytes, not int", "a is documented as dict, not int"),
        *("a is int, its entry does not say so", "a is 3 by default, not 99"),
        *(
            "b is documented as int, not bool",
            "b is bool, its entry does not say so",
            "b is False by default, not True",
        ),
        "kind is 'x' by default, which is none of its choices",
        *("at is documented as str, not float | None", "at is float, its entry does not say so", "at has no unit"),
        *("at is None, its entry does not say so", "its example does not call it"),
        *("the result is documented as int, not bool", "the result is documented as list, not bool"),
        "the result is bool, its entry does not say so",
    }
    assert set(faults("Hidden", Hidden)) == {
        *("no source", "its example does not show it"),
        *(f"part: {name} is not named" for name in ("a", "it", "of")),
    }


@pytest.mark.parametrize(
    ("entry", "annotation", "default", "wrong"),
    [
        ("int", "int", 3, []),
        ("int\nHow many; 3 by default.", "int", 3, []),
        ("int, default 3", "int", 4, ["a is 4 by default, not 3"]),
        ("int (default: 10,000)", "int", 10_000, []),
        ("float\nDefaults to 1e-9.", "float", 1e-8, ["a is 1e-08 by default, not 1e-09"]),
        ("float\nIts default is 1e-8.", "float", 1e-8, []),
        ("bool\nTrue by default.", "bool", True, []),
        ("int\nTrue by default.", "int", 1, ["a is 1 by default, not True"]),
        ("int, optional", "int", inspect.Parameter.empty, ["a is not optional"]),
        ("int, default 3", "int", inspect.Parameter.empty, ["a has no default, not 3"]),
        ("float", "Mapping[str, Any]", inspect.Parameter.empty, ["a is Mapping, its entry does not say so"]),
        ("int, optional\nBy default up to 10 agents.", "int | None", None, []),
        ("int, optional\n7 by default.", "int | None", None, ["a is None by default, not 7"]),
        ('str\n``"best"`` by default.', "str", "best", []),
        ('str\n"lmi" by default.', "str", "best", ["a is 'best' by default, not 'lmi'"]),
        ('{"best", "lmi"}, default "best"', "str", "best", []),
        ('{"lmi", "full"}', "str", "best", ["a is 'best' by default, which is none of its choices"]),
        ('{"lmi"}, optional', "Literal['lmi', 'full'] | None", None, ["a has other choices than documented"]),
        ('{"lmi", "full"}', "Literal['lmi', 'full']", "lmi", []),
        ("number", "float", 1.0, []),
        ("Fraction or number", "Number", inspect.Parameter.empty, []),
        ("Fraction", "Number", inspect.Parameter.empty, ["a is float, its entry does not say so"]),
        ("path", "str | Path", inspect.Parameter.empty, []),
        ("sequence of int", "Sequence[int]", inspect.Parameter.empty, []),
        (
            "tuple of str",
            "np.ndarray",
            inspect.Parameter.empty,
            ["a is documented as str, not np.ndarray", "a is documented as tuple, not np.ndarray"],
        ),
        ("Gain", "Structure", inspect.Parameter.empty, ["a is Structure, its entry does not say so"]),
        ("Sliding", "Trajectory", inspect.Parameter.empty, ["a is Trajectory, its entry does not say so"]),
        ("optional", "Any", None, ["a has no type"]),
        ("array\nOf some (or many) numbers.", "Any", None, ["a is an array without a shape"]),
        ("(N, n + 1) array", "Any", None, []),
    ],
)
def test_an_entry_agrees_with_annotation_and_default(entry, annotation, default, wrong):
    parameter = inspect.Parameter("a", inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
    names = {"Number": Fraction | float}
    assert list(faults_of_entries({"a": entry}, {"a": parameter}, names)) == wrong


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        ("float\nMany times the clock, a unit.", ["T", "rate"]),
        ("float\nPositive, in units of time.", []),
        ("float\nPositive; 1/time.", []),
        ("float\n``T`` in units of time, ``rate`` as you like.", ["rate"]),
        ("float\n``T`` is positive; ``rate`` is dimensionless.", ["T"]),
        ("float\n``T`` in units of time, ``rate`` per unit of the clock.", []),
    ],
)
def test_the_unit_is_told_of_each_name(text, missing):
    assert list(faults_of_entries({"T": text, "rate": text}, {}, {})) == [f"{name} has no unit" for name in missing]


@pytest.mark.parametrize(
    ("text", "cites"),
    [
        *(("Lemma 3.2", True), ("equations (3)", True), ("Protocol (8)", True), ("the network\n(2)", True)),
        *(("(5) best", False), ("(1)", False), ("the best (1) of lemmas", False), ("f (2)", False)),
    ],
)
def test_a_number_in_parentheses_is_a_source_only_after_what_it_counts(text, cites):
    doc = f"Return one, {text}.\n\nExamples\n--------\n>>> 1\n1\n"
    assert ("no source" not in faults_of_parts("one", doc)) == cites


@pytest.mark.parametrize(
    ("references", "missing"),
    [("Horn and Johnson, Matrix Analysis, Cambridge 2013.", []), ("See there.", ["no source"])],
)
def test_a_reference_has_a_year(references, missing):
    doc = f"Return one.\n\nReferences\n----------\n{references}\n\nExamples\n--------\n>>> 1\n1\n"
    assert list(faults_of_parts("one", doc)) == missing


@pytest.mark.parametrize(
    ("title", "example", "missing"),
    [
        ("Examples", ">>> 1\n1", []),
        ("Examples", ">>> 1  # doctest: +SKIP\n1", ["no example that shows something"]),
    ],
)
def test_an_example_must_run(title, example, missing):
    doc = f"Return one (Lemma 1).\n\n{title}\n{'-' * len(title)}\n{example}\n"
    assert list(faults_of_parts("one", doc)) == missing


@pytest.mark.parametrize(("package", "name"), PUBLIC, ids=[f"{p.__name__}.{n}" for p, n in PUBLIC])
def test_every_public_name_tells_statement_parameters_units_errors_source_and_example(package, name):
    thing = getattr(package, name)
    if callable(thing):
        assert faults(name, thing) == []
    else:
        assert list(faults_of_constant(package, name)) == []


def test_examples_run_by_default(pytestconfig):
    assert pytestconfig.getoption("doctestmodules")
    assert {package.__name__ for package in (ptcc_certify, lmi)} <= set(pytestconfig.getini("testpaths"))


def test_exceptions_to_the_rule_are_public_names():
    assert set().union(*NO_SOURCE.values()) <= {name for _, name in PUBLIC}


# ---------------------------------------------------------------------- sections that are cited

THEORY = Path(ptcc_certify.__file__).parent.parent / "docs" / "theory"
CITED = re.compile(r'docs/theory/([\w-]+\.md), ((?:"[^"]+"(?:,| and)?\s+)*"[^"]+")')


@cache
def headings(page: str) -> frozenset[str]:
    return frozenset(re.findall(r"^#{1,4} (.+?)\s*$", (THEORY / page).read_text(encoding="utf-8"), re.MULTILINE))


def sections_cited(text: str) -> set[tuple[str, str]]:
    """Return the pages of the theory and the sections of each that a text cites, also across ends of lines."""
    text = re.sub(r"\n\s*(#:? )?\s*", " ", text)
    return {(page, name) for page, names in CITED.findall(text) for name in re.findall(r'"([^"]+)"', names)}


def test_sections_are_found_one_by_one_and_across_lines():
    text = 'docs/theory/rates.md, "One", "Two\n    words" and "Three". See "Four".'
    assert sections_cited(text) == {("rates.md", "One"), ("rates.md", "Two words"), ("rates.md", "Three")}


def test_every_section_of_the_theory_that_code_cites_is_there():
    sources = [p for room in ("ptcc_certify", "lmi") for p in (THEORY.parent.parent / room).rglob("*.py")]
    cited = {one for path in sources for one in sections_cited(path.read_text(encoding="utf-8"))}
    assert len(cited) > 10
    assert not sorted((page, name) for page, name in cited if name not in headings(page))


def test_the_page_of_claims_speaks_of_everything_that_the_paper_numbers():
    text = Path("docs/theory/claims.md").read_text(encoding="utf-8").partition("(claims-threshold)=")[0]
    counts = {"Theorem": 6, "Lemma": 9, "Corollar": 10, "Definition": 5, "Remark": 10, "Proposition": 1, "Example": 6}
    for word, most in counts.items():
        lists = re.findall(rf"{word}(?:s|y|ies)? ((?:\d+(?:, | to )?)+)", text)
        told = {k for text in lists for k in re.findall(r"\d+", text)}
        told |= {str(k) for a, b in re.findall(r"(\d+) to (\d+)", " ; ".join(lists)) for k in range(int(a), int(b))}
        assert {str(k) for k in range(1, most + 1)} <= told, word
