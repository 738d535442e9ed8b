"""Traces from arrays of samples: WAV, NPY, MAT and text.

Each row of a table, or each channel of a WAV file, is the received signal of one ping, from the start of transmission
on. The full scale of integers is that of their type; floats are shares of full scale, from −1 to 1.
"""

import math
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw_compare.imports.foreign_csv import opened, short_lines
from sonarhw_compare.imports.foreign_rows import MOST_SAMPLES, ForeignRow, Meaning, readings_of

LONGEST_TRACE = 0xFFFF  # samples of a trace in a log
_LONGEST_NUMBER = 26  # characters with its comma, as numpy.savetxt writes it
SLOWEST, FASTEST = 1e3, 1e7  # Hz
_WHAT = "an array of samples"


def read_raw_traces(file: Path, meaning: Meaning) -> list[Reading]:
    """Return one reading for each trace, `meaning.step` degrees apart. Raises InputError."""
    table, rate = _wav(file) if file.suffix.lower() == ".wav" else (_table(file), meaning.rate)
    if rate is None or not SLOWEST <= rate <= FASTEST:
        raise InputError(f"{file}: a sampling rate of {rate} Hz; expected {SLOWEST:g} to {FASTEST:g} Hz")
    samples = _scaled(file, np.atleast_2d(table))
    count = samples.shape[1]
    if not 2 <= count <= LONGEST_TRACE:
        raise InputError(f"{file}: traces of {count} samples; expected 2 to {LONGEST_TRACE}; one row is one ping")
    return readings_of(str(file), _rows(samples, rate, meaning.step), meaning)


def _rows(samples: FloatArray, rate: float, step: float) -> Iterator[ForeignRow]:
    carrier = bool((samples < 0).any())
    for number, trace in enumerate(samples):
        yield ForeignRow(f"row {number + 1}", number * step, None, None, trace=Trace(trace, rate, 0.0, carrier))


def _scaled(file: Path, table: NDArray[np.generic]) -> FloatArray:
    """Return the samples as shares of full scale, (n, m). Raises InputError unless they are such shares."""
    if table.ndim != 2 or table.dtype.kind not in "iuf":
        raise InputError(
            f"{file}: an array of shape {table.shape} and type {table.dtype}; expected numbers, one row for each ping"
        )
    samples = np.asarray(table, dtype=np.float64)
    if table.dtype.kind != "f":
        bits = 8 * table.dtype.itemsize - (table.dtype.kind == "i")
        samples = samples / 2.0**bits
    most = float(np.abs(samples).max(initial=0.0))
    if not most <= 1:  # also NaN
        raise InputError(f"{file}: a sample of {most:g}; expected shares of full scale, from -1 to 1")
    return samples


def _check_size(file: Path, count: float) -> None:
    if count > MOST_SAMPLES:
        raise InputError(f"{file}: {count:g} samples; expected at most {MOST_SAMPLES}; split it into several files")


def _wav(file: Path) -> tuple[NDArray[np.generic], float]:
    """Return the channels of a WAV file, (n, m), and its rate, Hz."""
    from scipy.io import wavfile

    try:
        _check_size(file, file.stat().st_size)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks that are not sound
            rate, sound = wavfile.read(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected a WAV file") from error
    except (ValueError, struct.error, EOFError) as error:
        raise InputError(f"{file}: is not a WAV file: {error}") from error
    if sound.dtype == np.uint8:  # eight bits have their zero at 128
        sound = (sound.astype(np.int16) - 128).astype(np.int8)
    return np.atleast_2d(sound.T), float(rate)


def _table(file: Path) -> NDArray[np.generic]:
    """Return the array in a file, by its suffix."""
    try:
        match file.suffix.lower():
            case ".npy":
                return _npy(file)
            case ".mat":
                return _mat(file)
            case _:
                return _text(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}; expected {_WHAT}") from error


def _npy(file: Path) -> NDArray[np.generic]:
    try:
        table: NDArray[np.generic] = np.load(file, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError) as error:
        # without the advice of later sentences
        first = str(error).partition("\n")[0].partition(". ")[0]
        raise InputError(f"{file}: is not an array of NumPy (.npy): {first}") from error
    _check_size(file, table.size)
    return table


def _mat(file: Path) -> NDArray[np.generic]:
    """Return the only array of a MAT file that is longer than one number. Sizes are checked before it is loaded."""
    from scipy.io import loadmat, matlab, whosmat

    try:
        sizes = {name: math.prod(shape) for name, shape, _ in whosmat(file)}
        arrays = [name for name, size in sizes.items() if size > 1]
        if len(arrays) != 1:
            raise InputError(f"{file}: expected one array of samples, got {', '.join(arrays) or 'none'}")
        _check_size(file, sizes[arrays[0]])
        return np.asarray(loadmat(file, variable_names=arrays)[arrays[0]])
    except NotImplementedError as error:
        raise InputError(f"{file}: a MAT file of version 7.3; save it with `save -v7`") from error
    except (ValueError, TypeError, EOFError, KeyError, zlib.error, matlab.MatReadError) as error:
        raise InputError(f"{file}: is not a MAT file: {str(error).partition(chr(10))[0]}") from error


def _text(file: Path) -> NDArray[np.generic]:
    """Return the numbers of a text file, one row a line, between commas, semicolons, tabs or spaces."""
    lines: list[FloatArray] = []
    with opened(file, _WHAT) as text:
        for number, line in enumerate(short_lines(file, text, _WHAT, LONGEST_TRACE * _LONGEST_NUMBER), 1):
            words = line.replace(",", " ").replace(";", " ").split()
            if not words:
                continue
            try:
                lines.append(np.array(words, dtype=np.float64))
            except ValueError as error:
                raise InputError(f"{file}, line {number}: {error}; expected samples between commas") from error
            if len(lines[-1]) != len(lines[0]):
                raise InputError(f"{file}, line {number}: {len(words)} samples; expected {len(lines[0])}, as above")
            _check_size(file, len(lines) * len(lines[0]))
    if not lines:
        raise InputError(f"{file}: the file is empty; expected one row of samples for each ping")
    # a column is one trace
    return np.array(lines).T if lines[0].size == 1 else np.array(lines)
