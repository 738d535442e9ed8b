"""The file formats that `sonarhw import` reads besides CSV, each with its file suffixes.

To add a format, write a function `read_x(file, meaning)` in `imports` and add an entry to FORMATS. The command and its
help follow.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw.errors import InputError

if TYPE_CHECKING:
    from sonarhw.readings import Reading
    from sonarhw_compare.foreign_csv import Meaning


@dataclass(frozen=True)
class ImportFormat:
    """One file format."""

    suffixes: tuple[str, ...]  # of the file name, in lower case
    title: str
    has_traces: bool  # of received signals, in place of ranges
    has_step: bool  # without angles of its own, at least in part
    reader: str  # name of a function of `imports`

    def read(self, file: Path, meaning: "Meaning") -> "list[Reading]":
        """Return the readings of a file in this format. Raises InputError."""
        from sonarhw_compare import imports  # loads NumPy, which the help does not need

        readings: list[Reading] = getattr(imports, self.reader)(file, meaning)
        return readings


FORMATS = (
    ImportFormat((".log", ".clf"), "CARMEN logs with SONAR lines", False, False, "read_carmen_log"),
    ImportFormat((".bin",), "Ping Viewer logs of a Ping360", True, False, "read_ping360_log"),
    ImportFormat((".bag",), "ROS bags, also the folder of a bag of ROS 2", False, True, "read_ros_bag"),
    ImportFormat(
        (".wav", ".npy", ".mat"), "raw traces, also as text with a sampling rate", True, True, "read_raw_traces"
    ),
)
_ROS, _RAW = FORMATS[-2:]


def import_format(file: Path, rate: float | None) -> ImportFormat | None:
    """Return the format of a file by its suffix; None: CSV. Raises InputError for a log.

    With a sampling `rate`, text is a table of samples. A folder with the metadata of a bag is a bag of ROS 2; any other
    raises InputError.
    """
    if (file / "metadata.yaml").exists():
        return _ROS
    if file.is_dir():
        raise InputError(f"{file}: is a folder without metadata.yaml; give a file, or the folder of a bag of ROS 2")
    if file.suffix.lower() == ".mcap":
        raise InputError(
            f"{file}: is a log already, which all commands read; of a bag of ROS 2, give the folder with metadata.yaml"
        )
    file_format = next((file_format for file_format in FORMATS if file.suffix.lower() in file_format.suffixes), None)
    return _RAW if file_format is None and rate is not None else file_format


def is_bag(file_format: ImportFormat | None) -> bool:
    """Return whether a format has topics."""
    return file_format is _ROS


def is_raw(file_format: ImportFormat | None) -> bool:
    """Return whether a format is an array of samples, without angles."""
    return file_format is _RAW


def formats_text() -> str:
    """Return the formats and their suffixes as a list in one sentence."""
    return "; ".join(f"{file_format.title} ({', '.join(file_format.suffixes)})" for file_format in FORMATS)
