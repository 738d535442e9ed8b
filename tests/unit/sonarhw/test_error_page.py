"""docs/reference/errors.md describes every error, with its exit status and what to do."""

import inspect

import pytest
from sonarhw_cli.entry import INTERRUPTED

from sonarhw import errors
from sonarhw.errors import ExitStatus, SonarError
from tests.reference_pages import section

CLASSES = [error for _, error in inspect.getmembers(errors, inspect.isclass) if issubclass(error, SonarError)]


def test_the_table_of_exit_statuses_is_that_of_the_program() -> None:
    rows = section("command_line.md", "## Exit status").splitlines()
    documented = [tuple(cell.strip() for cell in row.split("|")[1:3]) for row in rows if row.startswith("| ")]
    assert documented[1:] == [(str(status.value), f"`{status.name}`") for status in ExitStatus]
    assert INTERRUPTED == ExitStatus.INTERRUPTED


@pytest.mark.parametrize("error", CLASSES, ids=lambda error: error.__name__)
def test_each_error_is_described_with_its_status_and_what_to_do(error: type[SonarError]) -> None:
    text = section("errors.md", f"## {error.__name__}\n")
    assert f"Exit status {error.exit_status.value}" in text
    base = error.__base__
    assert base is not None
    assert base in (Exception, SonarError) or f"a kind of {base.__name__}" in text
    assert "**What to do:**" in text
