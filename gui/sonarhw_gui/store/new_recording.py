"""Creates the log of a live scan, in the user's folder of recordings, named by date and room."""

import re
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path

from platformdirs import user_data_path

from sonarhw.errors import LogError
from sonarhw.log import LogMetadata, LogWriter
from sonarhw_gui.scene.scene import Scene


def recordings_folder() -> Path:
    """Return the folder of recordings on this system; it may not exist yet."""
    return user_data_path("sonarhw", appauthor=False) / "recordings"


def start_recording(folder: Path, scene: Scene, warn: Callable[[str], None]) -> tuple[LogWriter, Path]:
    """Create a log in `folder`, named by time and room; `warn` is called when the disk is nearly full.

    Raises LogError if the log cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{folder}: cannot be created: {error.strerror}; recordings are stored there") from error
    now = time.time()
    path = free_name(folder, f"{time.strftime('%Y-%m-%d_%H%M%S', time.localtime(now))}_{_name_part(scene)}", ".mcap")
    room = scene.written_room
    metadata = LogMetadata(
        made_by="scan",
        started=now,
        room_file=scene.room_file,
        room_text=room.text if room else "",
        place=scene.pose.name,
        board=scene.board.name,
        board_text=scene.board.text,
    )
    return LogWriter(path, metadata, warn=warn), path


def _name_part(scene: Scene) -> str:
    """Return the room's name without characters that a file system may reject."""
    return re.sub(r"\W+", "-", scene.room.name.lower()).strip("-") or "room" if scene.room else "no-room"


def free_name(folder: Path, stem: str, suffix: str) -> Path:
    """Return a file in `folder` that does not exist: the stem, with a number from 2 on if necessary."""
    names = (folder / f"{stem}{'' if k == 1 else f'_{k}'}{suffix}" for k in count(1))
    return next(name for name in names if not name.exists())
