"""Studies: many predicted scans over grids and random draws, from a TOML file to a folder of Parquet files.

    from sonarhw_compare.study import load_study, read_study, run_study

    run_study(load_study(Path("study.toml")), Path("results"))
    results = read_study("results")  # an xarray.Dataset

This module needs the extra `study`: pip install '.[study]' in the source folder.
"""

import hashlib
import json
import logging
import platform
import shutil
from collections import OrderedDict
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import closing
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from sonarhw_sim.air import Model
from sonarhw_sim.compiled import core_count
from sonarhw_sim.predict.batch import predict_ranges
from sonarhw_sim.predict.predicted_scan import PredictedScan, ReportedPaths, standpoints
from sonarhw_sim.predict.prediction import (
    paths_for,
    paths_serve_all_headings,
    predict_with,
    search_for,
    weigh_paths,
)
from sonarhw_sim.rays.fan import distances_ahead
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.space.sections import cut, spanning_at

from sonarhw import arguments
from sonarhw.errors import InputError, MissingExtra, OutputError, WorkersLost
from sonarhw.files import atomic_file, open_input
from sonarhw.readings import FloatArray
from sonarhw_compare.match import TOLERANCE
from sonarhw_compare.processes import Processes
from sonarhw_compare.study_cases import Case, Cases, Study, load_study

__all__ = ["load_study", "read_study", "read_tables", "run_study"]

if TYPE_CHECKING:
    import xarray as xr


def _from_extra(name: str, need: str) -> Any:
    """Return a module of the extra `study`. Raises MissingExtra if it is not installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtra(need, "study") from error


# Apache Arrow for the tables of a study, installed only with the extra `study` because of its size.
#
# It is imported when it is first used, so that `help(sonarhw)` and `from sonarhw import *` work without it.


if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq
else:

    class _OnFirstUse:
        """A module that is imported when one of its names is used. Raises MissingExtra if it is not installed."""

        def __init__(self, name: str) -> None:
            self._name = name

        def __getattr__(self, name: str) -> Any:
            return getattr(_from_extra(self._name, "studies need pyarrow"), name)

    pa, pq = _OnFirstUse("pyarrow"), _OnFirstUse("pyarrow.parquet")


def check_arrow() -> None:
    """Raise MissingExtra if Arrow is not installed."""
    _ = pa.table, pq.write_table


# Prediction of the scans of a study, as two Arrow tables.
#
# One table has a row for each scan, with the varied values and the figures of the scan. The other has a row for each
# heading. The result of a scan does not depend on the other scans of a call.


_PATHS_KEPT = 16  # sets of paths, for points of the grid that use the same place again soon


@dataclass(frozen=True)
class ScanColumns:
    """The columns of one scan, (n,) each; NaN for no echo."""

    heading_deg: FloatArray
    range_m: FloatArray
    path_m: FloatArray
    level_db: FloatArray
    bounces: FloatArray
    bent: FloatArray  # 1 if the path is diffracted at an edge, else 0
    axis_m: FloatArray  # m, straight ahead to the first wall or post; NaN without one


class PathCache:
    """Cache of the paths of the last few places, so that sound is followed once for each place."""

    def __init__(self) -> None:
        self._kept: OrderedDict[object, Paths] = OrderedDict()

    def of(self, case: Case) -> Paths:
        """Return all paths that the board of a case can detect, at any threshold of its study."""
        key = _paths_key(case)
        paths = self._kept.pop(key, None)
        if paths is None:
            paths = paths_for(case.room, case.place, case.most_sensitive, case.options)
        self._kept[key] = paths
        if len(self._kept) > _PATHS_KEPT:
            self._kept.popitem(last=False)
        return paths


def _paths_key(case: Case) -> object:
    """Return a value that is equal for scans with the same paths."""
    search = search_for(case.room, case.most_sensitive, case.options)
    return case.where, search, case.board.aperture_radius, case.options.sections


@lru_cache(maxsize=4)
def cases_of(study: Study) -> tuple[Cases, bool]:
    """Return the scans of a study, and whether neighbours on its grid have the same paths, once in a process."""
    cases = Cases(study)
    keys = [_paths_key(cases.case(number)) for number in range(min(study.points, _PATHS_KEPT))]
    return cases, len(set(keys)) < len(keys)


def columns_of_cases(cases: Sequence[Case], shared: bool) -> list[ScanColumns]:
    """Return the columns of scans. Those whose paths no other scan has are predicted together, room by room."""
    columns: dict[int, ScanColumns] = {}
    together: dict[object, list[Case]] = {}
    cache = PathCache()
    for case in cases:
        if shared or not _is_by_ranges(case):
            columns[case.number] = columns_of(predict_case(case, cache))
        else:
            same = id(case.room), case.board, case.options, case.place.heading, case.headings.tobytes()
            together.setdefault(same, []).append(case)
    for group in together.values():
        columns |= zip((case.number for case in group), _predict_together(group), strict=True)
    return [columns[case.number] for case in cases]


def _is_by_ranges(case: Case) -> bool:
    """Return whether `predict_ranges` predicts a scan."""
    return case.model is Model.RAY_FOLLOWING and not case.options.noise and case.place.height is None


def _predict_together(cases: Sequence[Case]) -> Iterator[ScanColumns]:
    """Yield the columns of scans at different positions in one room, with one board."""
    first = cases[0]
    room, board, headings = first.room, first.board, first.headings
    # the heading of a place in a study is the actual one of step 0
    turn = first.place.heading - board.heading_at(0.0, 0.0)
    poses = [(*case.place.position, turn) for case in cases]
    angles = board.angle_at(headings, first.place.heading)
    readings = predict_ranges(room, poses, angles, board, paths=True, options=first.options)
    ranges, paths = cast("tuple[FloatArray, ReportedPaths]", readings)
    for row, case in enumerate(cases):
        ahead = distances_ahead(standpoints(board, case.place, headings), headings, room.surfaces)
        yield _columns(headings, ranges[row], ReportedPaths(*(column[row] for column in paths)), ahead)


def predict_case(case: Case, cache: PathCache) -> PredictedScan:
    """Return the predicted scan of a case."""
    room, place, board, options = case.room, case.place, case.board, case.options
    if case.model is Model.RAY_FOLLOWING and paths_serve_all_headings(board, options.unit):
        return weigh_paths(room, place, board, case.headings, cache.of(case), options)
    return predict_with(case.model, room, place, board, case.headings, options)


def columns_of(scan: PredictedScan) -> ScanColumns:
    """Return the columns of a scan."""
    height = scan.place.height
    room = scan.room if height is None else cut(scan.room, spanning_at(scan.room, height))
    ahead = distances_ahead(scan.standpoints, scan.headings, room.surfaces)
    return _columns(scan.headings, scan.ranges, scan.reported_paths, ahead)


def _columns(headings: FloatArray, ranges: FloatArray, paths: ReportedPaths, ahead: FloatArray) -> ScanColumns:
    """Return the columns of readings at `headings` (n,) rad; `ahead` (n,) m are the ways to the surface ahead."""
    echo = ~np.isnan(paths.lengths)
    return ScanColumns(
        # rounded as in the output of all commands
        np.asarray(np.round(np.degrees(headings), 9), dtype=np.float64),
        ranges,
        paths.lengths,
        paths.levels,
        np.where(echo, paths.bounces, np.nan),
        np.where(echo, paths.edges >= 0, np.nan),
        np.where(np.isfinite(ahead), ahead, np.nan),
    )


def figures_of(columns: ScanColumns) -> dict[str, float]:
    """Return the figures of one scan; shares are of its echoes, NaN without echoes."""
    echo = ~np.isnan(columns.range_m)
    count = int(echo.sum())
    several = columns.bounces[echo] + columns.bent[echo] > 1
    errors = np.abs(columns.range_m - columns.axis_m)[echo]
    known_errors = errors[~np.isnan(errors)]
    return {
        "n": len(echo),
        "n_echo": count,
        "by_several": float(several.mean()) if count else np.nan,
        "by_edge": float(columns.bent[echo].mean()) if count else np.nan,
        "within_5cm_of_axis": float((errors <= TOLERANCE).mean()) if count else np.nan,
        "median_abs_error_m": float(np.median(known_errors)) if len(known_errors) else np.nan,
    }


def predict_scans(study: Study, first: int, last: int) -> "tuple[pa.Table, pa.Table]":
    """Return the tables of scans and of headings for scans `first` to `last` (excluded).

    Raises InputError if drawn values of a scan do not fit together.
    """
    known, shared = cases_of(study)
    cases = [known.case(number) for number in range(first, last)]
    readings = columns_of_cases(cases, shared)
    rows = [_description(case) | figures_of(columns) for case, columns in zip(cases, readings, strict=True)]
    if study.rows != "headings":
        return _scan_table(rows), pa.table({})
    numbers = [np.full(len(columns.range_m), case.number) for case, columns in zip(cases, readings, strict=True)]
    return _scan_table(rows), _reading_table(numbers, readings)


def _description(case: Case) -> dict[str, object]:
    x, y = case.place.position
    here = {"room": case.room_name, "place": case.place.name, "x_m": x, "y_m": y, "board": case.board_name}
    return {"scan": case.number, "draw": case.draw} | here | case.values


def _scan_table(rows: list[dict[str, object]]) -> "pa.Table":
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    return pa.table({key: pa.array(np.array(values), from_pandas=True) for key, values in columns.items()})


def _reading_table(
    numbers: list[np.ndarray[tuple[int], np.dtype[np.int64]]], readings: list[ScanColumns]
) -> "pa.Table":
    several = {key: np.concatenate([getattr(reading, key) for reading in readings]) for key in vars(readings[0])}
    table = {"scan": pa.array(np.concatenate(numbers))}
    table |= {key: pa.array(values, from_pandas=True) for key, values in several.items()}
    table["bounces"] = table["bounces"].cast(pa.int16())
    table["bent"] = table["bent"].cast(pa.bool_())
    return pa.table(table)


# The folder of a study: Parquet part files in `scans` and `headings`, and a manifest.
#
# The folder is called FOLDER.unfinished until all parts exist. Each part is written under another name and then
# renamed, so every part is complete. After an interruption, the existing parts are reused.


MANIFEST = "manifest.json"
FORMAT = 1
_MOST_MANIFEST = 64_000_000  # bytes
_MOST_PER_PART = 500
_MOST_ROWS_PER_PART = 1_000_000  # headings, so that a part of fine scans fits into memory
_PARTS = 40  # in a study of fewer than 20 000 scans
_VERSIONS = ("sonarhw", "numpy", "numba", "scipy", "pyarrow")


@dataclass(frozen=True)
class Part:
    """The results of consecutive scans, as the bytes of Parquet files."""

    number: int
    scans: bytes
    headings: bytes | None  # None if a study keeps the figures of scans only
    versions: tuple[tuple[str, str], ...]  # of Python and the packages that computed it


def scans_per_part(study: Study) -> int:
    """Return the number of scans in a part. It depends on the study only, not on the number of workers."""
    return min(_MOST_PER_PART, -(-study.scans // _PARTS), max(1, _MOST_ROWS_PER_PART // study.headings_of_scan))


def part_count(study: Study) -> int:
    """Return the number of parts of a study."""
    return -(-study.scans // scans_per_part(study))


def make_part(study: Study, number: int) -> Part:
    """Predict part `number` of a study. Raises InputError if drawn values of a scan do not fit together."""
    size = scans_per_part(study)
    scans, headings = predict_scans(study, number * size, min((number + 1) * size, study.scans))
    return Part(number, _parquet(scans), _parquet(headings) if study.rows == "headings" else None, versions())


def _parquet(table: "pa.Table") -> bytes:
    sink = BytesIO()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


# once, because an installation meanwhile does not change what is imported
@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Return names and versions of Python and the packages that determine results."""
    return ("python", platform.python_version()), *((name, version(name)) for name in _VERSIONS)


def unfinished_of(folder: Path) -> Path:
    """Return the path of the folder until all parts exist."""
    return folder.parent / f"{folder.name}.unfinished"  # also of a folder without a name, such as "."


class StudyFolder:
    """The folder for the results of one study."""

    def __init__(self, folder: Path, study: Study) -> None:
        self.folder = folder
        self.unfinished = unfinished_of(folder)
        self._study = study
        self._manifest = _manifest(study)

    def begin(self, resume: bool) -> list[int]:
        """Create the folder, or continue in it with `resume`, and return the numbers of the missing parts.

        Raises InputError if it exists without `resume` or belongs to another study, OutputError if it cannot be
        created.
        """
        if self.folder.exists():
            if not resume:
                raise InputError(f"{self.folder}: exists already; choose another folder")
            self._check(self.folder)
            return []
        if self.unfinished.exists():
            if not resume:
                raise InputError(f"{self.unfinished}: an interrupted study; resume it, or remove it")
            self._check(self.unfinished)
        else:
            self._make()
        return [number for number in range(part_count(self._study)) if not self._path("scans", number).exists()]

    def write(self, part: Part) -> None:
        """Write a part. Raises OutputError if it cannot be written, or if its versions differ from those here."""
        if part.versions != versions():
            raise OutputError(
                f"{self.unfinished}: a worker has {_named(part.versions)}, this computer has {_named(versions())}; "
                "results could differ; install the same versions everywhere"
            )
        # the file of scans is last: it marks the part as complete
        if part.headings is not None:
            _write_whole(self._path("headings", part.number), part.headings)
        _write_whole(self._path("scans", part.number), part.scans)

    def drop_if_empty(self) -> None:
        """Remove the unfinished folder if it contains no part."""
        if not any(self.unfinished.glob("scans/part-*.parquet")):
            shutil.rmtree(self.unfinished, ignore_errors=True)

    def finish(self) -> None:
        """Rename the complete folder to its final name. Raises OutputError."""
        try:
            self.unfinished.rename(self.folder)
        except OSError as error:
            raise _unwritable(self.folder, error) from error

    def _path(self, kind: str, number: int) -> Path:
        return self.unfinished / kind / f"part-{number:06d}.parquet"

    def _make(self) -> None:
        if not self.folder.parent.is_dir():
            raise InputError(f"{self.folder}: folder {self.folder.parent} does not exist; create it first")
        kinds = ("scans", "headings") if self._study.rows == "headings" else ("scans",)
        try:
            for kind in kinds:
                (self.unfinished / kind).mkdir(parents=True)
        except OSError as error:
            raise _unwritable(self.unfinished, error) from error
        _write_whole(self.unfinished / MANIFEST, json.dumps(self._manifest, indent=2).encode())

    def _check(self, folder: Path) -> None:
        """Raise InputError if the folder `folder` belongs to another study."""
        held = read_manifest(folder)
        changed = [key for key, value in self._manifest.items() if held.get(key) != value]
        if changed:
            raise InputError(
                f"{folder}: belongs to another study, with different {' and '.join(changed)}; "
                "restore them, or choose another folder"
            )


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of the folder of a study. Raises InputError if there is none."""
    try:
        with open_input(folder / MANIFEST, _MOST_MANIFEST) as file:
            manifest = json.load(file)
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: not the folder of a study; it has no readable {MANIFEST}") from error
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{folder}: {MANIFEST} has an unknown format; this version reads format {FORMAT} only")
    return manifest


def _manifest(study: Study) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "study": study.text,
        "rooms": {room.name: _digest(room.text) for room in study.rooms},
        "boards": {name: _digest(text) for name, text in study.boards},
        "scans": study.scans,
        "scans_per_part": scans_per_part(study),
        "versions": [list(pair) for pair in versions()],
    }


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _named(pairs: tuple[tuple[str, str], ...]) -> str:
    return ", ".join(f"{name} {number}" for name, number in pairs)


def _write_whole(path: Path, content: bytes) -> None:
    # an interrupted study may have left the headings of a part
    with atomic_file(path, overwrite=True) as file:
        file.write(content)


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: {error.strerror or error}; choose another folder")


# Results of a study for notebooks: the folder as an `xarray.Dataset`, or as Arrow tables.


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


@arguments.checked(folder=arguments.file_name)
def read_study(folder: Path | str) -> "xr.Dataset":
    """Return the results of a study, with figures as variables along `scan` and varied values as coordinates.

    Readings, if kept, are variables along `scan` and `heading_deg`, or `reading` if scans have different headings; NaN
    for no echo. Raises InputError if the folder is not a finished study, or xarray is not installed.
    """
    xarray = _from_extra("xarray", "labelled results need xarray")
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
    xr = _from_extra("xarray", "labelled results need xarray")
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
    arrays = {name: xr.DataArray(spread(name), dims=("scan", "reading")) for name in names}
    return arrays | {"heading_deg": xr.DataArray(degrees, dims=("scan", "reading"))}


# Workers that compute the parts of a study: this process, several processes, or a Dask cluster.
#
# Parts are returned as soon as they are complete, in any order. A part is the same from any worker.


ANSWER_WITHIN = 10.0  # s, timeout for the scheduler


def parts_here(study: Study, numbers: Sequence[int], workers: int) -> Generator[Part, None, None]:
    """Yield the parts, computed by `workers` processes of this machine. Raises WorkersLost if one is killed."""
    workers = min(workers, len(numbers))
    if workers <= 1:
        yield from (make_part(study, number) for number in numbers)
        return
    # the first part is computed here, so that the workers find the kernels compiled
    first, *others = numbers
    yield make_part(study, first)
    with Processes(min(workers, len(others)), study) as processes:
        try:
            for _, part in processes.answers(make_part, [(number,) for number in others]):
                yield part
        except WorkersLost as error:
            raise WorkersLost("a process of the study was killed; complete parts are kept: resume the study") from error


def parts_on_cluster(study: Study, numbers: Sequence[int], scheduler: str) -> Generator[Part, None, None]:
    """Yield the parts, computed by the Dask cluster of a scheduler. Parts of a lost worker go to the others.

    Raises MissingExtra without Dask, InputError if the scheduler does not answer, WorkersLost if a part fails.
    """
    distributed = _from_extra("distributed", "a scheduler needs Dask")
    # a loss is reported here in one line; Dask would add tracebacks
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(scheduler, timeout=ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"scheduler {scheduler}: no Dask scheduler answers; expected tcp://HOST:PORT") from error
    with client:
        waiting = client.map(make_part, [study] * len(numbers), list(numbers), pure=False)
        finished: Any = distributed.as_completed(waiting, loop=client.loop)
        try:
            for done in finished:
                yield done.result()
                # frees the memory of the worker
                done.release()
        except (distributed.KilledWorker, CancelledError) as error:
            raise WorkersLost(
                "the connection to the cluster or its workers was lost; complete parts are kept: resume the study"
            ) from error


# Running a study: compute and write the missing parts, then finish the folder.


@arguments.checked(
    study=arguments.instance(Study, "the result of `load_study`"),
    folder=arguments.file_name,
    workers=arguments.whole(1),
    scheduler=arguments.text,
    resume=arguments.flag,
    progress=arguments.function,
)
def run_study(
    study: Study,
    folder: Path | str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Callable[[], None] = lambda: None,
) -> None:
    """Predict every scan of a study into `folder`, with `workers` processes (all cores) or the cluster at `scheduler`.

    `progress` is called once for each existing part. Results are the same bit for bit with any number of workers, on
    machines of one kind. Raises InputError if the folder exists already or, with `resume`, belongs to another study.
    Raises MissingExtra if Arrow is not installed. Raises WorkersLost or OutputError if the study cannot finish;
    complete parts are kept.
    """
    check_arrow()  # now, rather than after the first predictions
    folder = Path(folder)
    target = StudyFolder(folder, study)
    numbers = target.begin(resume)
    for _ in range(part_count(study) - len(numbers)):
        progress()
    if folder.exists():
        return
    workers = core_count() if workers is None else workers
    made = parts_on_cluster(study, numbers, scheduler) if scheduler else parts_here(study, numbers, workers)
    try:
        with closing(made) as parts:
            for part in parts:
                target.write(part)
                progress()
    finally:
        target.drop_if_empty()
    target.finish()
