"""Bytes of the files that a room is made from, the cells of pictures in them, and the unit of their lengths."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from sonarhw_sim.check import LARGE

from sonarhw.errors import InputError
from sonarhw.files import open_input
from sonarhw.readings import FloatArray

_MOST_BYTES = 100 * 2**20  # of a file
_MOST_PIXELS = 64 * 2**20  # of a picture
_PICTURES = ("PPM", "PNG", "BMP", "GIF", "JPEG", "TIFF")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "dm": 0.1, "km": 1000.0, "in": 0.0254, "ft": 0.3048, "yd": 0.9144}
_LIKELY = ("m", "cm", "mm", "in", "ft")
_LARGEST = 1e9  # of a number
_SMALL = 0.2  # m; a smaller room is improbable


def read_bytes(file: Path, what: str) -> bytes:
    """Return the content of a regular file of at most 100 MiB. Raises InputError."""
    try:
        with open_input(file, _MOST_BYTES) as opened:
            return opened.read(_MOST_BYTES)
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such file; expected {what}") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected {what}") from error
    except ValueError as error:  # a NUL in the name
        raise InputError(f"{file}: {error}") from error


def read_picture(file: Path, what: str) -> FloatArray:
    """Return the brightness of a picture, (rows, columns) 0 to 1; NaN where it is transparent. Raises InputError."""
    from PIL import Image

    data = read_bytes(file, what)
    try:
        with Image.open(BytesIO(data), formats=_PICTURES) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise InputError(f"{file}: has {image.width} by {image.height} pixels; at most {_MOST_PIXELS} are read")
            deep = image.mode.startswith("I")
            channels = np.asarray(image if deep else image.convert("RGBA"), np.float32)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as error:
        raise InputError(f"{file}: cannot be read as a picture: {error}; expected {what}") from error
    if deep:
        return np.asarray(channels / 65535.0, np.float64)
    bright = channels[..., :3].mean(axis=2) / 255.0
    return np.asarray(np.where(channels[..., 3] < 128, np.nan, bright), np.float64)


def metres_of(unit: str) -> float:
    """Return the metres of a unit: its name, or a number of metres. Raises InputError."""
    if unit in METRES:
        return METRES[unit]
    try:
        metres = float(unit)
    except ValueError:
        metres = 0.0
    if not 1e-9 < metres < 1e6:
        raise InputError(f"unit {unit!r}: expected one of {', '.join(METRES)}, or a number of metres")
    return metres


def numbers_of(words: Sequence[str], count: int | None = None) -> list[float] | None:
    """Return the numbers that a file states, `count` of them or any number.

    None for anything else, and for numbers so large that the arithmetic of a room could overflow.
    """
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    fitting = count is None or len(numbers) == count
    return numbers if fitting and all(abs(number) <= _LARGEST for number in numbers) else None


def unit_question(file: Path, extent: FloatArray, why: str) -> InputError:
    """Return the error that asks for the unit of a file whose lengths have this extent, (2,)."""
    width, depth = extent
    sizes = {unit: METRES[unit] * max(width, depth) for unit in _LIKELY}
    likely = [unit for unit, size in sizes.items() if _SMALL < size <= LARGE] or list(_LIKELY)
    listed = "; ".join(f"{unit}: {width * METRES[unit]:.4g} by {depth * METRES[unit]:.4g} m" for unit in likely)
    return InputError(f"{file}: {why}, and it is {width:.6g} by {depth:.6g} units; give the unit. {listed}")
