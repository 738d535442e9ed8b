"""Fixtures of the firmware tests. They build the firmware first, which is quick if nothing has changed."""

import subprocess
from pathlib import Path

import pytest

from tests.checkout import CHECKOUT
from tests.system.firmware.portable import PortableBoard

FIRMWARE = CHECKOUT / "firmware"


@pytest.fixture(scope="session", autouse=True)
def built() -> Path:
    """The folder with up-to-date builds of firmware, emulator and the library of the portable part."""
    make = ["make", "-C", FIRMWARE, "WERROR=-Werror", "all", "emulator", "host"]
    made = subprocess.run(make, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return FIRMWARE / "build"


@pytest.fixture
def board(built: Path) -> PortableBoard:
    """The portable part on the test board, just switched on."""
    return PortableBoard(built / "libsonar.so")
