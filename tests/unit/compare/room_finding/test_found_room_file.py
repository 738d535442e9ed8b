"""The file of a found room names each place, says how certain it is, and which other poses are possible."""

import math

import tomlkit
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import Pose
from sonarhw_compare.rooms.candidates import Touches
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.rooms.outcome import found_room, found_room_figures, found_room_text
from sonarhw_compare.rooms.refinement import Move
from sonarhw_compare.rooms.search import FoundRoom
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place

BOARD = load_board("polaroid-6500")
PLACES = Place("scan", (1.0, 0.5)), Place("scan", (2.0, 0.7), math.radians(10))


def found() -> FoundRoom:
    """Return a room of a wall and a post, found from two logs with the same file name."""
    draft = RoomDraft(
        PLACES, {3: DraftWall((1.5, 2.0), 0.0, (DraftEnd(-1.0), DraftEnd(1.0)))}, (DraftPost((0.5, 1.0), 0.1),)
    )
    parts = [("wall", 3, 0), ("wall", 3, 1), ("post", 0, 0), ("post", 0, 1), ("post", 0, 2)]
    parts += [("place", 1, part) for part in range(3)]
    deviations = {Move(*part): 0.001 * number for number, part in enumerate(parts, 1)}
    touches = Touches({3: ()}, (7,), (20, 20), (1, 2))
    scans = tuple(PlacedScan((), at, "scan", f"{folder}/scan.mcap") for at, folder in zip(PLACES, "ab", strict=True))
    poses = (Pose((2.0, 0.7), 0.17, 0.0, 0.64, (0.0,) * 3), Pose((1.0, 1.3), 3.0, 0.0, 0.36, (0.0,) * 3))
    left_out = ("c/other.mcap",)
    return FoundRoom(draft, deviations, touches, 0.0, scans=scans, poses={"b/scan.mcap": poses}, left_out=left_out)


def test_places_of_logs_with_one_name_are_both_in_the_file() -> None:
    places = found_room(found(), BOARD).places
    assert {name: place.position for name, place in places.items()} == {"scan": (1.0, 0.5), "scan-2": (2.0, 0.7)}


def test_comments_state_how_certain_a_place_is_and_where_else_it_can_be() -> None:
    text = found_room_text(found(), BOARD)
    assert "position = [2.0, 0.7] # ± 6.0 mm in x, ± 7.0 mm in y\nheading_deg = 10.0 # ± 0.46°" in text
    assert "position = [1.0, 0.5]\nheading_deg = 0.0\n" in text  # exact
    assert "# Possible poses of b/scan.mcap: 64.0% at 2.000, 0.700 m, turntable step 0 at 9.7°; 36.0% at 1.0" in text
    assert "# Left out, because its pose was not found: c/other.mcap\n" in text
    assert tomlkit.parse(text)["name"] == "Found room"


def test_figures_of_a_post_have_standard_deviations() -> None:
    (post,) = found_room_figures(found())["posts"]
    assert post["center_m"] == [0.5, 1.0]
    assert (post["center_sd_m"], post["radius_sd_m"]) == ([0.003, 0.004], 0.005)
