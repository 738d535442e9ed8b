"""The folder of a study: Parquet part files under `scans` and `headings`, and a manifest.

Takes the bytes of parts as they are done; hands on a folder that has its name only once it is whole. Until then it is
called FOLDER.unfinished, and every part in it is whole: each is written under another name and renamed. What was done
before an interruption is found there again.
"""

import hashlib
import json
import os
import platform
import shutil
from dataclasses import dataclass
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from typing import Any

from sonarhw.errors import InputError, OutputError
from sonarhw_compare.study.arrow import pa, pq
from sonarhw_compare.study.spec import Study
from sonarhw_compare.study.study_scans import predict_scans

MANIFEST = "manifest.json"
FORMAT = 1
_MOST_PER_PART = 500
_PARTS = 40  # in a study of fewer than 20 000 scans
_VERSIONS = ("sonarhw", "numpy", "numba", "scipy", "pyarrow")


@dataclass(frozen=True)
class Part:
    """The results of some scans in a row, as the bytes of Parquet files."""

    number: int
    scans: bytes
    headings: bytes | None  # None where figures alone are kept
    versions: tuple[tuple[str, str], ...]  # of what made it


def scans_per_part(study: Study) -> int:
    """How many scans a part holds: it follows from the study, so that no number of workers makes other files."""
    return min(_MOST_PER_PART, -(-study.scans // _PARTS))


def part_count(study: Study) -> int:
    """How many parts a study has."""
    return -(-study.scans // scans_per_part(study))


def make_part(study: Study, number: int) -> Part:
    """Predict part `number` of a study. Raises InputError where what is drawn for a scan does not go together."""
    size = scans_per_part(study)
    scans, headings = predict_scans(study, number * size, min((number + 1) * size, study.scans))
    return Part(number, _parquet(scans), _parquet(headings) if study.rows == "headings" else None, versions())


def _parquet(table: pa.Table) -> bytes:
    sink = BytesIO()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def versions() -> tuple[tuple[str, str], ...]:
    """What results follow from besides the study: name and version."""
    return ("python", platform.python_version()), *((name, version(name)) for name in _VERSIONS)


def unfinished_of(folder: Path) -> Path:
    """What a study's folder is called until all its parts are there."""
    return folder.with_name(folder.name + ".unfinished")


class StudyFolder:
    """Where the results of one study go."""

    def __init__(self, folder: Path, study: Study) -> None:
        self.folder = folder
        self.unfinished = unfinished_of(folder)
        self._study = study
        self._manifest = _manifest(study)

    def begin(self, resume: bool) -> list[int]:
        """Make the folder, or with `resume` go on with what is there; the parts that are still to do.

        Raises InputError where it is there without `resume` or holds another study, OutputError where none can be made.
        """
        if self.folder.exists():
            if not resume:
                raise InputError(f"{self.folder}: exists already; choose another --out")
            self._check(self.folder)
            return []
        if self.unfinished.exists():
            if not resume:
                raise InputError(f"{self.unfinished}: an interrupted study; add --resume, or remove it")
            self._check(self.unfinished)
        else:
            self._make()
        return [number for number in range(part_count(self._study)) if not self._path("scans", number).exists()]

    def write(self, part: Part) -> None:
        """Keep a part. Raises OutputError where it cannot be written, or was made by other versions than the rest."""
        if part.versions != versions():
            raise OutputError(
                f"{self.unfinished}: a worker has {_named(part.versions)}, here is {_named(versions())}; "
                "results would not be alike: install the same everywhere"
            )
        try:
            # that of scans comes last: it says that the part is done
            if part.headings is not None:
                _write_whole(self._path("headings", part.number), part.headings)
            _write_whole(self._path("scans", part.number), part.scans)
        except OSError as error:
            raise _unwritable(self.unfinished, error) from error

    def drop_if_empty(self) -> None:
        """Remove the unfinished folder where no part was made: there is nothing to go on with."""
        if not any(self.unfinished.glob("scans/part-*.parquet")):
            shutil.rmtree(self.unfinished, ignore_errors=True)

    def finish(self) -> None:
        """Give the folder its name: all its parts are there. Raises OutputError."""
        try:
            self.unfinished.rename(self.folder)
        except OSError as error:
            raise _unwritable(self.folder, error) from error

    def _path(self, kind: str, number: int) -> Path:
        return self.unfinished / kind / f"part-{number:06d}.parquet"

    def _make(self) -> None:
        if not self.folder.parent.is_dir():
            raise InputError(f"{self.folder}: there is no folder {self.folder.parent}; make it first")
        kinds = ("scans", "headings") if self._study.rows == "headings" else ("scans",)
        try:
            for kind in kinds:
                (self.unfinished / kind).mkdir(parents=True)
            _write_whole(self.unfinished / MANIFEST, json.dumps(self._manifest, indent=2).encode())
        except OSError as error:
            raise _unwritable(self.unfinished, error) from error

    def _check(self, there: Path) -> None:
        """Raise InputError where the folder `there` holds another study than this one."""
        held = read_manifest(there)
        changed = [key for key, value in self._manifest.items() if held.get(key) != value]
        if changed:
            raise InputError(
                f"{there}: was begun with other {' and '.join(changed)} than now; "
                "what is done would not fit: put them back, or choose another --out"
            )


def read_manifest(folder: Path) -> dict[str, Any]:
    """What a study's folder says of itself. Raises InputError where it is none."""
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{folder}: is no folder of a study, it has no {MANIFEST} that can be read") from error
    if not isinstance(manifest, dict) or manifest.get("format") != FORMAT:
        raise InputError(f"{folder}: its {MANIFEST} is not one of format {FORMAT}; this version reads no other")
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
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with unfinished.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: {error.strerror or error}; choose another --out")
