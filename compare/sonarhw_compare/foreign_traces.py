"""Traces from arrays of samples of other programs: WAV, NPY, NPZ, MAT and text; and columns of ranges in such arrays.

Each row of a table, or each channel of a WAV file, is the received signal of one ping, from the start of
transmission on. The full scale of integers is that of their type; floats are shares of full scale, from −1 to 1, or
volts with their full scale.
"""

import math
import re
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError, counted, did_you_mean
from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw.text.evidence import REGULAR, sweeps
from sonarhw.text.proposals import propose
from sonarhw.text.tables import column_names
from sonarhw.text.words import ColumnKind, meaning_of
from sonarhw.wire.limits import LONGEST_TRACE
from sonarhw_compare.foreign_rows import MOST_SAMPLES, ForeignRow, Meaning, opened, readings_of, short_lines
from sonarhw_compare.import_formats import is_oscilloscope, start_of_file
from sonarhw_compare.processes import parse_apart

_LONGEST_NUMBER = 26  # characters with its comma, as numpy.savetxt writes it
SLOWEST, FASTEST = 1e3, 1e7  # Hz
_WHAT = "an array of samples"
_NUMERIC = ("double", "single", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))  # of MAT files


def read_raw_traces(file: Path, meaning: Meaning) -> list[Reading]:
    """Return one reading for each trace, `meaning.step` degrees apart. Raises InputError."""
    table, rate = _samples(file, meaning)
    assert rate is not None, "checked by _samples"
    if not SLOWEST <= rate <= FASTEST:
        raise InputError(f"{file}: a sampling rate of {rate} Hz; expected {SLOWEST:g} to {FASTEST:g} Hz")
    samples = _pings_in_rows(file, _scaled(file, np.atleast_2d(table), meaning.full_scale), meaning.axis)
    count = samples.shape[1]
    if not 2 <= count <= LONGEST_TRACE:
        raise InputError(f"{file}: traces of {count} samples; expected 2 to {LONGEST_TRACE}; one row is one ping")
    return readings_of(str(file), _trace_rows(samples, rate, meaning.step), meaning)


def _trace_rows(samples: FloatArray, rate: float, step: float) -> Iterator[ForeignRow]:
    carrier = bool((samples < 0).any())
    for number, trace in enumerate(samples):
        yield ForeignRow(f"row {number + 1}", number * step, None, None, trace=Trace(trace, rate, 0.0, carrier))


def _pings_in_rows(file: Path, samples: FloatArray, axis: str | None) -> FloatArray:
    """Return the samples with one ping a row. Raises InputError if rows and columns may be the pings.

    A ping has many samples, so a table that has fewer columns than rows likely has its pings in columns.
    """
    rows, columns = samples.shape
    if axis is None and rows > columns > 1:
        raise InputError(
            f"{file}: an array of {rows} rows and {columns} columns; the pings may be in rows or in columns: add "
            "axis=rows or axis=columns"
        )
    return np.ascontiguousarray(samples.T) if axis == "columns" or (axis is None and columns == 1) else samples


def _scaled(file: Path, table: NDArray[np.generic], full_scale: float | None) -> FloatArray:
    """Return the samples as shares of full scale, (n, m). Raises InputError unless they are such shares."""
    if table.ndim != 2 or table.dtype.kind not in "iuf":
        raise InputError(
            f"{file}: an array of shape {table.shape} and type {table.dtype}; expected numbers, one row for each ping"
        )
    samples = np.asarray(table, dtype=np.float64)
    if full_scale is not None:
        samples = samples / full_scale
    elif table.dtype.kind != "f":
        bits = 8 * table.dtype.itemsize - (table.dtype.kind == "i")
        samples = samples / 2.0**bits
    most = float(np.abs(samples).max(initial=0.0))
    if not most <= 1:  # also NaN
        raise InputError(
            f"{file}: a sample of {most * (full_scale or 1):g}; expected shares of full scale, from -1 to 1; if "
            "the samples are volts or other numbers, add full_scale=NUMBER, the largest number of the receiver"
        )
    return samples


def _check_size(file: Path, count: float) -> None:
    if count > MOST_SAMPLES:
        raise InputError(f"{file}: {count:g} samples; expected at most {MOST_SAMPLES}; split it into several files")


def _samples(file: Path, meaning: Meaning) -> tuple[NDArray[np.generic], float | None]:
    """Return the array in a file, by its content or else by its suffix, and the sampling rate, Hz."""
    suffix, start = file.suffix.lower(), start_of_file(file, 8)
    if start[:4] == b"RIFF" or suffix == ".wav":
        return parse_apart(_wav, file, "a WAV file")
    is_binary = start.startswith((b"PK", b"\x93NUMPY", b"MATLAB")) or suffix in (".npz", ".npy", ".mat")
    scope = meaning.rate is None and not is_binary and is_oscilloscope(start_of_file(file).decode("utf-8", "replace"))
    if meaning.rate is None and not scope:
        raise InputError(f"{file}: the sampling rate is not stated; add rate=HZ")
    if start[:2] == b"PK" or (suffix == ".npz" and start[:6] != b"\x93NUMPY"):
        return parse_apart(_npz, file, "an NPZ file of NumPy", meaning.variable), meaning.rate
    if start[:6] == b"\x93NUMPY" or suffix == ".npy":
        return parse_apart(_npy, file, "an array of NumPy (.npy)"), meaning.rate
    if start[:6] == b"MATLAB" or suffix == ".mat":
        return parse_apart(_mat, file, "a MAT file", meaning.variable), meaning.rate
    if scope:
        if meaning.full_scale is None:
            raise InputError(
                f"{file}: samples of an oscilloscope are volts; add full_scale=NUMBER, the largest of the receiver"
            )
        return _oscilloscope(file)
    return _text(file), meaning.rate


def _wav(file: Path) -> tuple[NDArray[np.generic], float]:
    """Return the channels of a WAV file, (n, m), and its rate, Hz."""
    from scipy.io import wavfile

    _check_size(file, file.stat().st_size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks that are not sound
        rate, sound = wavfile.read(file)
    if sound.size == 0:
        raise ValueError("it has no samples")
    if sound.dtype == np.uint8:  # eight bits have their zero at 128
        sound = (sound.astype(np.int16) - 128).astype(np.int8)
    return np.atleast_2d(sound.T), float(rate)


def _npy(file: Path) -> NDArray[np.generic]:
    table: NDArray[np.generic] = np.load(file, mmap_mode="r", allow_pickle=False)
    _check_size(file, table.size)
    return np.array(table)


def _npz(file: Path, variable: str | None) -> NDArray[np.generic]:
    """Return one array of an NPZ file. Sizes are checked before it is unpacked."""
    with zipfile.ZipFile(file) as archive:
        sizes = {name.removesuffix(".npy"): archive.getinfo(name).file_size for name in archive.namelist()}
    chosen = _chosen(file, [name for name, size in sizes.items() if size > _HEAD] or [*sizes], variable)
    _check_size(file, sizes[chosen] / 2)
    with np.load(file, allow_pickle=False) as arrays:
        return np.asarray(arrays[chosen])


_HEAD = 160  # bytes of an array of one number in an NPZ file


def _chosen(file: Path, names: list[str], variable: str | None, advice: str = "") -> str:
    """Return the name of the array to read. Raises InputError without one, or if several may be meant."""
    listed = ", ".join(names) or "none"
    if variable is not None:
        if variable not in names:
            what = f"; {advice}" if advice else did_you_mean(variable, names)
            raise InputError(f"{file}: no variable {variable!r}; its arrays: {listed}{what}")
        return variable
    if len(names) != 1:
        advice = "; add variable=NAME" if names else ""
        raise InputError(f"{file}: expected one array of samples, got {listed}{advice}")
    return names[0]


def _mat(file: Path, variable: str | None) -> NDArray[np.generic]:
    """Return an array of a MAT file, also one in a structure (`data.signal`). Sizes are checked before it is loaded."""
    from scipy.io import loadmat, whosmat

    try:
        listed = whosmat(file)
        kinds = {name: kind for name, _, kind in listed}
        sizes = {name: math.prod(shape) for name, shape, _ in listed}
        whole = (variable or "").partition(".")[0]
        if any(kind == "struct" for kind in kinds.values()) and (not variable or kinds.get(whole) == "struct"):
            return _of_struct(file, [name for name, kind in kinds.items() if kind in ("struct", *_NUMERIC)], variable)
        arrays = [name for name, size in sizes.items() if size > 1 and kinds[name] in _NUMERIC]
        chosen = _chosen(file, arrays, variable)
        _check_size(file, sizes[chosen])
        return np.asarray(loadmat(file, variable_names=[chosen])[chosen])
    except NotImplementedError as error:
        raise _newer_version(file) from error


def _newer_version(file: Path) -> InputError:
    return InputError(f"{file}: a MAT file of version 7.3; save it with `save -v7`")


def _of_struct(file: Path, names: list[str], variable: str | None) -> NDArray[np.generic]:
    from scipy.io import loadmat

    _check_size(file, file.stat().st_size / 2)
    arrays: dict[str, NDArray[np.generic]] = {}
    for name, value in loadmat(file, variable_names=names).items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            arrays |= {f"{name}.{part}": np.asarray(value[part].item()) for part in value.dtype.names}
        elif isinstance(value, np.ndarray):
            arrays[name] = value
    large = {name: value for name, value in arrays.items() if value.size > 1 and value.dtype.kind in "iuf"}
    return large[_chosen(file, [*large], variable)]


# Columns of angles and ranges: they become CSV, so that words, units and doubts are those of any other text.


_MOST_COLUMNS = 16  # of a table; a trace has more samples
_Array: TypeAlias = NDArray[np.generic]


def columns_as_text(file: Path, variable: str | None, named: bool) -> tuple[bytes, str]:
    """Return the columns of an NPZ, NPY or MAT file as CSV, and what they were.

    A row is a reading. `variable` selects one array, also in a structure (`data.scan`). `named`: the user names the
    columns; otherwise angles and ranges must be recognised. Raises InputError if no arrays can be columns.
    """
    arrays = parse_apart(_numeric_arrays, file, "an NPZ, NPY or MAT file")
    names, columns = _columns_among(arrays)
    advice = f"name the columns: {_names_of_columns(names, columns)}" if columns else ""
    if variable is not None and columns and variable.rpartition(".")[2] in ["", *names]:
        raise InputError(f"{file}: variable={variable} is one of several columns; {advice}")
    if variable is not None:
        arrays = {_chosen(file, [*arrays], variable, advice): arrays[variable]}
        names, columns = _columns_among(arrays)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    lines = [",".join(str(cell) if math.isfinite(cell) else "none" for cell in row) for row in rows]
    header, of_names = ([",".join(names)], f": {', '.join(names)}") if names else ([], "")
    text = "\n".join([*header, *lines, ""]).encode()
    if not columns or not (named or propose(text, begins_whole=True).layout):
        listed = ", ".join(f"{name or 'array'} {value.shape}" for name, value in arrays.items()) or "no numbers"
        tables = "choose one table with variable=NAME" if len(arrays) > 1 else "save them as arrays of one length"
        raise InputError(
            f"{file}: no angles and ranges were recognised in {listed}; {advice or tables}; if they are received "
            "signals, add rate=HZ, their sampling rate"
        )
    return text, f"{counted(len(columns), 'column')} of arrays{of_names}"


def _names_of_columns(names: Sequence[str], columns: Sequence[_Array]) -> str:
    """Return the options that name the columns of angles and ranges, as far as names and numbers show them."""
    quoted = [*names] or [repr(name) for name in column_names(len(columns))]
    meanings = [meaning_of(name).quantity for name in quoted]
    swept = [sweeps(column.tolist()) >= REGULAR for column in columns]
    angles = [k for k, meaning in enumerate(meanings) if meaning is ColumnKind.ANGLE]
    angles = angles or [k for k, regular in enumerate(swept) if regular]
    rest = [k for k in range(len(columns)) if k not in angles]
    ranges = [k for k in rest if meanings[k] is ColumnKind.RANGE] or rest
    heading, reach = (quoted[of[0]] if len(of) == 1 else "NAME" for of in (angles, ranges))
    return f"heading={heading} range={reach}" + (f", of {', '.join(quoted)}" if "NAME" in (heading, reach) else "")


def _columns_among(arrays: Mapping[str, _Array]) -> tuple[Sequence[str], Sequence[_Array]]:
    """Return names and columns: the arrays of the most usual length, or the only table, without names; else nothing."""
    lengths = Counter(value.size for value in arrays.values() if value.ndim == 1)
    length, count = max(lengths.items(), key=lambda item: (item[1], item[0]), default=(0, 0))
    if count > 1:
        names = [name for name, value in arrays.items() if value.ndim == 1 and value.size == length]
        return [name.rpartition(".")[2] for name in names], [arrays[name] for name in names]
    tables = [value for value in arrays.values() if value.ndim == 2]
    if len(tables) != 1 or not 2 <= min(tables[0].shape) <= _MOST_COLUMNS:
        return (), ()
    (table,) = tables
    # few rows may be traces; angles sweep
    in_rows = table.shape[0] < table.shape[1]
    if in_rows and not any(sweeps(row.tolist()) >= REGULAR for row in table):
        return (), ()
    return (), [*(table if in_rows else table.T)]


def _numeric_arrays(file: Path) -> dict[str, _Array]:
    """Return the arrays of several numbers in a file, by name, without axes of length 1; fields of structures, too."""
    start, suffix = start_of_file(file, 8), file.suffix.lower()
    arrays: dict[str, Any]
    if start[:6] == b"\x93NUMPY":
        arrays = {"": _npy(file)}
    elif start[:2] == b"PK":
        with zipfile.ZipFile(file) as archive:
            _check_size(file, sum(entry.file_size for entry in archive.infolist()) / 2)
            names = [name for name in archive.namelist() if not _has_objects(archive, name)]
        with np.load(file, allow_pickle=False) as loaded:
            arrays = {name.removesuffix(".npy"): loaded[name] for name in names}
    elif start[:6] == b"MATLAB" or suffix == ".mat":
        arrays = _of_mat(file)
    else:
        raise ValueError("it begins with other bytes")
    fields = {
        f"{name}.{part}" if name else part: value[part].item() if value[part].dtype == object else value[part]
        for name, value in arrays.items()
        if isinstance(value, np.ndarray) and value.size and value.dtype.names
        for part in value.dtype.names
        if value[part].dtype != object or value[part].size == 1
    }
    several = {name: np.squeeze(np.asarray(value)) for name, value in {**arrays, **fields}.items()}
    return {name: value for name, value in several.items() if value.size > 1 and value.dtype.kind in "iuf"}


def _has_objects(archive: zipfile.ZipFile, name: str) -> bool:
    """Return whether a part of an NPZ file is an array of Python objects, which are not loaded. Raises ValueError."""
    with archive.open(name) as part:
        old = np.lib.format.read_magic(part) == (1, 0)
        read_header = np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0
        return bool(read_header(part)[2].hasobject)


def _of_mat(file: Path) -> dict[str, Any]:
    from scipy.io import loadmat, whosmat

    try:
        _check_size(file, max(file.stat().st_size / 2, sum(math.prod(shape) for _, shape, _ in whosmat(file))))
        return {name: value for name, value in loadmat(file, squeeze_me=True).items() if not name.startswith("__")}
    except NotImplementedError as error:
        raise _newer_version(file) from error


# CSV of oscilloscopes: names and settings of each maker, then a column of times or of counts, and one of each channel.


_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
_UNIT = re.compile(r"\(([a-zµ]+)\)|\b(ms|us|µs|ns)\b", re.IGNORECASE)
_STEADY = 0.5  # share by which two steps of the time may differ, by rounding


def _oscilloscope(file: Path) -> tuple[NDArray[np.generic], float]:
    """Return the samples of each channel from the trigger on, in its unit, (n, m), and the sampling rate, Hz."""
    with opened(file, _WHAT) as text:
        lines = [line.rstrip("\r\n") for line in short_lines(file, text, _WHAT)]
    _check_size(file, len(lines))
    cells = _cells([line for line in lines if line.strip(" ,;\t")])
    table, first, columns = _numeric_block(file, cells)
    increment = _increment(cells[:first]) if _counts(table[:, 0]) else None
    unit = next((match for row in cells[:first] if (match := _UNIT.search(row[0]))), None)
    seconds = _TIME_UNITS.get((unit[1] or unit[2]).lower(), 1.0) if unit else 1.0
    times = table[:, 0] * (seconds if increment is None else increment[1]) + (
        0.0 if increment is None else increment[0]
    )
    steps = np.diff(times)
    step = float(steps.mean())
    if not step > 0 or np.abs(steps - step).max() > _STEADY * step:
        raise InputError(
            f"{file}: the times in its first column do not grow evenly; expected a trace of an oscilloscope"
        )
    after = times > -step / 2  # the trigger is the start of transmission
    if not after.any():
        raise InputError(f"{file}: ends before the trigger, at {times[-1]:g} s; expected samples after time 0")
    volts = [_volts([row[k] for row in cells[:first] if k < len(row)]) for k in columns[1:]]
    return np.ascontiguousarray((table[after, 1:] * volts).T), round(1 / step, 6)


_MILLIVOLTS = re.compile(r"\(mV\)|\bin mV\b")


def _cells(lines: list[str]) -> list[list[str]]:
    """Return the cells of lines, between semicolons or tabs, where a comma is that of a number; else between commas."""
    mark = next((mark for mark in ";\t" if lines and mark in lines[-1]), ",")
    return [[cell if mark == "," else cell.replace(",", ".") for cell in line.split(mark)] for line in lines]


def _volts(head: list[str]) -> float:
    """Return the unit of a column by the cells above it, V."""
    return 1e-3 if any(_MILLIVOLTS.search(cell) for cell in head) else 1.0


def _numeric_block(file: Path, cells: list[list[str]]) -> tuple[FloatArray, int, list[int]]:
    """Return the columns that are numbers to the end, (n, m), the row where they begin, and their places.

    Samples without times are counted in a first column.
    """
    columns = [k for k, cell in enumerate(cells[-1] if cells else []) if _is_number(cell)]
    counted = len(columns) == 1 and _increment(cells[:_HEAD_ROWS]) is not None
    if len(columns) < 2 and not counted:
        raise InputError(f"{file}: expected a column of times and one of samples, got {cells[-1:]}")
    first = len(cells)
    while first and len(cells[first - 1]) > columns[-1] and all(_is_number(cells[first - 1][k]) for k in columns):
        first -= 1
    numbers = np.array([[float(row[k]) for k in columns] for row in cells[first:]])
    if len(numbers) < 2:
        raise InputError(f"{file}: has no column of samples; expected a trace of an oscilloscope")
    if counted:
        numbers, columns = np.column_stack((np.arange(len(numbers)), numbers)), [-1, *columns]
    return numbers, max(first, min(len(cells), _HEAD_ROWS)), columns


_HEAD_ROWS = 20


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _counts(column: FloatArray) -> bool:
    return bool((np.diff(column) == 1).all())


_START_AND_STEP = {
    "start": re.compile(r"\bt0\s*=\s*([-+\d.e]+)", re.IGNORECASE),
    "step": re.compile(r"\btinc\s*=\s*([-+\d.e]+)", re.IGNORECASE),
}


_INTERVAL = re.compile(r"([-+\d.e]*\d)\s*([mµun]?s)?", re.IGNORECASE)


def _increment(head: list[list[str]]) -> tuple[float, float] | None:
    """Return start and step of the times where samples are counted, s: columns named so, or a key."""
    for row, below in pairwise(head):
        names = [name.strip().lower() for name in row]
        if "increment" in names and "start" in names:
            return float(below[names.index("start")]), float(below[names.index("increment")])
    for row in head:
        written = [_START_AND_STEP[key].search(",".join(row)) for key in ("start", "step")]
        if written[0] and written[1]:
            return float(written[0][1]), float(written[1][1])
        key = row[0].strip(": \t").lower()
        steps = filter(None, (_INTERVAL.fullmatch(cell.strip()) for cell in row[1:]))
        if key in ("sample interval", "time interval") and (step := next(steps, None)):
            return 0.0, float(step[1]) * _TIME_UNITS[(step[2] or "s").lower()]
    return None


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
    return np.array(lines)
