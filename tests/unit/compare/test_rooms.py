"""Rooms found from scans, and causes of misfits: known changes, derivatives, stated uncertainties and right angles."""

import math
from dataclasses import replace

import numpy as np
import pytest
import tomlkit
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import Pose, PoseSpread
from sonarhw_compare.rooms.candidates import Touches, confirmed
from sonarhw_compare.rooms.causes import MovedWall, NewPost, NewWall, OtherReflectance, find_causes
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft, draft_of_room
from sonarhw_compare.rooms.effort import Effort
from sonarhw_compare.rooms.evidence import FOLLOWED, ROUGH, Course, Evidence, evidence_of, scored
from sonarhw_compare.rooms.frame import SOLVED, in_frame, with_solved_headings
from sonarhw_compare.rooms.outcome import found_room, found_room_figures, found_room_text, next_places, verdict_of
from sonarhw_compare.rooms.refinement import Move, deviations_of, moves_of, range_errors, refined
from sonarhw_compare.rooms.search import FoundRoom, squared
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.rays.small_waves import SmallWalls
from sonarhw_sim.room.room import Place, load_room, parse_room, with_walls

from sonarhw.errors import InputError
from tests.fixtures.predicted_readings import predicted_readings, predicted_scan
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("polaroid-6500")
QUICK = load_board("hc-sr04")  # hears only loud echoes, so the search of paths is quick


# Causes of misfits.


YARD = """name = "Yard with a plate"
[materials.board]
reflectance = 0.9
[[walls]]
name = "yard"
points = [[-1.0, -1.0], [3.0, -1.0], [3.0, 3.0], [-1.0, 3.0]]
closed = true
material = "board"
edges = ["south", "east", "north", "west"]
[[walls]]
name = "plate"
points = [[1.0, 1.1], [1.6, 1.1]]
material = "board"
edges = ["plate"]
[places.here]
position = [0.0, 1.1]
"""
GIVEN = parse_room(YARD, "the yard")
HERE = GIVEN.places["here"]
Change = NewPost | NewWall | MovedWall | OtherReflectance


@pytest.mark.parametrize(
    ("true", "text"),
    [
        (NewPost((0.3, 0.3), 0.03), "something near 0.3"),
        (MovedWall("west", -0.02, 0.02), "wall west is 0.0"),
        (OtherReflectance("plate", 0.9, 0.1), "edge plate/ is weaker than assumed"),
        (None, ""),
    ],
    ids=["post", "moved wall", "weak edge", "nothing"],
)
def test_what_differs_in_the_room_is_found(true: Change | None, text: str) -> None:
    room = GIVEN if true is None else true.applied(GIVEN)
    shares: list[float] = []
    found = find_causes(predicted_readings(room, HERE, BOARD, noise=0.01), GIVEN, HERE, BOARD, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len([share for share in shares if 0.05 < share < 0.6]) > 10  # it moves during the first search, too
    if true is None:
        assert (found.causes, found.room) == ((), GIVEN)
        return
    cause = found.causes[0]
    assert text in cause.text()
    match cause.change:
        case NewPost(center=center):  # one place does not show how far behind its nearest point the middle is
            assert isinstance(true, NewPost)
            assert math.dist(center, true.center) < 0.06
            to_post = math.degrees(math.atan2(0.3 - 1.1, 0.3)) % 360
            assert any(math.degrees(a) - 1 <= to_post <= math.degrees(b) + 1 for a, b in cause.sectors)
        case MovedWall(wall=wall, farther=farther):
            assert (wall, farther) == ("west", pytest.approx(0.02, abs=0.006))
            assert "m farther" in cause.text()
        case OtherReflectance(reflectance=reflectance):
            assert reflectance < 0.5
        case other:
            pytest.fail(repr(other))
    before, after = (one.summary().within_5cm or 0.0 for one in (found.before, found.after))
    assert after > max(before, 0.95)


def test_a_wall_that_faces_no_place_is_found_by_its_edge() -> None:
    room, ends = load_room("kuc_siegel"), ((0.182, 0.306), (0.238, 0.134))
    place = room.places["figure6"]
    scan = predicted_readings(NewWall(*ends).applied(room), place, BOARD, 5.0, noise=0.01, every=True)
    change = find_causes(scan, room, place, BOARD).causes[0].change
    assert isinstance(change, NewWall)
    assert all(math.dist(*pair) < 0.06 for pair in zip(sorted([change.start, change.end]), ends, strict=True))


@pytest.mark.parametrize(
    "change",
    [
        NewPost((0.5, 0.5), 0.1),
        NewWall((0.5, 0.5), (0.7, 0.5)),
        MovedWall("east", 0.05, -0.05),
        OtherReflectance("north", 0.9, 0.4),
    ],
)
def test_a_changed_room_is_the_room_of_its_text(change: Change) -> None:
    changed = change.applied(GIVEN)
    again = parse_room(changed.text, "again")
    for name in ("walls", "posts", "reflectances"):
        assert np.array_equal(getattr(again, name), getattr(changed, name))
    assert changed.text != GIVEN.text
    if isinstance(change, MovedWall):  # it stretches its neighbours
        assert changed.walls[changed.names.index("south")].tolist() == [-1.0, -1.0, 2.95, -1.0]
    if isinstance(change, NewPost):
        with pytest.raises(InputError, match=r"a post at 0\.54, 0\.50.* overlaps another one"):
            NewPost((0.54, 0.5), 0.02).applied(changed)


# Refinement by ranges, and what is stated about it.


ROOM = polygon_room(
    [(0.0, 0.0), (3.0, 0.1), (3.0, 1.4), (1.8, 1.4), (1.8, 2.4), (0.0, 2.4)],
    extra='[[posts]]\nname = "post"\ncenter = [0.9, 1.5]\nradius = 0.06\nmaterial = "hard"',
)
PLACES = tuple(Place(name, at) for name, at in (("a", (0.6, 0.7)), ("b", (1.3, 1.9)), ("c", (2.4, 0.6))))


def case(
    noise: float = 0.0, seed: int = 0, spread: PoseSpread = PoseSpread(), board: Board = QUICK, true: Board = QUICK
) -> tuple[Evidence, RoomDraft]:
    """Return scans of the true room as evidence, and the room as a draft."""
    scans = [
        predicted_scan(ROOM, place, true, 4.0, noise=noise, seed=3 * seed + k, options=FOLLOWED)
        for k, place in enumerate(PLACES)
    ]
    return evidence_of(scans, [spread] * 3, board, ROOM.air), replace(draft_of_room(ROOM), places=PLACES)


def test_derivatives_agree_with_a_new_search_of_paths() -> None:
    # without late detection, by which a range depends on levels too
    ideal = replace(QUICK, receiver=Receiver.FIRST_ECHO)
    evidence, draft = case(spread=PoseSpread(0.1, 0.1), board=ideal, true=ideal)
    moves = moves_of(evidence, draft)
    found, by, checked = range_errors(evidence, draft, moves), 1e-4, 0
    for row, move in enumerate(moves):
        other = range_errors(evidence, move.of(draft, by), moves)
        if other.of_range == found.of_range:  # else an echo has appeared or disappeared
            change = (found.errors[: found.of_range] - other.errors[: found.of_range]) / by
            expected = found.slopes[: found.of_range, row]
            # a few headings have another path now
            assert (np.abs(change - expected) < 0.01 * np.abs(found.slopes).max()).mean() > 0.98, move
            checked += int((np.abs(expected) > 0.1 * np.abs(found.slopes).max()).sum())
    assert checked > 300


def test_what_the_ranges_do_not_determine_is_stated_as_unknown() -> None:
    evidence, true = case()
    hidden = replace(true, posts=(*true.posts, DraftPost((5.0, 5.0), 0.05)))  # outside the room
    deviations = {(move.what, move.which, move.part): one for move, one in deviations_of(evidence, hidden).items()}
    assert deviations["post", 1, 0] > 0.2
    assert deviations["wall", 0, 0] < 0.01
    rough = deviations_of(*case(spread=PoseSpread(0.03, 0.03)))
    # three places share their error
    assert min(one for move, one in rough.items() if (move.what, move.part) == ("wall", 0)) > 0.9 * 0.03 / math.sqrt(3)


def test_errors_that_neighbouring_readings_share_make_a_wall_less_certain() -> None:
    evidence, true = case(0.005)
    by_turn = 2 * 0.02 / ROOM.air.speed_of_sound  # s, of 2 cm

    def shifted(scan: PlacedScan) -> PlacedScan:
        """Return a scan with ranges that are too long by 2 cm in each second eighth of a turn, else too short."""
        signs = [1 if int(reading.angle / (math.pi / 4)) % 2 else -1 for reading in scan.readings]
        readings = [
            replace(reading, echo_times=tuple(time + sign * by_turn for time in reading.echo_times))
            for sign, reading in zip(signs, scan.readings, strict=True)
        ]
        return replace(scan, readings=readings)

    real = evidence_of([*map(shifted, evidence.scans)], [PoseSpread()] * 3, QUICK, ROOM.air)
    ideal_deviations, deviations = deviations_of(evidence, true), deviations_of(real, true)
    for key in true.walls:
        wall = Move("wall", key, 0)
        assert deviations[wall] > 2 * ideal_deviations[wall]


def test_a_range_offset_is_found_if_the_board_describes_a_population() -> None:
    for spread, offset in ((0.016, 0.015), (0.0, 0.0)):
        board = replace(QUICK, range_sd=spread)
        evidence, true = case(0.005, board=board, true=replace(QUICK, range_offset=0.015))
        assert refined(evidence, true, ROUGH, 8).draft.offset == pytest.approx(offset, abs=0.004)


# Right angles.


@pytest.mark.parametrize(
    ("east", "places", "angle"),
    [((2.0, 2.0), [(0.5, 1.0)], 0.26), ((2.4, 1.8), [(0.5, 1.0), (1.0, 1.8), (1.4, 0.6)], None)],
    ids=["one place faces it", "several places face it"],
)
def test_a_wall_is_squared(east: tuple[float, float], places: list[tuple[float, float]], angle: float | None) -> None:
    room = polygon_room([(0.0, 0.0), (east[0], 0.0), (east[1], 3.0), (0.0, 3.0)])
    scans = [predicted_scan(room, Place(str(k), at), BOARD, 4.0, options=FOLLOWED) for k, at in enumerate(places)]
    evidence = evidence_of(scans, [PoseSpread()] * len(scans), BOARD, room.air)
    draft = true = replace(draft_of_room(room), places=tuple(scan.place for scan in scans))
    if angle is not None:  # turned about the place: its range is the same
        middle = (0.5 + 1.5 * math.cos(angle), 1.0 + 1.5 * math.sin(angle))
        turned = DraftWall(middle, math.pi / 2 + angle, (DraftEnd(-0.9), DraftEnd(0.9)))
        draft = true.without_only(1).with_wall(1, turned)
    found = squared(evidence, scored(evidence, draft)).draft
    assert found.walls[1].angle == pytest.approx(true.walls[1].angle, abs=math.radians(1.0))


# The frame: headings of all scans together, and the direction of the whole room.


def test_headings_follow_from_written_positions_and_a_rough_heading_is_a_prior() -> None:
    room, board = load_room("arena"), load_board("lego-nxt")
    true = np.radians([130.0, -77.0, 10.0, 200.0, 55.0])
    at = [replace(place, heading=float(turn)) for place, turn in zip(room.places.values(), true, strict=True)]
    scans = [PlacedScan(predicted_readings(room, place, board, 6.0), replace(place, heading=0.0)) for place in at]
    spreads = [PoseSpread(0.03, math.inf)] * len(scans)
    solved, known = with_solved_headings(scans, spreads, board, SOLVED)
    turned = [math.remainder(scan.place.heading - turn, math.tau) for scan, turn in zip(solved, true, strict=True)]
    assert np.degrees(np.abs(turned)).max() < 9
    assert {spread.heading for spread in known} == {SOLVED}
    # two positions do not determine headings, and known headings stay
    assert with_solved_headings(scans[:2], spreads[:2], board, SOLVED) == (tuple(scans[:2]), tuple(spreads[:2]))
    sure = [PoseSpread(0.03, SOLVED)] * len(scans)
    assert with_solved_headings(scans, sure, board, SOLVED)[0] == tuple(scans)


def test_a_room_is_turned_as_a_whole_to_written_positions_unless_a_pose_is_exact() -> None:
    room, board = load_room("arena"), load_board("lego-nxt")
    places = tuple(room.places.values())
    scans = [PlacedScan(predicted_readings(room, place, board, 30.0), place) for place in places]
    oblique = DraftWall((1.0, 1.0), math.radians(7), (DraftEnd(-1.5), DraftEnd(1.5)))  # a wrong one does not count
    true = replace(draft_of_room(room), places=places).with_new_wall(oblique)[0]
    turned = true.turned(math.radians(7), (1.0, 1.0), (1.02, 0.99))
    written = [PoseSpread(0.03, math.radians(20))] * len(places)
    moved = in_frame(evidence_of(scans, written, board, room.air), turned)
    assert np.abs(moved.segments[:-1] - room.walls).max() < 0.003
    exact = [PoseSpread(), *written[1:]]
    assert in_frame(evidence_of(scans, exact, board, room.air), turned) is turned


def test_no_search_for_a_room_solves_the_small_walls_of_its_drafts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of thousands of drafts has other ones, which took up to 25 s, and no search ends within a draft."""
    niche = [(2.0, 1.0), (2.03, 1.0), (2.03, 1.04), (2.0, 1.04)]
    room = polygon_room([(0.0, 0.0), (2.0, 0.0), *niche, (2.0, 2.0), (0.0, 2.0)])
    here, board = Place("here", (1.0, 1.0)), load_board("polaroid-6500")
    scan, draft = predicted_scan(room, here, board, 10.0), replace(draft_of_room(room), places=(here,))

    def solved(small: SmallWalls, *_: object) -> None:
        raise AssertionError(f"solved: {small.walls}")

    monkeypatch.setattr(SmallWalls, "sound", solved)
    with pytest.raises(AssertionError, match="solved"):
        predict_scan(room, here, board, np.zeros(1))
    for effort in Effort:
        evidence = evidence_of([scan], [PoseSpread()], board, room.air, Course(effort=effort))
        assert scored(evidence, draft).score > scored(evidence, draft.without_wall(0)).score


# What several places confirm.


def test_an_oblique_wall_that_one_place_alone_shows_is_not_confirmed() -> None:
    room, board = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]), load_board("lego-nxt")
    furnished = with_walls(room, np.array([[0.1, 0.9, 0.9, 0.1]]), "cabinet", 0.9)
    places = [Place(str(at), at) for at in ((1.0, 1.0), (0.8, 1.3), (1.3, 0.8))]
    draft = replace(draft_of_room(furnished), places=tuple(places))
    for shown_to, kept in ((1, 4), (3, 5)):
        rooms = [furnished] * shown_to + [room] * (3 - shown_to)
        scans = [predicted_scan(of, at, board, 10.0) for of, at in zip(rooms, places, strict=True)]
        evidence = evidence_of(scans, [PoseSpread(0.03, SOLVED)] * 3, board, room.air)
        assert list(confirmed(evidence, draft).walls) == list(range(kept))


# What is reported of a found room.


def test_the_file_of_a_found_room_names_each_place_and_how_certain_it_is() -> None:
    """A room of a wall and a post, found from two logs with the same file name."""
    places = Place("scan", (1.0, 0.5)), Place("scan", (2.0, 0.7), math.radians(10))
    wall = DraftWall((1.5, 2.0), 0.0, (DraftEnd(-1.0), DraftEnd(1.0)))
    parts = [("wall", 3, 0), ("wall", 3, 1), *(("post", 0, k) for k in range(3)), *(("place", 1, k) for k in range(3))]
    poses = (Pose((2.0, 0.7), 0.17, 0.0, 0.64, (0.0,) * 3), Pose((1.0, 1.3), 3.0, 0.0, 0.36, (0.0,) * 3))
    found = FoundRoom(
        RoomDraft(places, {3: wall}, (DraftPost((0.5, 1.0), 0.1),)),
        {Move(*part): 0.001 * number for number, part in enumerate(parts, 1)},
        Touches({3: ()}, (7,), (20, 20), (1, 2)),
        0.0,
        scans=tuple(PlacedScan((), at, "scan", f"{folder}/scan.mcap") for at, folder in zip(places, "ab", strict=True)),
        poses={"b/scan.mcap": poses},
        left_out=("c/other.mcap",),
        unconfirmed=RoomDraft((), {1: wall}, (DraftPost((3.0, 1.0), 0.1),)),
    )
    named = {name: place.position for name, place in found_room(found, BOARD).places.items()}
    assert named == {"scan": (1.0, 0.5), "scan-2": (2.0, 0.7)}
    text = found_room_text(found, BOARD)
    assert "position = [2.0, 0.7] # ± 6.0 mm in x, ± 7.0 mm in y\nheading_deg = 10.0 # ± 0.46°" in text
    assert "position = [1.0, 0.5]\nheading_deg = 0.0\n" in text  # exact
    assert "# Possible poses of b/scan.mcap: 64.0% at 2.000, 0.700 m, turntable step 0 at 9.7°; 36.0% at 1.0" in text
    assert "# Left out, because its pose was not found: c/other.mcap\n" in text
    removed = "(0.50, 2.00) to (2.50, 2.00); a post at (3.00, 1.00)"
    assert f"# Left out, because no two places confirm them (m): {removed}.\n" in text
    assert tomlkit.parse(text)["name"] == "Found room"
    (post,) = found_room_figures(found)["posts"]
    assert (post["center_m"], post["center_sd_m"], post["radius_sd_m"]) == ([0.5, 1.0], [0.003, 0.004], 0.005)


NAMES = ("east", "north", "west", "south")


def rectangle(**deviations: float) -> FoundRoom:
    """Return a room of 4 by 2 m, whose walls have these standard deviations across (m), all others none."""
    drawn = {}
    for key, middle in enumerate([(4.0, 1.0), (2.0, 2.0), (0.0, 1.0), (2.0, 0.0)]):
        half = 1.0 if key % 2 == 0 else 2.0
        ends = DraftEnd(-half, (key - 1) % 4), DraftEnd(half, (key + 1) % 4)
        drawn[key] = DraftWall(middle, math.pi / 2 + key * math.pi / 2, ends)
    moves = {Move("wall", key, 0): deviations.get(name, 0.0) for key, name in enumerate(NAMES)}
    return FoundRoom(RoomDraft((Place("a", (2.0, 1.0)),), drawn), moves, Touches({}, (), (), ()), 0.0)


@pytest.mark.parametrize(
    ("unexplained", "seen", "left_out", "reasons"),
    [
        ((2, 1, 3), 3, (), ()),
        ((12, 12, 1), 3, (), ("only 58% of 60 echoes", "2 of 3 scans do not fit")),
        ((0, 0, 10), 3, (), ("1 of 3 scans does not fit",)),
        ((2, 1, 3), 1, (), ("4 of 4 walls returned echoes to one scan only",)),
        ((2, 1, 3), 3, ("d", "e"), ("2 of 5 scans do not fit",)),
    ],
)
def test_what_explains_few_echoes_or_is_seen_from_one_place_is_no_room(
    unexplained: tuple[int, ...], seen: int, left_out: tuple[str, ...], reasons: tuple[str, ...]
) -> None:
    scans = tuple(PlacedScan((), Place(name, (1.0, 1.0)), name) for name in "abc")
    touches = Touches({}, (), (20,) * 3, unexplained, dict.fromkeys(range(4), frozenset(range(seen))))
    found = replace(rectangle(), touches=touches, scans=scans, left_out=left_out)
    verdict = verdict_of(found)
    assert [reason for reason in verdict.reasons if reason.startswith(reasons)] == list(verdict.reasons)
    assert (len(verdict.reasons), verdict.is_room) == (len(reasons), not reasons)
    assert set(left_out) <= set(verdict.misfits)


def test_a_scan_far_from_its_stated_position_refutes_the_room() -> None:
    scans = tuple(PlacedScan((), Place(name, (1.0, 1.0)), name) for name in "abc")
    touches = Touches({}, (), (20,) * 3, (1, 1, 1), dict.fromkeys(range(4), frozenset(range(3))))
    found = replace(rectangle(), touches=touches, scans=scans, displaced={"b": (0.25, 0.03)})
    assert verdict_of(found).reasons == ("b is 0.25 m from its stated position, ± 0.03 m",)


def test_the_next_scan_is_proposed_where_most_readings_are_of_an_uncertain_wall_and_towards_it() -> None:
    def proposed(found: FoundRoom) -> list[tuple[tuple[float, float], float, object]]:
        places = next_places(found, found.draft.room(Air()), BOARD)
        return [(one.position, one.gain, one.sectors) for one in places]

    (first, gain, sectors), *others = proposed(rectangle(east=0.03))
    # one reading tells ½ ln(1 + 3²) = 1.15 nats; some twenty of them three halves more
    assert 1.15 < gain < 0.5 * math.log1p(72 * 9 * 4)
    assert (len(others), gain >= others[0][1]) == (2, True)
    assert any(a <= angle <= b for a, b in sectors for angle in (0.0, math.tau))  # type: ignore[attr-defined]
    assert 0.15 < first[0] < 3.85
    small, large = (proposed(rectangle(north=sd))[0] for sd in (0.02, 0.08))
    assert large[1] - small[1] == pytest.approx(math.log(4), abs=0.05)
    assert [one[1:] for one in proposed(rectangle())] == [(0.0, ())] * 3  # nothing is gained in a room that is known
