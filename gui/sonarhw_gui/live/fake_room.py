"""The room of a fake scanner: it does not change when the window opens another room."""

from dataclasses import dataclass
from pathlib import Path

from sonarhw_compare.scanners.fake_url import fake_url, is_fake, read_fake_url
from sonarhw_sim.room.model import load_room

from sonarhw.errors import InputError
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.notices import Notice


@dataclass(frozen=True)
class ConnectScanner:
    """An accepted offer to connect another scanner."""

    url: str


def fake_elsewhere(url: str, path: Path | None, opened: Scene) -> Notice | None:
    """Return an offer to connect a fake scanner in the opened room, if the one at `url` is in another room.

    `path`: the file of the opened room; None for a shipped one. None for other scanners.
    """
    if not is_fake(url) or opened.room is None:
        return None
    try:
        its_room = load_room(read_fake_url(url).room)
    except InputError:
        return None  # its file has been removed or edited since
    if its_room.text == opened.room.text:
        return None
    room = str(path.absolute()) if path else Path(opened.room_file).stem
    connected = ConnectScanner(fake_url(room, opened.pose.name, opened.board.name))
    return Notice(f"the fake scanner is still in {its_room.name!r}, not in the room shown", "Scan this room", connected)
