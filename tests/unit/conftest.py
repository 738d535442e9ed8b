"""Unit tests start no process and open no socket, pseudo-terminal or window: each attempt fails with this message."""

import os
import socket
import subprocess
from collections.abc import Iterator
from typing import NoReturn

import pytest

FORBIDDEN = (
    (subprocess.Popen, "__init__"),
    (os, "fork"),
    (os, "posix_spawn"),
    (os, "openpty"),
    (socket.socket, "bind"),
    (socket.socket, "connect"),
)


class TooLarge(BaseException):
    """A unit test uses a process, a socket, a pseudo-terminal or a window. No `except Exception` catches it."""


def refuse(*_arguments: object, **_options: object) -> NoReturn:
    """Stand in for what a unit test must not call."""
    raise TooLarge("unit tests start no process and open no socket, pseudo-terminal or window: move it to tests/system")


@pytest.fixture(autouse=True, scope="module")
def nothing_outside_the_process() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for owner, name in FORBIDDEN:
            patch.setattr(owner, name, refuse, raising=False)  # Windows has no fork
        yield


@pytest.fixture(scope="session")
def qapp() -> None:
    """In place of pytest-qt's: `qtbot` needs it."""
    refuse()
