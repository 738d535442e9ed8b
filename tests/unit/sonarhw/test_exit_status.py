"""Each error ends a command with the exit status that the list of errors states."""

import re

import pytest

import sonarhw.errors
from sonarhw.errors import ExitStatus, SonarError

# of this package; the window has one more
LISTED = re.findall(r"── (\w+) (?!.*sonarhw_gui).* exit (\d+)$", str(sonarhw.errors.__doc__), flags=re.MULTILINE)


@pytest.mark.parametrize(("name", "status"), LISTED)
def test_an_error_has_the_listed_exit_status(name: str, status: str) -> None:
    assert getattr(sonarhw.errors, name).exit_status == int(status)


def test_every_error_is_listed() -> None:
    errors = {
        name for name, kind in vars(sonarhw.errors).items() if isinstance(kind, type) and issubclass(kind, SonarError)
    }
    listed = {name for name, _ in LISTED}
    assert errors - {"SonarError"} <= listed
    assert SonarError.exit_status == 1


def test_success_is_0_and_ctrl_c_is_130_as_in_a_shell() -> None:
    assert (ExitStatus.DONE, ExitStatus.INTERRUPTED) == (0, 130)
