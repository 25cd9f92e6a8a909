"""Facts about the documentation: what every public name tells, compared with what the name is."""

import ast
import builtins
import dataclasses
import doctest
import inspect
import re
import textwrap
from collections.abc import Iterable, Iterator
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest

import lmi
import ptcc_certify

PUBLIC = [(package, name) for package in (ptcc_certify, lmi) for name in package.__all__]
ROOTS = {"ptcc_certify", "lmi", __name__.split(".")[0]}


def of_modules(*modules: str) -> set[str]:
    """Return the public names that these modules define."""
    return {name for name, module in ptcc_certify._EXPORTS.items() if module in modules}


#: Names that cite nothing, and why.
NO_SOURCE = {
    "errors state what is wrong with an input, not mathematics": {
        *(name for name in ptcc_certify.__all__ if name.endswith("Error")),
        *("LMIError", "MatrixError", "NoCertificate", "NotAnHMatrix", "NotAnMMatrix"),
    },
    "files and numbers are converted": {"read_graph", "write_graph", "read_state", "dyadic_integers", "round_to_bits"},
    "figures, pages and tables show what was computed elsewhere": of_modules("plots", "report", "explorer", "batch"),
    "certificates that are read back state what was proved before": of_modules("saved"),
    "sets of starts are what their definition says": {"Starts", "starts_within", "box", "ellipsoid"},
    "disturbances and random graphs are data": {
        *("ExpressionDisturbance", "SampledDisturbance", "StateDependent", "telegraph_noise"),
        *of_modules("ensembles"),
    },
    "the check names the lemma of each step in its report": {"check", "CheckReport"},
}

SECTIONS = {"Summary", "Parameters", "Attributes", "Returns", "Raises", "Warns", "Notes", "References", "Examples"}
#: Quantities of time, rate or input: their entry tells the unit.
DIMENSIONED = {
    *("T", "T_r", "T_s", "deadline", "t", "at", "times", "until", "sample_period", "stop_before"),
    *("rho1", "mu1", "mu2", "delta", "gain_cap", "rate", "rates", "numerical_rate", "spectral_rate"),
}
UNIT = re.compile(r"\b(units?|times?|clock|dimensionless)\b", re.IGNORECASE)
NUMBERED = r"(Theorem|Lemma|Corollar(y|ie)|Definition|Proposition|Example|Section|Remark)s?"
CITATION = re.compile(rf"\b{NUMBERED} ([0-9]|[IVX]+\b)|(?<![\w)])\([0-9]{{1,2}}\)")


def sections(doc: str) -> dict[str, str]:
    """Cut a docstring into its numpydoc sections; what comes before the first is the summary."""
    lines, title = doc.splitlines(), "Summary"
    found: dict[str, list[str]] = {title: []}
    for line, after in zip(lines, [*lines[1:], ""], strict=True):
        if after and after == "-" * len(line):
            title = line
            found[title] = []
        elif not line or line != "-" * len(line):
            found[title].append(line)
    return {title: "\n".join(body).strip("\n") for title, body in found.items()}


def entries(body: str) -> dict[str, str]:
    """Return the names that a section documents: the type on the first line of each text, then the description."""
    found: dict[str, str] = {}
    names: list[str] = []
    for line in body.splitlines():
        if line and not line.startswith(" "):
            head, _, kind = line.partition(" : ")
            names = [name.strip().lstrip("*") for name in head.split(",")]
            found |= dict.fromkeys(names, kind.strip())
        else:
            found |= {name: f"{found[name]}\n{line.strip()}" for name in names}
    return found


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


def plain(member: Any) -> Any:
    """Return the function behind a method, property or cached property."""
    if isinstance(member, classmethod | staticmethod):
        return member.__func__
    if isinstance(member, property):
        return member.fget
    return member.func if isinstance(member, cached_property) else member


def own_docs(cls: type, name: str | None = None) -> list[str]:
    """Return the docstrings that a class (or a member) has itself and from those it inherits from."""
    places = [vars(base).get(name) if name else base for base in cls.__mro__ if base.__module__.split(".")[0] in ROOTS]
    docs = [
        vars(place).get("__doc__") if isinstance(place, type) else plain(place).__doc__ for place in places if place
    ]
    return [inspect.cleandoc(doc) for doc in docs if doc]


def faults_of_entries(documented: dict[str, str]) -> Iterator[str]:
    """Find entries that lack a type, arrays without a shape, and quantities without a unit."""
    for name, text in documented.items():
        kind = text.split("\n")[0]
        if not kind:
            yield f"{name} has no type"
        if re.search(r"\barrays?\b", kind) and not re.search(r"\(.*\)|\bshapes?\b", text):
            yield f"{name} is an array without a shape"
        if name in DIMENSIONED and not UNIT.search(text):
            yield f"{name} has no unit"


def is_error(name: str) -> bool:
    """Tell whether a name is a public or built-in exception, or one of another package with its full name."""
    places: list[Any] = [ptcc_certify, lmi, builtins]
    if "." in name:
        module, _, name = name.rpartition(".")
        places = [import_module(module)]
    found = [getattr(place, name) for place in places if hasattr(place, name)]
    return any(isinstance(kind, type) and issubclass(kind, Exception) for kind in found)


def faults_of_parts(name: str, found: dict[str, str]) -> Iterator[str]:
    """Find what every name owes: a first sentence, an example that runs, a source, errors that exist."""
    yield from (f"unknown section {title}" for title in found if title not in SECTIONS)
    if not re.match(r"[A-Z`]", found["Summary"]) or not re.search(r"[.:](\s|$)", found["Summary"]):
        yield "no first sentence"
    examples = doctest.DocTestParser().get_examples(found.get("Examples", ""))
    if not any(one.want and not one.options.get(doctest.SKIP) for one in examples):
        yield "no example that shows something"
    elsewhere = "\n".join(body for title, body in found.items() if title != "Examples")
    exempt = any(name in names for names in NO_SOURCE.values())
    if not exempt and not found.get("References") and not CITATION.search(elsewhere):
        yield "no source"
    errors = [line.strip() for line in found.get("Raises", "").splitlines() if line and not line.startswith(" ")]
    yield from (f"{error} is no public exception" for error in errors if not is_error(error))


def faults_of_names(documented: Iterable[str], there: Iterable[str], what: str) -> Iterator[str]:
    """Compare the documented names with those that are there, both ways."""
    yield from (f"{what} {name} is not documented" for name in there if name not in documented)
    yield from (f"documented {name} is no {what}" for name in documented if name not in there)


def faults_of_function(function: Any, found: dict[str, str]) -> Iterator[str]:
    """Compare a function's sections with its signature and its source."""
    documented = entries(found.get("Parameters", ""))
    yield from faults_of_names(documented, parameters(function), "parameter")
    yield from faults_of_entries(documented)
    if "Returns" not in found and inspect.signature(function).return_annotation not in (None, "None"):
        yield "no Returns"
    if "Raises" not in found and raises(function):
        yield "no Raises"
    if f"{function.__name__}(" not in found.get("Examples", ""):
        yield "its example does not call it"


def faults_of_class(cls: type, found: dict[str, str]) -> Iterator[str]:
    """Compare a class's sections with its fields, its constructor and its public members."""
    own = entries(found.get("Attributes", "")) | entries(found.get("Parameters", ""))
    yield from faults_of_entries(own)
    documented = set(own)
    for doc in own_docs(cls)[1:]:
        documented |= set(entries(sections(doc).get("Attributes", "")))
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
    if "Raises" not in found and any(map(raises, makers)):
        yield "no Raises"
    for name in dir(cls):
        member = inspect.getattr_static(cls, name)
        if not name.startswith("_") and ours(plain(member)):
            yield from (f"{name}: {fault}" for fault in faults_of_member(member, own_docs(cls, name)))


def faults_of_member(member: Any, docs: list[str]) -> Iterator[str]:
    """Compare a method or property with its docstring and those of what it overrides."""
    if not docs or not re.search(r"[.:](\s|$)", docs[0]):
        yield "no docstring of one sentence"
        return
    found = [sections(doc) for doc in docs]
    documented = entries(found[0].get("Parameters", ""))
    yield from faults_of_entries(documented)
    yield from (f"unknown section {title}" for title in found[0] if title not in SECTIONS)
    if raises(plain(member)) and not any("Raises" in one for one in found):
        yield "no Raises"
    if not isinstance(member, property | cached_property):
        there = parameters(plain(member))
        yield from (f"{name} is not named" for name in there if not re.search(rf"\b{name}\b", "\n".join(docs)))
        yield from (f"documented {name} is no parameter" for name in documented if name not in there)


def faults_of_constant(package: Any, name: str) -> Iterator[str]:
    """Ask for a comment ``#:`` above a constant where it is defined."""
    source = Path(inspect.getfile(import_module(f"{package.__name__}.{package._EXPORTS[name]}"))).read_text("utf-8")
    if not re.search(rf"^#: .*\n([\w, ]+, )?{name}\b.* = ", source, re.MULTILINE):
        yield "a constant without a comment #: above it"


def faults(name: str, thing: Any) -> list[str]:
    """Return everything that the documentation of a public class or function lacks."""
    doc = vars(thing).get("__doc__") if isinstance(thing, type) else thing.__doc__
    if not doc:
        return ["no docstring"]
    found = sections(inspect.cleandoc(doc))
    kind = faults_of_class if isinstance(thing, type) else faults_of_function
    return [*faults_of_parts(name, found), *kind(thing, found)]


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
        *("documented y is no parameter", "y has no type", "x is an array without a shape", "rate has no unit"),
        *("no Returns", "its example does not call it"),
    }
    assert set(faults("Poor", Poor)) == {
        *("no source", "no example that shows something", "field b is not documented", "documented c is no field"),
        *("no Raises", "unsaid: no docstring of one sentence"),
        *("scaled: factor is not named", "scaled: documented share is no parameter", "scaled: no Raises"),
    }
    assert faults("silent", lambda: None) == ["no docstring"]
    assert list(faults_of_constant(ptcc_certify, "PTCCError")) == ["a constant without a comment #: above it"]


@pytest.mark.parametrize(
    ("title", "example", "missing"),
    [
        ("Examples", ">>> 1\n1", []),
        ("Examples", ">>> 1  # doctest: +SKIP\n1", ["no example that shows something"]),
        ("Example", ">>> 1\n1", ["unknown section Example", "no example that shows something"]),
    ],
)
def test_an_example_must_run_and_its_section_be_spelt_right(title, example, missing):
    doc = f"Return one (Lemma 1).\n\n{title}\n{'-' * len(title)}\n{example}\n"
    assert list(faults_of_parts("one", sections(doc))) == missing


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
