"""The proved checker in a browser: it answers to the letter as the executable does, of forgeries too."""

from __future__ import annotations

import json
import random
import re
import subprocess
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from mutations import mutants, resealed
from side_files import with_side_files
from verified import program

from ptcc_certify import Asks, NominalProtocol, certify, checker
from ptcc_certify.checker.reading import exact

FORMAL = Path(__file__).resolve().parents[2] / "formal"
PAGE = FORMAL / "browser" / "check.html"
CORPUS = FORMAL.parent / "tests" / "corpus"
#: Exit codes, by the class of the answer.
CODES = {"certified": 0, "rejected": 1, "unreadable": 2, "undecided": 4}


@pytest.fixture(scope="module")
def page(browser: Any) -> Any:
    if not PAGE.exists():
        pytest.skip("the page is not built: make -C formal browser/check.html")
    shown = browser.new_page()
    shown.goto(PAGE.as_uri())
    yield shown
    shown.close()


def answered(page: Any, file: Path) -> tuple[int, str]:
    """Return the exit code that the page's answer stands for, and the lines that it shows."""
    page.evaluate("document.getElementById('answer').className = 'before'")
    page.set_input_files("#files", str(file))
    page.wait_for_function(f"{list(CODES)}.includes(document.getElementById('answer').className)", timeout=60_000)
    kind = page.get_attribute("#answer", "class")
    shown = page.locator("#answer > pre:not(.stated)")
    return CODES[kind], shown.text_content() if shown.count() else ""


def told(file: Path) -> tuple[int, str]:
    """Return what the executable says, without the obligations that it verified."""
    run = subprocess.run([program(), "--obligations", file], capture_output=True, text=True, check=False)
    lines = (run.stdout + run.stderr).rstrip().split("\n")
    return run.returncode, "\n".join(line for line in lines if not line.startswith("verified "))


@pytest.mark.browser
def test_stored_certificates_are_answered_as_by_the_executable(page: Any) -> None:
    files = sorted(CORPUS.glob("*.json"))
    assert len(files) > 60
    one_of_each = {told(file)[0]: file for file in files}
    assert set(one_of_each) == {0, 2, 4}
    for file in {*files[::4], *one_of_each.values()}:
        assert answered(page, file) == told(file), file.name


@pytest.mark.browser
def test_forgeries_are_rejected_as_by_the_executable(page: Any, tmp_path: Path) -> None:
    rejected = 0
    for name in ("fig3a", "fig5a", "windows", "agents-sliding"):
        data = json.loads((CORPUS / f"{name}.json").read_text(encoding="utf-8"))
        every = [forged for _, forged in islice(mutants(data, 37), 400)]
        for number, forged in enumerate(random.Random(name).sample(every, 6)):
            file = tmp_path / f"{name}-{number}.json"
            file.write_text(json.dumps(resealed(forged)))
            code, text = answered(page, file)
            if not (code == 2 and "more room than this browser gives" in text):  # a browser has less of a stack
                assert (code, text) == told(file)
            rejected += code in (1, 2)
    assert rejected >= 15


@pytest.mark.browser
def test_the_answer_is_of_the_file_that_was_given_last(page: Any, tmp_path: Path) -> None:
    good, bad = CORPUS / "fig3a.json", tmp_path / "\u00e9\u4e2d b.json"
    data = json.loads(good.read_text(encoding="utf-8"))
    data["final_state"]["1"] = "9"
    bad.write_text(json.dumps(resealed(data)), encoding="utf-8")
    assert told(bad)[0] == 1 and answered(page, bad)[0] == 1
    assert bad.name in page.locator("#answer h2").text_content()
    page.evaluate("document.getElementById('answer').className = 'before'")
    page.set_input_files("#files", [str(good), str(bad)])
    page.wait_for_function("document.getElementById('answer').className === 'unreadable'")
    assert "one certificate at a time" in page.locator("#answer").text_content()
    contents = [good.read_text(encoding="utf-8"), bad.read_text(encoding="utf-8")]
    page.evaluate("([a, b]) => { check([new File([a], 'a.json')]); check([new File([b], 'b.json')]); }", contents)
    page.wait_for_function("document.getElementById('answer').className === 'rejected'", timeout=60_000)
    page.wait_for_timeout(1500)
    assert page.locator("#answer h2").text_content() == "Rejected: b.json"


@pytest.mark.browser
def test_side_files_are_read_and_asked_for_where_they_are_missing(page: Any, tmp_path: Path) -> None:
    data, sides = with_side_files(json.loads((CORPUS / "core.json").read_text(encoding="utf-8")))
    assert sides
    file = tmp_path / "c.json"
    file.write_text(json.dumps(data), encoding="utf-8")
    for name, content in sides.items():
        (tmp_path / name).write_bytes(content)
    code, text = answered(page, file)
    assert code == 2 and "side files are missing" in text and min(sides) in text
    page.evaluate("document.getElementById('answer').className = 'before'")
    page.set_input_files("#files", [str(file), *(str(tmp_path / name) for name in sides)])
    page.wait_for_function(f"{list(CODES)}.includes(document.getElementById('answer').className)", timeout=60_000)
    assert CODES[page.get_attribute("#answer", "class")] == told(file)[0]


@pytest.mark.browser
def test_what_is_no_certificate_is_told(page: Any, tmp_path: Path) -> None:
    for text in ("", "{", "[1]", '{"schema": "other"}', "\x00" * 100):
        file = tmp_path / "c.json"
        file.write_text(text)
        assert answered(page, file)[0] == 2
    file.write_text("a,b,1")
    code, text = answered(page, file)
    assert code == 2 and "this is no certificate" in text
    file.write_bytes(b"\xef\xbb\xbf" + (CORPUS / "fig3a.json").read_bytes())
    assert answered(page, file) == told(CORPUS / "fig3a.json")
    assert "claim      interval bipartite consensus (Theorem 2.1)" in page.text_content("#answer > .stated")


def test_integers_of_the_browser_are_what_they_should_be(tmp_path: Path) -> None:
    """Every primitive in Node.js on small, large and border numbers, against Python's integers."""
    node = subprocess.run(["node", "--version"], capture_output=True, check=False) if _has_node() else None
    if node is None or node.returncode:
        pytest.skip("no Node.js")
    source = (FORMAL / "browser" / "zarith.js").read_text(encoding="utf-8")
    rng = random.Random(1)
    numbers = [0, 1, -1, 2, 7, -12, 2**31 - 1, -(2**31), 2**31, -(2**31) - 1, 10**30 + 7, -(3**80)]
    numbers += [rng.randrange(-(2**bits), 2**bits) for bits in (8, 33, 64, 200) for _ in range(3)]
    pairs = [(x, y) for x in numbers for y in numbers]
    program_text = f"""
const raised = () => {{ throw new Error("raised"); }};
const caml_raise_zero_divide = raised, caml_invalid_argument = raised, caml_custom_ops = {{}};
{source}
const normal = (x) => ml_z_normal(BigInt(x)), told = [];
const fine = (z) => {{
  if ((typeof z === "number") !== (z >= -2147483648 && z <= 2147483647)) throw new Error("not normal: " + z);
  return String(z);
}};
for (const [p, q] of {json.dumps([[str(x), str(y)] for x, y in pairs])}) {{
  const x = normal(p), y = normal(q), row = [ml_z_add, ml_z_sub, ml_z_mul, ml_z_gcd].map((f) => fine(f(x, y)));
  row.push(...[ml_z_neg, ml_z_abs, ml_z_succ, ml_z_pred].map((f) => fine(f(x))));
  row.push(...[ml_z_compare(x, y), ml_z_equal(x, y), ml_z_sign(x), ml_z_numbits(x)].map(String));
  if (y != 0) row.push(...[ml_z_div, ml_z_rem, ml_z_fdiv, ml_z_cdiv].map((f) => fine(f(x, y))));
  if (x >= 0) row.push(fine(ml_z_sqrt(x)));
  row.push(fine(ml_z_pow(x, 5)), fine(ml_z_shift_left(x, 40)));
  told.push(row);
}}
console.log(JSON.stringify(told));
"""
    file = tmp_path / "try.js"
    file.write_text(program_text, encoding="utf-8")
    run = subprocess.run(["node", file], capture_output=True, text=True, check=True)
    for (x, y), row in zip(pairs, json.loads(run.stdout), strict=True):
        assert row == [str(number) for number in _expected(x, y)], (x, y)


def of_page(expression: str, folder: Path) -> Any:
    """Return what an expression gives with the functions of the page that need no browser, by Node.js."""
    if not _has_node():
        pytest.skip("no Node.js")
    source = (FORMAL / "browser" / "page.html").read_text(encoding="utf-8")
    functions = [re.search(rf"function {name}\(.*?\n}}\n", source, re.DOTALL) for name in ("stated", "certificateText")]
    file = folder / "page.js"
    text = "".join(found[0] for found in functions if found)
    file.write_text(f"{text}console.log(JSON.stringify({expression}))", encoding="utf-8")
    return json.loads(subprocess.run(["node", file], capture_output=True, text=True, check=True).stdout)


def test_the_page_tells_what_a_certificate_states_as_the_checker_in_python_does(tmp_path: Path) -> None:
    read = "JSON.parse(require('fs').readFileSync(path, 'utf8'))"
    files = [str(path) for path in sorted(CORPUS.glob("*.json"))]
    told = of_page(f"{json.dumps(files)}.map((path) => stated({read}))", tmp_path)
    kinds = set()
    for path, lines in zip(files, told, strict=True):
        own = checker.stated(json.loads(Path(path).read_text(encoding="utf-8")))
        assert 2 <= len(lines) <= 4
        for line, other in zip(lines, own, strict=True):
            rounded = " in [" in line
            assert line[:11] == other[:11] and (rounded or line == other), path
            assert not rounded or line[:1] != "x" or _holds(line, path), path
            kinds.add((line.split()[0], rounded))
    assert kinds == {("protocol", False), ("claim", False), ("x(T)", False), ("x(T)", True), ("beside", False)}


def _holds(line: str, path: str) -> bool:
    """Tell whether every interval of a line holds the final state of the file."""
    ends = json.loads(Path(path).read_text(encoding="utf-8"))["final_state"]
    told = re.findall(r"(\w+) in \[([-0-9.]+), ([-0-9.]+)\]", line)
    for label, low, high in told:
        end = ends[label]
        mid, radius = (exact(end), 0) if isinstance(end, str) else (exact(end["mid"]), exact(end["radius"]))
        if not Fraction(low) <= mid - radius <= mid + radius <= Fraction(high):
            return False
        if Fraction(high) - Fraction(low) - 2 * radius > Fraction(2, 10**6):
            return False
    return bool(told)


@pytest.mark.parametrize("node", ["constructor", "eve at 0, ann", "a\nclaim      stability", "\u202eb", "x" * 50])
def test_a_label_is_no_statement_of_the_page(node: str, tmp_path: Path) -> None:
    cert = certify([(node, "b", -1)], NominalProtocol(T="1." + "0" * 30 + "1", rho1=1), asks=Asks(simulation=False))
    other = certify([(node, "b", -1)], NominalProtocol(T=2, rho1=1), [3, 1], asks=Asks(simulation=False))
    for data in (cert.to_dict(), other.to_dict()):
        (lines,) = of_page(f"[{json.dumps(data)}].map(stated)", tmp_path)
        own = checker.stated(data)
        assert all("\n" not in line and line.isprintable() for line in (*lines, *own))
        assert lines[1:] == own[1:] and lines[0].startswith("protocol   nominal: T")
    assert "T in [1.000000, 1.000001]" in of_page(f"[{json.dumps(cert.to_dict())}].map(stated)", tmp_path)[0][0]


def test_the_page_takes_a_byte_order_mark_and_tells_what_is_no_json(tmp_path: Path) -> None:
    texts = [b'{"a": 1}', b'\xef\xbb\xbf{"a": 1}', b"\n {", b"a,b,1", b"", b"\xef\xbb\xbfa;b", b"PK\x03"]
    given = json.dumps([text.decode("latin-1") for text in texts])
    assert of_page(f"{given}.map(certificateText)", tmp_path) == [
        '{"a": 1}',
        '{"a": 1}',
        "\n {",
        None,
        None,
        None,
        None,
    ]


def _has_node() -> bool:
    from shutil import which

    return which("node") is not None


def _expected(x: int, y: int) -> list[int]:
    import math

    values = [x + y, x - y, x * y, math.gcd(x, y), -x, abs(x), x + 1, x - 1]
    values += [(x > y) - (x < y), int(x == y), (x > 0) - (x < 0), abs(x).bit_length()]
    if y:
        towards_0 = abs(x) // abs(y) * (1 if (x < 0) == (y < 0) else -1)
        values += [towards_0, x - towards_0 * y, x // y, -(-x // y)]
    if x >= 0:
        values.append(math.isqrt(x))
    return [*values, x**5, x << 40]
