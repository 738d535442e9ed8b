"""A changed and saved room reads back the same, with its comments."""

import errno
import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sonarhw_sim.air import Air
from sonarhw_sim.room.room import Place, Room, load_room, parse_room
from sonarhw_sim.room.room_writing import save_room, with_air, with_material, with_place

from sonarhw.errors import InputError, OutputError
from tests.checkout import CHECKOUT

ROOMS = sorted((CHECKOUT / "rooms").glob("*.toml"))
SIMPLE = next(path for path in ROOMS if path.stem == "simple")
NAMES = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=12)
SHARES = st.floats(0, 1)


def assert_same_rooms(one: Room, other: Room, but: tuple[str, ...] = ()) -> None:
    """Assert that the rooms are equal except for these fields and their text."""
    for field in fields(Room):
        if field.name in (*but, "text"):
            continue
        first, second = getattr(one, field.name), getattr(other, field.name)
        if field.name == "edges":
            assert first.names == second.names
            np.testing.assert_array_equal(first.points, second.points)
        elif isinstance(first, np.ndarray):
            np.testing.assert_array_equal(first, second, err_msg=field.name)
        else:
            assert first == second, field.name


def comments(text: str) -> list[str]:
    return [line.partition("#")[2] for line in text.splitlines() if "#" in line]


@pytest.mark.parametrize("path", ROOMS, ids=lambda path: path.stem)
@settings(max_examples=15, deadline=None)
@given(t=st.floats(-40, 60), h=SHARES, p=st.floats(30, 120), x=st.floats(50, 99), heading=st.floats(-360, 360))
def test_every_example_room_reads_back_as_changed(
    path: Path, t: float, h: float, p: float, x: float, heading: float
) -> None:
    room = load_room(path)
    place = Place("elsewhere", (x, -x), np.radians(heading))
    changed = with_place(with_air(room, Air(t, h, p)), place)
    assert changed.air == Air(t, h, p)
    assert changed.places["elsewhere"].position == place.position
    assert changed.places["elsewhere"].heading == pytest.approx(place.heading, abs=1e-10)
    assert_same_rooms(parse_room(changed.text, "written"), changed)
    assert_same_rooms(changed, room, but=("air", "places"))
    assert {**changed.places, **room.places} == changed.places
    assert comments(changed.text) == comments(room.text)


@settings(max_examples=60, deadline=None)
@given(name=NAMES, reflectance=SHARES, scatter=SHARES)
def test_a_material_of_any_name_reads_back(name: str, reflectance: float, scatter: float) -> None:
    room = with_material(load_room(SIMPLE), name, reflectance, scatter)
    one_wall = f'\n[[walls]]\nname = "more"\npoints = [[5.0, 5.0], [6.0, 5.0]]\nmaterial = {_quoted(name)}\n'
    more = parse_room(room.text + one_wall, "with a wall of it")
    assert more.materials[-1] == name
    power = more.reflectances[-1] ** 2 + more.scattered[-1] ** 2
    assert power == pytest.approx(reflectance**2, rel=1e-12)


def test_the_reflectance_of_a_material_is_that_of_all_its_surfaces() -> None:
    room = with_material(load_room(SIMPLE), "shelving", 0.5, 0.0)
    assert set(room.reflectances) == {0.5}
    assert "scatter" not in room.text


@pytest.mark.parametrize("bad", [1.5, -0.1, float("nan")])
def test_invalid_changes_are_rejected_and_the_room_is_unchanged(bad: float) -> None:
    room = load_room(SIMPLE)
    with pytest.raises(InputError, match="reflectance"):
        with_material(room, "shelving", bad, 0.0)
    assert_same_rooms(room, load_room(SIMPLE))


def test_a_place_inside_a_post_is_rejected() -> None:
    text = (
        load_room(SIMPLE).text + '\n[[posts]]\nname = "p"\ncenter = [0.3, 0.3]\nradius = 0.1\nmaterial = "shelving"\n'
    )
    with pytest.raises(InputError, match="lies inside post 'p'"):
        with_place(parse_room(text, "with a post"), Place("here", (0.35, 0.3)))


def test_a_saved_room_loads_and_existing_files_are_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    room = with_air(load_room(SIMPLE), Air(temperature_c=3.0))
    save_room(room, file)
    assert_same_rooms(load_room(file), room)
    other = replace(room, text="name = 'other'")
    with pytest.raises(InputError, match=r"mine\.toml: exists already"):
        save_room(other, file)
    assert_same_rooms(load_room(file), room)
    save_room(with_air(room, Air(temperature_c=4.0)), file, overwrite=True)
    assert load_room(file).air.temperature_c == 4.0


@pytest.mark.parametrize("there", [False, True])
def test_a_room_that_cannot_be_saved_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    file = tmp_path / "mine.toml"
    if there:
        file.write_text("mine")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=r"mine\.toml: No space left on device; delete other files"):
        save_room(load_room(SIMPLE), file, overwrite=there)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"] * there


def _quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
