"""The scans that a search for the room uses, with their names and what is known of their places."""

from dataclasses import replace

from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.evidence import FINE, evidence_of
from sonarhw_gui.jobs.searches import loaded_scans
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown, overlaid
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import OwnBodyPart, load_board
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Reading
from tests.checkout import CHECKOUT

NOWHERE = Scene(None, None, load_board("polaroid-6500"))
ROOM = load_room(CHECKOUT / "rooms" / "simple.toml")
KNOWN = replace(NOWHERE, room=ROOM, place=ROOM.place("figure9"))


def sweep(number: int) -> tuple[Reading, ...]:
    return tuple(Reading(k, number, 0, 0.1 * k, float(k), (0.01,), 343.0) for k in range(3))


def test_each_scan_is_used_once_under_a_name_of_its_own() -> None:
    first, second = sweep(0), sweep(1)
    parts = [overlaid("s", part, NOWHERE) for part in (first, second)]
    hidden = replace(overlaid("hidden", sweep(2), NOWHERE), visible=False)
    shown = Shown(NOWHERE, readings=(*first, *second), overlays=(*parts, hidden))
    scans = loaded_scans(shown, "shown")
    assert [(scan.name, scan.readings) for scan in scans] == [("s", first), ("s 2", second)]
    assert [scan.name for scan in loaded_scans(replace(shown, overlays=()), "shown")] == ["shown"]
    assert loaded_scans(replace(shown, overlays=(), readings=()), "shown") == ()


def test_readings_of_the_own_body_are_left_out_so_that_evidence_belongs_to_the_right_readings() -> None:
    body = OwnBodyPart(from_deg=5.0, to_deg=7.0, nearest=1.0, farthest=2.0)  # contains the reading at 0.1 rad
    scene = replace(NOWHERE, board=replace(NOWHERE.board, own_body=(body,)))
    readings = sweep(0)
    (scan,) = loaded_scans(Shown(scene, readings=readings), "shown")
    assert scan.readings == (readings[0], readings[2])
    evidence = evidence_of([PlacedScan(readings, scan.place)], [PoseSpread()], scan.board, Air())
    assert len(scan.readings) == len(evidence.by_reading(evidence.first, FINE)[0])


def test_a_scan_with_a_known_place_comes_first() -> None:
    shown = Shown(NOWHERE, readings=sweep(0), overlays=(overlaid("k", sweep(1), KNOWN),))
    scans = loaded_scans(shown, "shown")
    assert [(scan.name, scan.has_place) for scan in scans] == [("k", True), ("shown", False)]
    assert scans[0].place is KNOWN.place
