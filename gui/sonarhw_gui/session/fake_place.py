"""Where the scanner is: a fake scanner that the window opened follows the plan, any other stays where it is."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from sonarhw_sim.room.room import Place

from sonarhw_gui.model.scene import Scene, room_name
from sonarhw_gui.session.scanner import ScannerOpener, ScannerTarget

FAKE = "fake scanner, hides a post"
_MEANS = (
    "A fake scanner simulates its room, which deliberately differs from the room file: one additional post, a sensor "
    "some millimetres away, and air of another temperature. View > Causes searches for the post"
)
_FOLLOWS = "Each scan takes the room, the place and the board that are shown when it begins"
_STAYS = "It stays in its room, at its place and with its board"
_CLOSE = 1e-4  # m or rad; a `fake:` URL states no more


class FakeNote(NamedTuple):
    """What the status bar says of a fake scanner."""

    text: str = FAKE
    tip: str = _MEANS


@dataclass(frozen=True)
class ScannerPlace:
    """The scene in which the scanner is, as far as the window knows."""

    scene: Scene
    fake: bool = False  # whether it is a fake scanner in this process, whose scene is known
    follow: Callable[[Scene], ScannerOpener] | None = None  # opens a fake scanner that follows the plan in its scene

    def moved(self, shown: Scene) -> "ScannerPlace":
        """Return the place when another scene is opened: only that of a fake scanner is known better."""
        return self if self.fake else replace(self, scene=shown)

    def is_in(self, shown: Scene) -> bool:
        """Return whether a scan is made in exactly the scene that is shown."""
        room, other = self.scene.room, shown.room
        same_room = room is other or (room is not None and other is not None and room.text == other.text)
        return same_room and (self.scene.place, self.scene.board) == (shown.place, shown.board)

    def difference(self, shown: Scene) -> str:
        """Return where a fake scanner is, or which board it has, if that is not what is shown; else empty."""
        own, place = self.scene, shown.place
        if not self.fake or own.place is None or place is None:
            return ""
        if room_name(own) != room_name(shown):
            return f"in {room_name(own)!r}"
        if not _is_same(own.place, place):
            return f"at {own.place.name}"
        return "" if own.board == shown.board else f"with board {own.board.name}"

    def note(self, shown: Scene) -> FakeNote:
        """Return what is to be known of a fake scanner: where it is if that is not what is shown, or what it hides."""
        text = FAKE
        if where := self.difference(shown):
            text = f"fake scanner, {f'still {where}' if self.follow is None else f'{where} until the next scan'}"
        return FakeNote(text, f"{_MEANS}. {_STAYS if self.follow is None else _FOLLOWS}")

    def doubt(self, shown: Scene) -> str:
        """Return why a scan does not fit the scene that is shown; else empty."""
        if self.fake:
            where = self.difference(shown)
            return f"the fake scanner is still {where}; readings are predicted for what is shown" if where else ""
        was, now = self.scene.pose, shown.pose
        if (was.position, was.heading) == (now.position, now.heading):
            return ""
        return "the sensor was moved only in the window; readings are predicted from the place shown"


def place_of(scanner: ScannerTarget | None, shown: Scene) -> ScannerPlace:
    """Return the place of a scanner that is used from now on."""
    if scanner is None or scanner.scene is None:
        return ScannerPlace(shown)
    return ScannerPlace(scanner.scene, fake=True, follow=scanner.follow)


def _is_same(one: Place, other: Place) -> bool:
    turned = math.remainder(one.heading - other.heading, math.tau)
    return math.dist(one.position, other.position) < _CLOSE and abs(turned) < _CLOSE and one.height == other.height
