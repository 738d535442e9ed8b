"""The place of the scanner. A fake scanner follows the window; any other stays where it is."""

import math
from dataclasses import dataclass
from pathlib import Path

from sonarhw_compare.one_call import FakeUrl, is_fake, moved_fake_url, read_fake_url
from sonarhw_sim.board.profile import Board, board_names, load_board
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import InputError
from sonarhw_gui.model.scene import Scene, first_place, position_name
from sonarhw_gui.session.notices import Notice

_CLOSE = 1e-4  # m or rad


@dataclass(frozen=True)
class ScanRoom:
    """An accepted offer to scan with a fake scanner in another room."""

    url: str  # of the fake scanner
    room: str  # name or file


@dataclass(frozen=True)
class MoveFake:
    """An accepted offer to move the fake scanner to the place shown."""


class ScannerPlace:
    """Where the scanner is, as far as the window knows."""

    def __init__(self, scene: Scene) -> None:
        """`scene`: with the place that is taken for that of the scanner."""
        self._scene = scene
        self._elsewhere: Notice | None = None  # a fake scanner is in another room than the one opened last
        self._url, self._fake = "", _fake_at("")  # for `fake_still`, which must not read files at every tick

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
        """Return the URL of a fake scanner with the place of the room file and the shipped board that are shown.

        The fake keeps what is not from the file, or not shipped. The URL of any other scanner does not change.
        """
        fake = _fake_at(url)
        if fake is None or shown.place is None or not fake.is_in(shown):
            return url
        named = fake.room.places.get(shown.place.name)
        place = named if named == shown.place else None
        if place is not None:
            self._scene = shown
        board = shown.board.name if _is_shipped(shown.board) else fake.settings.board
        if place in (None, fake.place) and board == fake.settings.board:
            return url
        if place is None:
            return moved_fake_url(url, fake.settings.room, fake.place.name, board, fake.settings.heading)
        return moved_fake_url(url, fake.settings.room, place.name, board)

    def moved_here(self, url: str, shown: Scene) -> str:
        """Return the URL of a fake scanner at the place that is shown. Raises InputError if no URL can state it."""
        url = self.follow(url, shown)
        fake, place = _fake_at(url), shown.place
        if fake is None or place is None or not fake.is_in(shown) or _same(fake.place, place):
            return url
        if place.height is not None:
            raise InputError(f"the fake scanner cannot be moved to {place.name}: add it to the places of the room file")
        self._scene = shown
        position = position_name(place.position)
        return moved_fake_url(url, fake.settings.room, position, fake.settings.board, place.heading)

    def fake_still(self, url: str, shown: Scene) -> str:
        """Return where a fake scanner still is, or which board it still has, if that is not what is shown; else ""."""
        if url != self._url:
            self._url, self._fake = url, _fake_at(url)
        return "" if self._fake is None else self._fake.difference(shown)

    def doubts(self, url: str, shown: Scene) -> tuple[Notice, ...]:
        """Return why a scan may not fit the scene that is shown; a moved sensor only once."""
        return tuple(filter(None, (_other_board(url, shown), self._other_place(url, shown))))

    def _other_place(self, url: str, shown: Scene) -> Notice | None:
        was, now = self._scene.pose, shown.pose
        if self._elsewhere is not None or (was.position, was.heading) == (now.position, now.heading):
            return self._elsewhere
        self._scene = shown
        if fake := _fake_at(url):
            still = f"the fake scanner is still at {fake.place.name}; readings are predicted from the place shown"
            return Notice(still, "Move the fake scanner here", MoveFake())
        return Notice("the sensor was moved only in the window; readings are predicted from the place shown")


@dataclass(frozen=True)
class _FakeScanner:
    """A fake scanner in its room."""

    settings: FakeUrl
    room: Room
    place: Place
    board: Board

    def is_in(self, shown: Scene) -> bool:
        """Return whether this is the room shown, maybe edited."""
        return shown.room is not None and shown.room.name == self.room.name

    def difference(self, shown: Scene) -> str:
        """Return the place or board of the scanner if it is not the one shown; else "", also in another room."""
        if shown.place is None or not self.is_in(shown):
            return ""
        if not _same(self.place, shown.place):
            return f"at {self.place.name}"
        return "" if shown.board == self.board else f"with board {self.board.name}"


def _fake_at(url: str) -> _FakeScanner | None:
    """Return the fake scanner of a URL; None for any other scanner, and if a file of it was removed or edited since."""
    if not is_fake(url):
        return None
    try:
        settings = read_fake_url(url)
        room = load_room(settings.room)
        return _FakeScanner(settings, room, settings.place_in(room), load_board(settings.board))
    except InputError:
        return None


def _same(one: Place, other: Place) -> bool:
    """Return whether two places differ by less than what a URL states."""
    turned = math.remainder(one.heading - other.heading, math.tau)
    return math.dist(one.position, other.position) < _CLOSE and abs(turned) < _CLOSE and one.height == other.height


def _is_shipped(board: Board) -> bool:
    return board.name in board_names() and load_board(board.name) == board


def _other_board(url: str, shown: Scene) -> Notice | None:
    """Return a warning if a fake scanner has another board than the one shown."""
    if not is_fake(url) or (its_board := read_fake_url(url).board) == shown.board.name:
        return None
    return Notice(f"the fake scanner has board {its_board!r}; its readings are predicted for {shown.board.name!r}")


def _fake_elsewhere(url: str, path: Path | None, opened: Scene) -> Notice | None:
    """Return an offer to scan with a fake scanner in the opened room, if the one at `url` is a fake in another room."""
    fake = _fake_at(url)
    if fake is None or opened.room is None or fake.room.text == opened.room.text:
        return None
    offer = ScanRoom(url, str(path.absolute()) if path else Path(opened.room_file).stem)
    return Notice(f"the fake scanner is still in {fake.room.name!r}, not in the room shown", "Scan this room", offer)
