"""Mutants are small valid changes, and the tests of a line are those that execute it or use what it defines."""

import ast
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


def test_tests_of_a_line_are_those_that_execute_it_or_use_what_it_defines(tmp_path: Path) -> None:
    package = tmp_path / "sonarhw"
    package.mkdir()
    (package / "a.py").write_text("FACTOR = 2\n\n\n@compiled\ndef twice(x):\n    return FACTOR * x\n")
    (package / "b.py").write_text(
        "def four(x, y=2):\n    return y * twice(x)\n\n\ndef other():\n    return 3\n\n\nUNUSED = 4\n"
    )
    data = CoverageData(str(tmp_path / "unit.coverage"))
    for context, lines in {"": [1, 5], "tests/a.py::slow|run": [2], "tests/a.py::quick|run": [2, 6]}.items():
        data.set_context(context)
        data.add_lines({str(package / "b.py"): lines})
    data.write()
    (tmp_path / "unit.log").write_text("0.50s call     tests/a.py::slow\n0.01s call     tests/a.py::quick\n")
    covering = Covering(tmp_path, tmp_path, ["sonarhw/a.py", "sonarhw/b.py"])
    both = ["tests/a.py::quick", "tests/a.py::slow"]
    assert covering.tests("sonarhw/b.py", 2) == both
    assert covering.tests("sonarhw/b.py", 6) == both[:1]
    # a default of a parameter, a kernel, and a constant of the kernel
    assert covering.tests("sonarhw/b.py", 1) == both
    assert covering.tests("sonarhw/a.py", 6) == both
    assert covering.tests("sonarhw/a.py", 1) == both
    # a constant that only the tests use
    assert covering.tests("sonarhw/b.py", 9) == both
    assert covering.duration("tests/a.py::slow") == 0.5


def test_a_test_function_with_other_parameters_comes_later(tmp_path: Path) -> None:
    (tmp_path / "sonarhw").mkdir()
    (tmp_path / "sonarhw" / "a.py").write_text("x = f()\n")
    tests = ["tests/a.py::b[1]", "tests/a.py::b[2]", "tests/a.py::c"]
    data = CoverageData(str(tmp_path / "unit.coverage"))
    for test in tests:
        data.set_context(f"{test}|run")
        data.add_lines({str(tmp_path / "sonarhw" / "a.py"): [1]})
    data.write()
    (tmp_path / "unit.log").write_text("".join(f"0.{k}0s call     {test}\n" for k, test in enumerate(tests, 4)))
    found = Covering(tmp_path, tmp_path, ["sonarhw/a.py"]).tests("sonarhw/a.py", 1)
    assert found == ["tests/a.py::b[1]", "tests/a.py::c", "tests/a.py::b[2]"]


@pytest.mark.parametrize("direct", ["from sonarhw.a import x", "from sonarhw import Answer"])
def test_tests_that_name_a_module_or_a_class_come_first(direct: str, tmp_path: Path) -> None:
    (tmp_path / "sonarhw").mkdir()
    (tmp_path / "sonarhw" / "a.py").write_text("class Answer:\n    YES = 1\n")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_it.py").write_text(direct)
    data = CoverageData(str(tmp_path / "unit.coverage"))
    for test in ("tests/test_it.py::slow", "tests/test_other.py::quick"):
        data.set_context(f"{test}|run")
        data.add_lines({str(tmp_path / "sonarhw" / "a.py"): [2]})
    data.write()
    (tmp_path / "unit.log").write_text("0.2s call tests/test_it.py::slow\n0.1s call tests/test_other.py::quick\n")
    found = Covering(tmp_path, tmp_path, ["sonarhw/a.py"]).tests("sonarhw/a.py", 2)
    assert found == ["tests/test_it.py::slow", "tests/test_other.py::quick"]


def test_a_test_of_a_kernel_alone_is_among_its_tests_although_no_line_is_recorded(tmp_path: Path) -> None:
    (tmp_path / "sonarhw").mkdir()
    (tmp_path / "sonarhw" / "a.py").write_text(
        "@compiled\ndef twice(x):\n    return 2 * x\n\n\ndef two():\n    return 2\n"
    )
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_it.py").write_text("from sonarhw.a import twice, two")
    data = CoverageData(str(tmp_path / "unit.coverage"))
    data.set_context("tests/test_other.py::two|run")
    data.add_lines({str(tmp_path / "sonarhw" / "a.py"): [7]})
    data.write()
    (tmp_path / "unit.log").write_text("0.2s call tests/test_it.py::slow\n0.1s call tests/test_other.py::two\n")
    covering = Covering(tmp_path, tmp_path, ["sonarhw/a.py"])
    assert covering.tests("sonarhw/a.py", 3) == ["tests/test_it.py::slow", "tests/test_other.py::two"]
    assert covering.tests("sonarhw/a.py", 7) == ["tests/test_other.py::two"]


def test_a_function_with_a_cache_is_tested_by_all_that_use_it(tmp_path: Path) -> None:
    (tmp_path / "sonarhw").mkdir()
    (tmp_path / "sonarhw" / "a.py").write_text(
        "@lru_cache(maxsize=4)\ndef table():\n    return 2\n\n\ndef double():\n    return 2 * table()\n"
    )
    data = CoverageData(str(tmp_path / "unit.coverage"))
    for test, lines in {"tests/a.py::first": [3, 7], "tests/a.py::second": [7], "tests/a.py::other": [9]}.items():
        data.set_context(f"{test}|run")
        data.add_lines({str(tmp_path / "sonarhw" / "a.py"): lines})
    data.write()
    tests = Covering(tmp_path, tmp_path, ["sonarhw/a.py"]).tests("sonarhw/a.py", 3)
    assert set(tests[:2]) == {"tests/a.py::first", "tests/a.py::second"}


@pytest.mark.parametrize(("hits", "total"), [(0, 10), (85, 100), (300, 300)])
def test_the_interval_of_a_share_is_that_of_wilson(hits: int, total: int) -> None:
    expected = binomtest(hits, total).proportion_ci(0.95, method="wilson")
    assert wilson(hits, total) == pytest.approx((expected.low, expected.high), abs=1e-4)


def test_an_interrupted_run_continues_until_a_source_or_a_test_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, file = tmp_path / "a.py", tmp_path / "results.jsonl"
    source.write_text("x = 1 + 2\n")
    monkeypatch.setattr(driver, "SOURCES", {"sonarhw": [str(source)]})
    detected, survived, untried, *_ = mutants_of("a.py", source.read_bytes())
    Results(file).add(detected, False)
    Results(file).add(survived, True)
    assert [Results(file).get(mutant) for mutant in (detected, survived, untried)] == [False, True, None]
    source.write_text("x = 1 + 2 + 3\n")
    assert Results(file).get(detected) is None
