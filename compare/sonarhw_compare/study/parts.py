"""The folder of a study: Parquet part files in `scans` and `headings`, and a manifest.

The folder is called FOLDER.unfinished until all parts exist. Each part is written under another name and then renamed,
so every part is complete. After an interruption, the existing parts are reused.
"""

import hashlib
import json
import platform
import shutil
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any

from sonarhw.errors import InputError, OutputError
from sonarhw.files import atomic_file
from sonarhw_compare.study.arrow import pa, pq
from sonarhw_compare.study.spec import Study
from sonarhw_compare.study.study_scans import predict_scans

MANIFEST = "manifest.json"
FORMAT = 1
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
    return folder.with_name(folder.name + ".unfinished")


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

    def _check(self, there: Path) -> None:
        """Raise InputError if the folder `there` belongs to another study."""
        held = read_manifest(there)
        changed = [key for key, value in self._manifest.items() if held.get(key) != value]
        if changed:
            raise InputError(
                f"{there}: belongs to another study, with different {' and '.join(changed)}; "
                "restore them, or choose another folder"
            )


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of the folder of a study. Raises InputError if there is none."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
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
