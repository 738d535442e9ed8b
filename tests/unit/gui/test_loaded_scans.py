"""The scans that a search for the room uses, with their names and what is known of their places."""

from dataclasses import replace

from sonarhw_gui.finding.loaded_scans import loaded_scans
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.overlaid_scan import overlaid
from sonarhw_gui.shown.shown import Shown
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.model import load_room

from sonarhw.readings import Reading
from tests.checkout import CHECKOUT

NOWHERE = Scene(None, None, load_board("polaroid-6500"))
ROOM = load_room(CHECKOUT / "rooms" / "simple.toml")
KNOWN = replace(NOWHERE, room=ROOM, place=ROOM.place("figure9"))


def sweep(number: int) -> tuple[Reading, ...]:
    return tuple(Reading(k, number, 0, 0.1 * k, float(k), (0.01,), 343.0) for k in range(3))


def test_each_scan_is_used_once_under_a_name_of_its_own() -> None:
    first, second = sweep(0), sweep(1)
    parts = [overlaid("s", part, NOWHERE, 0) for part in (first, second)]
    hidden = replace(overlaid("hidden", sweep(2), NOWHERE, 0), visible=False)
    shown = Shown(NOWHERE, readings=(*first, *second), overlays=(*parts, hidden))
    scans = loaded_scans(shown, "shown")
    assert [(scan.name, scan.readings) for scan in scans] == [("s", first), ("s 2", second)]
    assert [scan.name for scan in loaded_scans(replace(shown, overlays=()), "shown")] == ["shown"]
    assert loaded_scans(replace(shown, overlays=(), readings=()), "shown") == ()


def test_a_scan_with_a_known_place_comes_first() -> None:
    shown = Shown(NOWHERE, readings=sweep(0), overlays=(overlaid("k", sweep(1), KNOWN, 0),))
    scans = loaded_scans(shown, "shown")
    assert [(scan.name, scan.known) for scan in scans] == [("k", True), ("shown", False)]
    assert scans[0].place is KNOWN.place
