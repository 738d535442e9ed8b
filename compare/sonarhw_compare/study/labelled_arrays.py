"""Scans and comparisons as `xarray.Dataset`, for notebooks; NaN for no echo. xarray is in the extra `study`."""

import math
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, cast

import numpy as np

from sonarhw.errors import MissingExtra
from sonarhw.readings import Reading

if TYPE_CHECKING:
    import xarray as xr

    from sonarhw_compare.matching.match import Comparison


def scan_dataset(readings: Sequence[Reading]) -> "xr.Dataset":
    """Return range and number of echoes of a measured scan along its turntable angles `angle_deg`.

    Raises MissingExtra if xarray is not installed.
    """
    ranges = [math.nan if reading.range is None else reading.range for reading in readings]
    variables = {
        "range_m": ("angle_deg", ranges),
        "echoes": ("angle_deg", [len(reading.echo_times) for reading in readings]),
    }
    angles = np.round(np.degrees([reading.angle for reading in readings]), 9)
    return cast("xr.Dataset", load_xarray().Dataset(variables, coords={"angle_deg": angles}))


def comparison_dataset(comparison: "Comparison") -> "xr.Dataset":
    """Return a comparison along `heading_deg`: measured, predicted, residual, class and explaining path.

    Raises MissingExtra if xarray is not installed.
    """
    rows, prediction = comparison.rows, comparison.prediction
    variables = {
        "measured_m": [math.nan if row.measured is None else row.measured for row in rows],
        "predicted_m": [math.nan if row.predicted is None else row.predicted for row in rows],
        "residual_m": [math.nan if row.residual is None else row.residual for row in rows],
        "kind": [row.kind.value for row in rows],
        "via": ["" if row.path is None else ">".join(prediction.paths.via(row.path, prediction.room)) for row in rows],
    }
    headings = np.round(np.degrees([row.heading for row in rows]), 9)
    along = {name: ("heading_deg", values) for name, values in variables.items()}
    return cast("xr.Dataset", load_xarray().Dataset(along, coords={"heading_deg": headings}))


def load_xarray() -> ModuleType:
    """Return the module xarray. Raises MissingExtra if it is not installed."""
    try:
        return import_module("xarray")
    except ImportError as error:
        raise MissingExtra("labelled results need xarray", "study") from error
