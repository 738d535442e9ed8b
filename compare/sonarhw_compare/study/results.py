"""Results of a study for notebooks: the folder as an `xarray.Dataset`, or as Arrow tables."""

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, cast

import numpy as np

from sonarhw.errors import InputError, MissingExtra
from sonarhw.readings import FloatArray
from sonarhw_compare.study.arrow import pa, pq
from sonarhw_compare.study.parts import read_manifest, unfinished_of

if TYPE_CHECKING:
    import xarray as xr


def read_tables(folder: Path | str) -> "tuple[pa.Table, pa.Table | None]":
    """Return a table of scans, and one of headings (None if the study kept figures only), in order of scans.

    Raises InputError if the folder is not a finished study.
    """
    folder = Path(folder)
    unfinished = unfinished_of(folder)
    if not folder.exists() and unfinished.exists():
        raise InputError(f"{folder}: not finished; resume the study")
    read_manifest(folder)
    headings = folder / "headings"
    return _table(folder / "scans"), _table(headings) if headings.is_dir() else None


def _table(folder: Path) -> "pa.Table":
    parts = sorted(folder.glob("part-*.parquet"))
    return pa.concat_tables([pq.read_table(part) for part in parts]).combine_chunks()


def read_study(folder: Path | str) -> "xr.Dataset":
    """Return the results of a study, with figures as variables along `scan` and varied values as coordinates.

    Readings, if kept, are variables along `scan` and `heading_deg`, or `reading` if scans have different headings; NaN
    for no echo. Raises InputError if the folder is not a finished study, or xarray is not installed.
    """
    xarray = _load_xarray()
    scans, headings = read_tables(folder)
    columns = {name: scans[name].to_numpy() for name in scans.column_names}
    number = columns.pop("scan")
    first_figure = list(columns).index("n")
    along = {name: ("scan", values) for name, values in list(columns.items())[:first_figure]}
    figures = {name: ("scan", values) for name, values in list(columns.items())[first_figure:]}
    dataset = xarray.Dataset(
        figures, coords={"scan": number} | along, attrs={"study": read_manifest(Path(folder))["study"]}
    )
    return cast("xr.Dataset", dataset if headings is None else dataset.assign(_arrays(headings, columns["n"])))


def _arrays(headings: "pa.Table", counts: np.ndarray[tuple[int], np.dtype[np.int64]]) -> "dict[str, xr.DataArray]":
    """Return each column of the readings as an array (scans, readings), padded with NaN."""
    xr = _load_xarray()
    filled = np.arange(counts.max()) < counts[:, None]

    def spread(name: str) -> FloatArray:
        values: FloatArray = np.full(filled.shape, np.nan)
        values[filled] = headings[name].cast(pa.float64()).to_numpy()
        return values

    names = [name for name in headings.column_names if name not in ("scan", "heading_deg")]
    degrees = spread("heading_deg")
    if (degrees == degrees[0]).all():
        coords = {"heading_deg": degrees[0]}
        return {name: xr.DataArray(spread(name), dims=("scan", "heading_deg"), coords=coords) for name in names}
    found = {name: xr.DataArray(spread(name), dims=("scan", "reading")) for name in names}
    return found | {"heading_deg": xr.DataArray(degrees, dims=("scan", "reading"))}


def _load_xarray() -> ModuleType:
    try:
        return import_module("xarray")
    except ImportError as error:
        raise MissingExtra("labelled results need xarray", "study") from error
