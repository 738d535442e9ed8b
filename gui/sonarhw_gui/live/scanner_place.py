"""The place of the scanner. A fake scanner follows the window; any other stays where it is."""

from dataclasses import dataclass
from pathlib import Path

from sonarhw_compare.scanners.fake_url import is_fake, moved_fake_url, read_fake_url
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.room.model import load_room

from sonarhw.errors import InputError
from sonarhw_gui.scene.scene import Scene, first_place
from sonarhw_gui.shown.notices import Notice


@dataclass(frozen=True)
class ScanRoom:
    """An accepted offer to scan with a fake scanner in another room."""

    url: str  # of the fake scanner
    room: str  # name or file


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

    def moved_fake(self, offer: ScanRoom, shown: Scene) -> str:
        """Return the URL of the fake scanner in the room of the offer. Raises InputError if the room is invalid."""
        first = first_place(load_room(offer.room))
        self._elsewhere = None
        return self.follow(moved_fake_url(offer.url, offer.room, first.name, read_fake_url(offer.url).board), shown)

    def follow(self, url: str, shown: Scene) -> str:
        """Return the URL of a fake scanner with the place and the board that are shown, as far as a URL can name them.

        That is a place of the room file, and a shipped board. The URL of any other scanner does not change.
        """
        if not is_fake(url):
            return url
        try:
            fake = read_fake_url(url)
            room = load_room(fake.room)
            here = room.place(fake.place)
        except InputError:
            return url  # its file has been removed or edited since
        if shown.room is None or shown.place is None or shown.room.name != room.name:
            return url
        place = room.places.get(shown.place.name, here)
        if place == shown.place:
            self._scene = shown
        else:
            place = here
        board = shown.board.name if _is_shipped(shown.board) else fake.board
        same = (place, board) == (here, fake.board)
        return url if same else moved_fake_url(url, fake.room, place.name, board)

    def doubts(self, url: str, shown: Scene) -> tuple[Notice, ...]:
        """Return why a scan may not fit the scene that is shown; a moved sensor only once."""
        return tuple(filter(None, (_other_board(url, shown), self._other_place(shown))))

    def _other_place(self, shown: Scene) -> Notice | None:
        was, now = self._scene.pose, shown.pose
        if self._elsewhere is not None or (was.position, was.heading) == (now.position, now.heading):
            return self._elsewhere
        self._scene = shown
        return Notice("the sensor was moved only in the window; readings are predicted from the place shown")


def _is_shipped(board: Board) -> bool:
    return board.name in board_names() and load_board(board.name) == board


def _other_board(url: str, shown: Scene) -> Notice | None:
    """Return a warning if a fake scanner has another board than the one shown."""
    if not is_fake(url) or (its_board := read_fake_url(url).board) == shown.board.name:
        return None
    return Notice(f"the fake scanner has board {its_board!r}; its readings are predicted for {shown.board.name!r}")


def _fake_elsewhere(url: str, path: Path | None, opened: Scene) -> Notice | None:
    """Return an offer to scan with a fake scanner in the opened room, if the one at `url` is a fake in another room."""
    if not is_fake(url) or opened.room is None:
        return None
    try:
        its_room = load_room(read_fake_url(url).room)
    except InputError:
        return None  # its file has been removed or edited since
    if its_room.text == opened.room.text:
        return None
    offer = ScanRoom(url, str(path.absolute()) if path else Path(opened.room_file).stem)
    return Notice(f"the fake scanner is still in {its_room.name!r}, not in the room shown", "Scan this room", offer)
