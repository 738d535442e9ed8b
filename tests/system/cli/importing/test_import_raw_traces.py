"""`sonarhw import` of raw traces in WAV, NPY, MAT and text files, and of columns of ranges in arrays."""

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat, wavfile
from sonarhw_cli.app import run
from sonarhw_compare.imports import ImportOptions, import_scan

from sonarhw.errors import InputError
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


def test_traces_without_a_threshold_name_the_options(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "raw.npy"
    np.save(file, np.tile(pulses()[0], (8, 1)))
    assert run(["import", str(file), "--rate", "100000", "--step", "5", "--out", str(tmp_path / "out.mcap")]) == 0
    assert "they are traces; --threshold SHARE reads" in capsys.readouterr().err


@pytest.mark.parametrize("seed", range(3))
def test_the_rate_of_an_array_is_asked_for_whatever_its_bytes_are(seed: int, tmp_path: Path) -> None:
    file = tmp_path / "scan.npz"
    np.savez(file, x=np.random.default_rng(seed).random((2, 400)))
    with pytest.raises(InputError, match="rate="):
        import_scan(file)


FAR = np.where(np.arange(36) == 7, np.nan, 0.8 + 0.3 * np.cos(np.arange(36) / 3))  # m; NaN is no echo


def _arrays(file: Path, form: str) -> None:
    """Write angles and ranges, one of which is NaN, as other programs save them."""
    degrees, ranges = np.arange(0.0, 180.0, 5.0), FAR
    match form:
        case "names.npz":
            np.savez(file, angle_deg=degrees, range_m=ranges, setting={"by": "hand"}, gain=3.0, id=["a"] * 36)
        case "radians.npz":
            np.savez(file, theta_rad=np.radians(degrees), range_cm=100 * ranges)
        case "records.npy":
            of_both = [("angle_deg", float), ("distance_mm", float)]
            np.save(file, np.array([*zip(degrees, 1e3 * ranges, strict=True)], of_both))
        case "columns.npy":
            np.save(file, np.column_stack((degrees, 100 * ranges)))
        case "rows.mat":
            savemat(file, {"scan": np.vstack((degrees, 100 * ranges)), "n": 36})
        case _:
            savemat(file, {"data": {"angle_deg": degrees, "range_cm": 100 * ranges}, "maker": "x"})


@pytest.mark.parametrize(
    "form", ["names.npz", "radians.npz", "records.npy", "columns.npy", "rows.mat", "structure.mat"]
)
def test_columns_of_arrays_are_read_as_those_of_a_table(form: str, tmp_path: Path) -> None:
    file = tmp_path / form
    _arrays(file, form)
    unnamed = form in ("columns.npy", "rows.mat")
    if unnamed:
        with pytest.raises(InputError, match="fits centimetres and inches: add unit=cm or unit=in"):
            import_scan(file)
    readings = import_scan(file, ImportOptions(unit="cm") if unnamed else None).readings
    np.testing.assert_allclose([math.degrees(one.angle) for one in readings], np.arange(0, 180, 5), atol=1e-9)
    np.testing.assert_allclose([one.range or math.nan for one in readings], FAR, rtol=1e-9)


def test_arrays_that_are_no_columns_are_listed(tmp_path: Path) -> None:
    file = tmp_path / "scan.mat"
    savemat(file, {"a": np.zeros((40, 2)), "b": np.zeros((40, 2))})
    with pytest.raises(InputError, match=r"in a \(40, 2\), b \(40, 2\); choose one table with variable=NAME"):
        import_scan(file)


def test_a_predicted_scan_in_an_npz_file_is_read_back(tmp_path: Path) -> None:
    file = tmp_path / "scan.npz"
    assert run(["simulate", "simple", "--place", "figure9", "--out", str(file)]) == 0
    readings = import_scan(file).readings
    with np.load(file) as predicted:
        np.testing.assert_allclose([one.range for one in readings], predicted["range_m"], rtol=1e-6)
