"""`sonarhw import` of raw traces in WAV, NPY, MAT and text files."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat, wavfile
from sonarhw_cli.app import run

from sonarhw.log import read_log
from sonarhw.readings import FloatArray
from tests.system.cli.importing.test_import_text import degrees


def pulses() -> FloatArray:
    """Three pings of 400 samples at 100 kHz, each with a decaying burst of 40 kHz, in 16 bits and in [-1, 1]."""
    times = np.arange(400) / 1e5
    signals = [np.where(times >= at, 0.7 * np.sin(math.tau * 4e4 * (times - at + 5e-6)), 0.0) for at in (1e-3, 2e-3)]
    return np.round(np.array([*signals, np.zeros(400)]) * 32767) / 32768


def raw_file(folder: Path, suffix: str) -> tuple[Path, list[str]]:
    """Write the pulses as a program of each kind does: SciPy for WAV and MAT, NumPy for NPY and text."""
    file, samples = folder / f"raw{suffix}", pulses()
    match suffix:
        case ".wav":
            wavfile.write(file, 100_000, (samples.T * 32768).astype(np.int16))
            return file, []
        case ".npy":
            np.save(file, (samples * 32768).astype(np.int16))
        case ".mat":
            savemat(file, {"echoes": samples, "rate": 1e5}, do_compression=True)
        case _:
            np.savetxt(file, samples, delimiter=",")
    return file, ["--rate", "100000"]


@pytest.mark.parametrize("suffix", [".wav", ".npy", ".mat", ".csv", ".txt"])
def test_raw_traces_are_readings_a_step_apart(tmp_path: Path, suffix: str) -> None:
    file, rate = raw_file(tmp_path, suffix)
    options = [*rate, "--step", "10", "--heading-zero", "45", "--turn", "cw", "--threshold", "0.2"]
    assert run(["import", str(file), "--out", str(tmp_path / "out.mcap"), *options]) == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([45, 35, 25], abs=1e-5)
    assert [one.echo_times for one in readings] == [
        (pytest.approx(1e-3, abs=1.1e-5),),
        (pytest.approx(2e-3, abs=1.1e-5),),
        (),
    ]
    for reading, samples in zip(readings, pulses(), strict=True):
        assert reading.trace.carrier
        assert reading.trace.rate == pytest.approx(100_000)
        assert reading.trace.samples == pytest.approx(samples, abs=1 / 127)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.zeros((2, 3, 4)), "an array of shape (2, 3, 4)"),
        (np.zeros((2, 70_000), np.int8), "traces of 70000 samples; expected 2 to 65535"),
        (np.array(["a", "b"]), "and type <U1; expected numbers"),
    ],
)
def test_an_array_of_another_shape_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], table: NDArray[np.generic], message: str
) -> None:
    np.save(tmp_path / "a.npy", table)
    command = ["import", str(tmp_path / "a.npy"), "--out", str(tmp_path / "out.mcap"), "--rate", "1e5"]
    assert run(command) == 2
    assert message in capsys.readouterr().err


def test_traces_without_a_threshold_name_the_options_that_find_their_echoes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "raw.npy"
    np.save(file, np.tile(pulses()[0], (8, 1)))
    assert run(["import", str(file), "--rate", "100000", "--step", "5", "--out", str(tmp_path / "out.mcap")]) == 0
    assert "they are traces; --threshold SHARE reads" in capsys.readouterr().err
