"""Generated C files match their sources."""

import ctypes
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from tests.system.firmware.conftest import FIRMWARE


def test_generated_files_are_up_to_date() -> None:
    check = subprocess.run([sys.executable, FIRMWARE / "generate.py", "--check"], capture_output=True, text=True)
    assert check.returncode == 0, check.stderr


@given(some.binary(max_size=300))
def test_the_checksum_is_that_of_zlib(built: Path, data: bytes) -> None:
    crc_of = ctypes.CDLL(str(built / "libsonar.so")).crc_of
    crc_of.restype = ctypes.c_uint32
    assert ~crc_of(0xFFFFFFFF, data, len(data)) & 0xFFFFFFFF == zlib.crc32(data)


@pytest.mark.parametrize("celsius", [-20.0, 0.0, 20.0, 25.0, 45.0])
def test_the_thermistor_table_matches_the_beta_equation(built: Path, celsius: float) -> None:
    table = np.array((ctypes.c_int16 * 33).in_dll(ctypes.CDLL(str(built / "libsonar.so")), "thermistor_table"))
    resistance = np.exp(3950 * (1 / (celsius + 273.15) - 1 / 298.15))  # relative to that at 25 °C
    ratio = resistance / (1 + resistance)
    assert np.interp(ratio * 32, np.arange(33), table) == pytest.approx(celsius * 100, abs=30)
