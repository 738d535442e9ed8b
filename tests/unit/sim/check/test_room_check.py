"""Each probable mistake in a room gets a finding, and the shipped rooms have none."""

import pytest
from sonarhw_sim import check
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.check import check_room, extent, plan_findings, reason_for_silence, refusals_of
from sonarhw_sim.rays import fan
from sonarhw_sim.room.room import load_room, parse_room, room_names

BOX = """
name = "box"
[materials.m]
reflectance = 0.9
[[walls]]
name = "w"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
closed = true
material = "m"
[[posts]]
name = "p"
center = [1.0, 1.0]
radius = 0.1
material = "m"
[places.here]
position = [2.0, 1.2]
"""
WALL = '[[walls]]\nname = "v"\nmaterial = "m"\npoints = '


def lines(text: str) -> list[str]:
    return [finding.line for finding in check_room(parse_room(text, "own.toml"), load_board("polaroid-6500"))]


def test_a_room_without_mistakes_has_no_findings() -> None:
    assert lines(BOX) == []


@pytest.mark.parametrize("name", sorted(set(room_names()) - {"figure2a"}))
def test_the_plans_of_shipped_rooms_have_no_findings(name: str) -> None:
    assert list(plan_findings(load_room(name))) == []


def test_the_wall_at_40_m_is_too_far_away_as_the_figure_shows() -> None:
    found = [finding.kind for finding in check_room(load_room("figure2a"), load_board("polaroid-6500"))]
    assert found == ["place outside", "silence"]


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (f"{WALL}[[2.0, 2.0], [3.995, 2.0]]", "walls 'v[0]' and 'w[1]': have a gap of 5 mm at 3.995, 2 m; sound"),
        (f"{WALL}[[4.0, 3.0], [4.0, 0.0]]", "walls 'w[1]' and 'v[0]': coincide; remove one of them"),
        (f"{WALL}[[4.0, 1.0], [4.0, 1.5]]", "walls 'w[1]' and 'v[0]': overlap over 500 mm; shorten one of them"),
        (f"{WALL}[[1.0, 2.0], [1.0005, 2.0]]", "wall 'v[0]': is only 0.5 mm long; remove one of its points"),
        ('[places.out]\nposition = [5.0, 1.0]', "place 'out': is outside the room, at 5, 1 m; move it into the room"),
        ('[places.in]\nposition = [3.998, 1.0]', "place 'in': is 2 mm from wall 'w[1]', at 3.998, 1 m; move it away"),
        (
            '[[posts]]\nname = "q"\nradius = 0.2\nmaterial = "m"\ncenter = [3.9, 1.0]',
            "post 'q': overlaps wall 'w[1]' by 100 mm; move the post, or make it smaller",
        ),
        (
            '[[posts]]\nname = "q"\nradius = 0.2\nmaterial = "m"\ncenter = [9.0, 1.0]',
            "post 'q': is outside the room, at 9, 1 m; move it into the room, or remove it",
        ),
        ("[materials.n]\nreflectance = 0.5", "material 'n': no wall, post, floor or ceiling has it; use it"),
    ],
)  # fmt: skip
def test_each_mistake_is_found_once(more: str, line: str) -> None:
    (found,) = lines(BOX + more)
    assert found.startswith(line)


@pytest.mark.parametrize(
    "more",
    [
        f"{WALL}[[2.0, 2.0], [4.0, 2.0]]",  # ends on a wall
        f"{WALL}[[2.0, 2.0], [4.01, 2.0]]",  # crosses it
        f"{WALL}[[2.0, 2.0], [3.9, 2.0]]",  # leaves a gap that may be intended
        f"{WALL}[[4.0, 1.0], [4.0, 1.5]]\nheight = [1.0, 2.0]\n",  # above the wall
    ],
)
def test_what_may_be_intended_has_no_finding(more: str) -> None:
    assert lines(BOX.replace("closed = true", "closed = true\nheight = [0.0, 1.0]") + more) == []


def test_a_room_in_centimetres_is_found_and_silent() -> None:
    large = BOX.replace("4.0", "400.0").replace("3.0", "300.0").replace("[2.0, 1.2]", "[200.0, 120.0]")
    unit, silence = lines(large.replace("[1.0, 1.0]", "[100.0, 100.0]").replace("0.1", "10.0"))
    assert unit == (
        "room: is 400 m wide and 300 m deep; are these centimetres (4 by 3 m) or millimetres (0.4 by 0.3 m)? "
        "expected metres"
    )
    assert "the nearest wall is 92 m away, and board 'polaroid-6500' reports at most 10.7 m; are the coord" in silence


def test_nothing_is_heard_within_blanking_or_from_a_material_that_absorbs_all() -> None:
    near = f'name = "near"\n[materials.m]\nreflectance = 0.9\n{WALL}[[0.0, 0.0], [0.3, 0.0]]\n'
    mute = BOX.replace("0.9", "0.0")
    assert "blanking" in "".join(lines(near + "[places.here]\nposition = [0.1, 0.02]\n"))
    assert "threshold of board 'polaroid-6500'" in "".join(lines(mute))


POST = '[[posts]]\nname = "q"\nmaterial = "m"\ncenter = '


def silence(text: str) -> str:
    room = parse_room(text, "own.toml")
    return reason_for_silence(room, room.places["here"], load_board("polaroid-6500"))


def test_the_distances_that_explain_silence_include_posts() -> None:
    """From the place to the centre it is √(20² + 170²) = 171 mm in the first room, 20 m in the second."""
    small = f'name = "r"\n[materials.m]\nreflectance = 0.9\n{WALL}[[0.0, 0.0], [0.05, 0.0]]\n'
    small += f"{POST}[0.0, 0.2]\nradius = 0.03\n[places.here]\nposition = [0.02, 0.03]\n"
    assert "the farthest wall is 0.201 m away" in silence(small)
    large = small.replace("[[0.0, 0.0], [0.05, 0.0]]", "[[30.0, 0.0], [31.0, 0.0]]")
    assert "the nearest wall is 20 m away" in silence(large.replace("[0.0, 0.2]", "[0.02, 20.03]"))


def test_the_extent_of_a_room_includes_its_posts() -> None:
    text = BOX.replace("[1.0, 1.0]", "[5.0, -1.0]").replace("radius = 0.1", "radius = 0.5")
    assert extent(parse_room(text, "own.toml")) == pytest.approx((5.5, 4.5))


def test_every_error_of_a_refused_file_is_listed() -> None:
    text = BOX.replace("radius", "radios").replace("0.9", "9")
    assert refusals_of(text, "own.toml") == [
        "posts[0].radios: unknown key; did you mean 'radius' (m)?",
        "materials.m.reflectance: expected less than or equal to 1, got 9",
        "posts[0].radius: missing; it is required",
    ]
    assert refusals_of(BOX, "own.toml") == []


CRATE = f"{WALL}[[2.5, 0.5], [3.1, 0.5], [3.1, 1.0], [2.5, 1.0]]\nclosed = true\n"


def test_a_place_inside_an_object_is_found() -> None:
    inside = BOX.replace("[2.0, 1.2]", "[2.8, 0.7]")
    assert lines(inside + CRATE) == [
        "place 'here': is inside the object of walls 'v[0]' to 'v[3]', at 2.8, 0.7 m; move it out; "
        "expected [x, y] in metres"
    ]
    assert lines(BOX + CRATE) == []


@pytest.mark.parametrize(
    "walls",
    ["[[2.5, 0.5], [3.1, 0.5], [3.1, 1.0], [2.5, 1.0]]", "[[2.0, 0.2], [3.8, 0.2], [3.8, 2.2], [2.0, 2.2]]"],
    ids=["narrow", "wide as a room"],
)
def test_paths_of_a_place_in_a_closed_box_are_not_searched(monkeypatch: pytest.MonkeyPatch, walls: str) -> None:
    """In a box with lids, of strongly reflecting walls, a search takes a minute and ends with too many paths."""
    levels = '[floor]\nheight = 0.0\nmaterial = "m"\n[ceiling]\nheight = 2.5\nmaterial = "m"\n'
    inside = BOX.replace("[2.0, 1.2]", "[2.8, 0.7]\nheight = 0.3")
    monkeypatch.setattr(check, "predict_scan", lambda *_: pytest.fail("a prediction"))
    box = walls.replace("]]", "]]\nclosed = true\nheight = [0.0, 0.5]\nlids = true")
    (found,) = lines(f"{inside}{WALL}{box}\n{levels}")
    assert found.startswith("place 'here': is inside the object of walls 'v[0]' to 'v[3]', at 2.8, 0.7 m")


def test_a_place_with_too_many_paths_is_named_and_the_other_places_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fan, "MOST_POINTS", 50)
    first, second = lines(BOX + "[places.there]\nposition = [3.0, 2.0]")
    assert first.startswith("place 'here': its echoes cannot be predicted: too many paths: ")
    assert second.startswith("place 'there': its echoes cannot be predicted: too many paths: ")
    assert "fewer reflections" not in first


def test_a_place_above_an_object_or_in_an_inner_room_has_no_finding() -> None:
    above = BOX.replace("[2.0, 1.2]", "[2.8, 0.7]\nheight = 0.8")
    assert lines(f"{above}{CRATE}height = [0.0, 0.5]\n") == []
    inner_room = f"{WALL}[[1.5, 0.5], [3.5, 0.5], [3.5, 2.5], [1.5, 2.5]]\nclosed = true\n"
    assert lines(BOX + inner_room) == []


def test_a_forgotten_closing_wall_and_a_list_of_tables_get_a_hint() -> None:
    named = BOX.replace('name = "w"', 'name = "w"\nedges = ["s", "e", "n", "w"]').replace("closed = true", "")
    assert refusals_of(named, "own.toml") == [
        "walls[0]: wall 'w': expected a name in edges for each of 3 segments, got 4; is closed = true missing?"
    ]
    assert refusals_of(BOX.replace("[places.here]", "[[places.here]]"), "own.toml") == [
        "places.here: expected a table, got a list; write [NAME], not [[NAME]]"
    ]
    far = BOX.replace("radius = 0.1", "radius = -1.0")
    assert refusals_of(far, "own.toml") == ["posts[0].radius: expected greater than 0 m, got -1.0"]
