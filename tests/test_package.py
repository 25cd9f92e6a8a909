"""Facts about the package as a whole: what it exports, and under which names."""

import inspect
import json
import pickle
import pkgutil
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import ptcc_certify

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_every_export_is_there_and_stays_what_it_is():
    for name in ptcc_certify.__all__:
        assert getattr(ptcc_certify, name) == getattr(ptcc_certify, name)
        assert getattr(ptcc_certify, name).__doc__
    assert set(ptcc_certify.__all__) <= set(dir(ptcc_certify))


def test_a_function_at_the_top_keeps_its_signature_and_is_pickled_by_its_name():
    from ptcc_certify.certificate.certification import certify

    assert inspect.signature(ptcc_certify.certify) == inspect.signature(inspect.unwrap(certify))
    assert pickle.loads(pickle.dumps(ptcc_certify.certify)) is ptcc_certify.certify  # noqa: S301 - our own


def test_the_docstring_lists_every_name_at_the_top_and_there_are_few():
    listed = re.findall(r"``(\w+)``", ptcc_certify.__doc__)
    assert sorted(listed) == sorted(set(ptcc_certify.__all__) - {"__version__"})
    assert len(listed) <= 71


def test_rooms_are_loaded_when_they_are_named():
    code = (
        "import sys, ptcc_certify as ptcc; before = 'numpy' in sys.modules; ptcc.theorems.lemmas.gauge; print(before)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"
    assert ptcc_certify.bounds.input.effort.Effort and issubclass(ptcc_certify.errors.GraphError, ValueError)
    with pytest.raises(AttributeError, match="nothing"):
        _ = ptcc_certify.bounds.nothing
    for name in ("a.b", "errors.GraphError", "graphs.digraph", "a b", "", "\0"):
        assert not hasattr(ptcc_certify, name) and not hasattr(ptcc_certify.graphs, name), name


def test_where_a_package_is_missing_a_name_at_the_top_tells_how_to_install_it():
    """As where only the checker was installed, without dependencies."""
    root = str(Path(ptcc_certify.__file__).parents[1])
    code = f"import sys; sys.path.insert(0, {root!r}); import ptcc_certify; ptcc_certify.read_graph"
    run = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True)
    last = run.stderr.splitlines()[-1]
    assert last.startswith("ModuleNotFoundError: ptcc_certify.read_graph needs numpy; install"), run.stderr
    assert "During handling" not in run.stderr


def test_no_module_bears_the_name_of_an_export():
    """Importing such a module would put it in the place of what is exported."""
    modules = {module.name for module in pkgutil.iter_modules(ptcc_certify.__path__)}
    assert {"graphs", "bounds", "simulation"} <= modules
    assert not modules & set(ptcc_certify.__all__)


# ---------------------------------------------------------------------- what a release needs


@pytest.mark.parametrize(
    ("file", "where"),
    [
        ("CITATION.cff", r"^version: (.+)$"),
        ("CHANGELOG.md", r"\A# Changelog\n\n## (.+)$"),
        ("conda/meta.yaml", r'^\{% set version = "(.+)" %\}$'),
        ("docs/how-to/install.md", r"ptcc_certify-(.+?)-py3-none-any\.whl"),
    ],
)
def test_the_version_is_that_of_pyproject_wherever_it_stands(file: str, where: str):
    text = (ROOT / file).read_text(encoding="utf-8")
    assert re.findall(where, text, re.MULTILINE) == [PROJECT["version"]]


def test_the_conda_recipe_asks_for_what_pyproject_asks_for():
    recipe = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    run = re.search(r"^  run:\n((?:    - .+\n)+)", recipe, re.MULTILINE)[1]
    listed = [line.removeprefix("    - ").replace("matplotlib-base", "matplotlib") for line in run.splitlines()]
    asked = [f"python {PROJECT['requires-python']}", *(one.replace(">=", " >=") for one in PROJECT["dependencies"])]
    python_min = re.search(r'python_min = "(.+)"', recipe)[1]
    assert [line.replace("{{ python_min }}", python_min) for line in listed] == asked
    assert all(f"{name} = {call}" in recipe for name, call in PROJECT["scripts"].items())


def test_an_archive_of_a_release_is_described_as_the_citation_describes_the_program():
    archive = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f'title: "{archive["title"]}"' in citation and f"license: {archive['license']}\n" in citation
    assert re.findall(r"^  - (?!name|type)(.+)$", citation, re.MULTILINE) == archive["keywords"]
    assert re.findall(r"^  - name: (.+)$", citation, re.MULTILINE) == [one["name"] for one in archive["creators"]]
    abstract = " ".join(re.search(r"^abstract: >-\n((?:  .+\n)+)", citation, re.MULTILINE)[1].split())
    assert archive["description"] == f"<p>{abstract}</p>"
