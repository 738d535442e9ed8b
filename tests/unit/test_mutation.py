"""Mutants are small valid changes, and the tests of a line are those that execute it or use what it defines."""

import ast
import re
from pathlib import Path

import pytest
from coverage import CoverageData
from scipy.stats import binomtest

from tests.mutation import __main__ as driver
from tests.mutation.__main__ import Results, wilson
from tests.mutation.covering import Covering
from tests.mutation.equivalents import key_of, known
from tests.mutation.mutants import mutants_of

SOURCE = '''"""Text."""

LIMIT = 2.0  # é


def below(values: list[int | float], most: float = LIMIT) -> bool:
    """Return whether all are small."""
    if not values:
        raise ValueError(f"{len(values) + 1} values")
    show(values, lw=2)
    axes.plot(1)
    note(axes, 2)
    return all(-most <= value + 1 for value in values)
'''.encode()


def test_every_operator_constant_and_result_is_changed_once() -> None:
    changes = [(mutant.line, mutant.before, mutant.after) for mutant in mutants_of("a.py", SOURCE)]
    assert changes == [
        (3, "2.0", "(3.0)"),
        (8, "not values", "(values)"),
        (10, "show(values, lw=2)", "pass"),
        (13, "return all(-most <= value + 1 for value in values)", "return None"),
        (13, "all(-most <= value + 1 for value in values)", "(any((-most <= value + 1 for value in values)))"),
        (13, "-most <= value + 1", "(-most < value + 1)"),
        (13, "-most <= value + 1", "(-most > value + 1)"),
        (13, "-most", "(most)"),
        (13, "value + 1", "(value - 1)"),
        (13, "1", "(0)"),
        (13, "1", "(2)"),
    ]


def test_a_bound_is_changed_at_equality_only_if_equality_can_occur() -> None:
    source = b"LIMIT = 2.0\ndef f(x, n):\n    return x < LIMIT or x / n < n or n < 2 or x > 0.0\n"
    after = {mutant.after for mutant in mutants_of("a.py", source)}
    assert {"(n <= 2)", "(x >= 0.0)", "(x >= LIMIT)", "(x / n >= n)"} <= after
    assert not after & {"(x <= LIMIT)", "(x / n <= n)"}


@pytest.mark.parametrize(
    ("source", "after"),
    [
        ("def f():\n    return True\n", ["(False)"]),
        # large numbers change much, and tolerances for rounding errors not at all
        ("A = 9\nB = 10\nC = 0.5\nD = 1e-9\nE = 2e-9\n", ["(10)", "(8)", "(15)", "(0.75)", "(3.0000000000000004e-09)"]),
        # sizes of a picture are not changed, but its data are; neither are seeds
        ("def draw(axes: Axes, x):\n    show(axes, 3)\n    axes.plot(x)\n    y = x[0] + 2, -3\n", ["(x[0] - 2)"]),
        ("a = f(seed + 1)\nb = seed + n\nc = g(4)\n", ["(3)", "(5)"]),
    ],
)
def test_changes_without_an_effect_are_left_out(source: str, after: list[str]) -> None:
    assert [mutant.after for mutant in mutants_of("a.py", source.encode())] == after


def test_every_known_equivalent_is_a_mutant_of_the_present_source() -> None:
    paths = {path for path, _, _ in known()}
    assert known() <= {key_of(mutant) for path in paths for mutant in mutants_of(path, Path(path).read_bytes())}


def test_a_mutant_differs_from_the_source_in_one_place_only() -> None:
    (first, *_) = mutants_of("a.py", SOURCE)
    assert first.applied(SOURCE) == SOURCE.replace(b"2.0", b"(3.0)")
    assert str(first) == "a.py:3: 2.0  →  (3.0)"


@pytest.mark.parametrize("path", ["sonarhw/wire/frames.py", "sim/sonarhw_sim/air.py", "tests/mutation/mutants.py"])
def test_mutants_of_real_sources_are_valid_and_no_two_are_the_same(path: str) -> None:
    source = Path(path).read_bytes()
    mutants = mutants_of(path, source)
    assert len({mutant.applied(source) for mutant in mutants}) == len(mutants) > 20
    for mutant in mutants[::7]:
        assert ast.dump(ast.parse(mutant.applied(source))) != ast.dump(ast.parse(source))


def covering(folder: Path, files: dict[str, str], executed: dict[str, dict[str, list[int]]], log: str = "") -> Covering:
    """Return the tests of these files in package `sonarhw`. `executed` has the lines by file and test."""
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    data = CoverageData(str(folder / "unit.coverage"))
    for name, tests in executed.items():
        for test, lines in tests.items():
            data.set_context(f"tests/{test}|run" if test else "")
            data.add_lines({str(folder / name): lines})
    data.write()
    (folder / "unit.log").write_text(re.sub(r"(\S+s) (\S+)\n", r"\1 call     tests/\2\n", log))
    return Covering(folder, folder, [name for name in files if name.startswith("sonarhw")])


def test_tests_of_a_line_are_those_that_execute_it_or_use_what_it_defines(tmp_path: Path) -> None:
    files = {
        "sonarhw/a.py": "FACTOR = 2\n\n\n@compiled\ndef twice(x):\n    return FACTOR * x\n",
        "sonarhw/b.py": "def four(x, y=2):\n    return y * twice(x)\n\n\ndef other():\n    return 3\n\n\nUNUSED = 4\n",
    }
    executed = {"sonarhw/b.py": {"": [1, 5], "a.py::slow": [2], "a.py::quick": [2, 6]}}
    found = covering(tmp_path, files, executed, "0.50s a.py::slow\n0.01s a.py::quick\n")
    both = ["tests/a.py::quick", "tests/a.py::slow"]
    # a default of a parameter, a kernel, a constant of the kernel, and one that only the tests use
    for file, line in (("b", 2), ("b", 1), ("a", 6), ("a", 1), ("b", 9)):
        assert found.tests(f"sonarhw/{file}.py", line) == both
    assert found.tests("sonarhw/b.py", 6) == both[:1]
    assert found.duration("tests/a.py::slow") == 0.5


@pytest.mark.parametrize(
    ("files", "executed", "log", "line", "tests"),
    [
        # other parameters of a test function come later
        (
            {"sonarhw/a.py": "x = f()\n"},
            {"a.py::b[1]": [1], "a.py::b[2]": [1], "a.py::c": [1]},
            "0.4s a.py::b[1]\n0.5s a.py::b[2]\n0.6s a.py::c\n",
            1,
            ["a.py::b[1]", "a.py::c", "a.py::b[2]"],
        ),
        # tests that name a module or a class come first
        *(
            (
                {"sonarhw/a.py": "class Answer:\n    YES = 1\n", "tests/test_it.py": direct},
                {"test_it.py::slow": [2], "test_other.py::quick": [2]},
                "0.2s test_it.py::slow\n0.1s test_other.py::quick\n",
                2,
                ["test_it.py::slow", "test_other.py::quick"],
            )
            for direct in ("from sonarhw.a import x", "from sonarhw import Answer")
        ),
        # no line of a kernel is recorded
        *(
            (
                {
                    "sonarhw/a.py": "@compiled\ndef twice(x):\n    return 2 * x\n\n\ndef two():\n    return 2\n",
                    "tests/test_it.py": "from sonarhw.a import twice, two",
                },
                {"test_other.py::two": [7]},
                "0.2s test_it.py::slow\n0.1s test_other.py::two\n",
                line,
                [*of_kernel, "test_other.py::two"],
            )
            for line, of_kernel in ((3, ["test_it.py::slow"]), (7, []))
        ),
        # a function with a cache is tested by all that use it
        (
            {"sonarhw/a.py": "@lru_cache()\ndef table():\n    return 2\n\n\ndef double():\n    return 2 * table()\n"},
            {"a.py::first": [3, 7], "a.py::second": [7], "a.py::other": [9]},
            "0.1s a.py::first\n0.2s a.py::second\n0.3s a.py::other\n",
            3,
            ["a.py::first", "a.py::second", "a.py::other"],
        ),
    ],
)
def test_the_tests_that_may_detect_a_mutant_come_first(
    files: dict[str, str], executed: dict[str, list[int]], log: str, line: int, tests: list[str], tmp_path: Path
) -> None:
    found = covering(tmp_path, files, {"sonarhw/a.py": executed}, log).tests("sonarhw/a.py", line)
    assert found == [f"tests/{test}" for test in tests]


@pytest.mark.parametrize(("hits", "total"), [(0, 10), (85, 100), (300, 300)])
def test_the_interval_of_a_share_is_that_of_wilson(hits: int, total: int) -> None:
    expected = binomtest(hits, total).proportion_ci(0.95, method="wilson")
    assert wilson(hits, total) == pytest.approx((expected.low, expected.high), abs=1e-4)


def test_an_interrupted_run_continues(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source, file = tmp_path / "a.py", tmp_path / "results.jsonl"
    source.write_text("x = 1 + 2\n")
    monkeypatch.setattr(driver, "SOURCES", {"sonarhw": [str(source)]})
    detected, survived, untried, *_ = mutants_of("a.py", source.read_bytes())
    Results(file).add(detected, False)
    Results(file).add(survived, True)
    assert [Results(file).get(mutant) for mutant in (detected, survived, untried)] == [False, True, None]
    source.write_text("x = 1 + 2 + 3\n")
    assert Results(file).get(detected) is None
