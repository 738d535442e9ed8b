"""Errors: their page, their exit statuses, and texts that nothing in a file or a device can spoil."""

import inspect
import json
import math
import re
import unicodedata

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import characters, text
from sonarhw_cli.entry import INTERRUPTED
from sonarhw_cli.options import print_json

from sonarhw import errors
from sonarhw.errors import ExitStatus, SonarError, harmless, json_text, shortened, text_cell
from tests.reference_pages import section

CLASSES = [error for _, error in inspect.getmembers(errors, inspect.isclass) if issubclass(error, SonarError)]
# of this package; the window has one more
LISTED = re.findall(r"── (\w+) (?!.*sonarhw_gui).* exit (\d+)$", str(errors.__doc__), flags=re.MULTILINE)


def test_the_table_of_exit_statuses_is_that_of_the_program() -> None:
    rows = section("command_line.md", "## Exit status").splitlines()
    documented = [tuple(cell.strip() for cell in row.split("|")[1:3]) for row in rows if row.startswith("| ")]
    assert documented[1:] == [(str(status.value), f"`{status.name}`") for status in ExitStatus]
    assert (ExitStatus.DONE, ExitStatus.INTERRUPTED, INTERRUPTED) == (0, 130, 130)


def test_each_error_is_listed_with_its_exit_status() -> None:
    assert {error.__name__: str(error.exit_status.value) for error in CLASSES} == {"SonarError": "1", **dict(LISTED)}


@pytest.mark.parametrize("error", CLASSES, ids=lambda error: error.__name__)
def test_each_error_is_described_with_its_status_and_what_to_do(error: type[SonarError]) -> None:
    described = section("errors.md", f"## {error.__name__}\n")
    assert f"Exit status {error.exit_status.value}" in described
    base = error.__base__
    assert base in (Exception, SonarError) or f"a kind of {base.__name__}" in described
    assert "**What to do:**" in described


@given(text(characters(exclude_categories=())))
def test_any_text_becomes_printable_and_encodable(raw: str) -> None:
    shown = harmless(raw)
    assert not {"Cc", "Cf", "Cs", "Zl", "Zp"} & {unicodedata.category(character) for character in shown}
    shown.encode()
    assert len(shown.splitlines()) <= 1
    assert harmless(shown) == shown


def test_of_a_long_text_the_begin_and_the_end_are_kept() -> None:
    cut = shortened("begin " + 5000 * "x" + " end", 60)
    assert len(cut) == 60
    assert cut.startswith("begin xxx")
    assert cut.endswith("xxx end")
    assert cut.count("…") == 1
    assert shortened(60 * "x", 60) == 60 * "x"


@pytest.mark.parametrize(
    ("name", "cell"),
    [
        *(
            (formula, f"'{formula}")
            for formula in ("=1+1", "+1+1", "-2+3", "@SUM(A1)", '=HYPERLINK("http://x")', "＝1", "-")
        ),
        *((name, name) for name in ("wall 1>post 2", "-1.5", "+3", "-1e-3", "", "a=b", "3-4")),
        *(("\t=1", r"\t=1"), ("\r=1", r"\r=1"), ("a\x1b[2J", r"a\x1b[2J")),
    ],
)
def test_in_a_cell_a_formula_is_quoted_and_a_control_character_escaped(name: str, cell: str) -> None:
    assert text_cell(name) == cell


FIGURES = {
    "deviation": math.inf,
    "low": -math.inf,
    "correlations": np.array([[1.0, np.nan], [np.nan, 1.0]]).tolist(),
    "pair": (np.float64(np.inf), 2),
    "inside": [{"level_db": -math.inf, "name": "NaN", "count": 3, "fits": True, "place": None}],
}
WRITTEN = {
    "deviation": None,
    "low": None,
    "correlations": [[1.0, None], [None, 1.0]],
    "pair": [None, 2],
    "inside": [{"level_db": None, "name": "NaN", "count": 3, "fits": True, "place": None}],
}


def refuse(constant: str) -> None:
    raise AssertionError(constant)


def test_values_that_json_does_not_have_become_null(capsys: pytest.CaptureFixture[str]) -> None:
    assert json.loads(json_text(FIGURES), parse_constant=refuse) == WRITTEN
    print_json(FIGURES)
    assert json.loads(capsys.readouterr().out, parse_constant=refuse) == WRITTEN
