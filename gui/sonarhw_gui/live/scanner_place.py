"""The place of the scanner, which does not change when the window moves the sensor or opens another room."""

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


class ScannerPlace:
    """Where the scanner is, as far as the window knows."""

    def __init__(self, scene: Scene) -> None:
        """`scene`: with the place that is taken for that of the scanner."""
        self._scene = scene
        self._elsewhere: Notice | None = None  # a fake scanner is in another room than the one opened last

    def confirm(self, scene: Scene) -> None:
        """Take the place of this scene for that of a scanner that was connected."""
        self._scene, self._elsewhere = scene, None

    def enter_room(self, url: str, path: Path | None, opened: Scene) -> Notice | None:
        """Take the place in an opened room for that of the scanner at `url`.

        Return an offer if it is a fake in another room. `path`: the file of the room; None for a shipped room.
        """
        self._scene, self._elsewhere = opened, _fake_elsewhere(url, path, opened)
        return self._elsewhere

    def doubt(self, shown: Scene) -> Notice | None:
        """Return why a scan may not fit the scene that is shown, if it may not; a moved sensor only once."""
        was, now = self._scene.pose, shown.pose
        if self._elsewhere is not None or (was.position, was.heading) == (now.position, now.heading):
            return self._elsewhere
        self._scene = shown
        return Notice("the sensor was moved only in the window; readings are predicted from the place shown")


def _fake_elsewhere(url: str, path: Path | None, opened: Scene) -> Notice | None:
    """Return an offer to connect a fake scanner in the opened room, if the one at `url` is a fake in another room."""
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
