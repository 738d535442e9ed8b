"""Tables of reflectances: interpolation, errors of room files, and editing."""

import numpy as np
import pytest
from sonarhw_sim.room.room import ReflectanceTable, Room, parse_room, with_material
from sonarhw_sim.room.room_writing import materials
from sonarhw_sim.room.room_writing import with_material as with_written_material

from sonarhw.errors import InputError

ROWS = """
    { incidence_deg = 60.0, frequency = 50000.0, reflectance = 0.8 },
    { incidence_deg = 0.0, frequency = 50000.0, reflectance = 0.2 },
    { incidence_deg = 0.0, frequency = 60000.0, reflectance = 0.4 },
    { incidence_deg = 60.0, frequency = 60000.0, reflectance = 0.6 },
"""


def room_with(foam: str) -> Room:
    return parse_room(
        f"""
        name = "foam"
        [materials.foam]
        {foam}
        [materials.wood]
        reflectance = 0.9
        [[walls]]
        name = "w"
        points = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]
        material = "foam"
        [[posts]]
        name = "p"
        center = [5.0, 5.0]
        radius = 0.1
        material = "wood"
        """,
        "room.toml",
    )


ROOM = room_with(f"table = [{ROWS}]\nscatter = 0.19")


@pytest.mark.parametrize(
    ("degrees", "frequency", "expected"),
    [
        (0.0, 50e3, 0.2),
        (60.0, 60e3, 0.6),
        (30.0, 50e3, 0.5),
        (0.0, 55e3, 0.3),
        (15.0, 57.5e3, 0.25 * 0.35 + 0.75 * 0.45),  # of the values at 15°: 0.35 at 50 kHz, 0.45 at 60 kHz
        (85.0, 40e3, 0.8),
        (85.0, 90e3, 0.6),
    ],
)
def test_values_are_interpolated_and_continue_beyond_the_ends(
    degrees: float, frequency: float, expected: float
) -> None:
    at = ROOM.tables["foam"].at(np.radians([degrees]), np.array([frequency]))
    assert at == pytest.approx(np.array([[expected]]))


def test_a_table_of_one_row_is_one_number() -> None:
    table = ReflectanceTable(np.zeros(1), np.array([5e4]), np.array([[0.3]]))
    assert table.at(np.array([0.0, 1.0]), np.array([4e4, 5e4, 6e4])) == pytest.approx(np.full((2, 3), 0.3))


def test_surfaces_have_the_largest_value() -> None:
    assert ROOM.reflectances == pytest.approx([0.8 * 0.9, 0.8 * 0.9, 0.9])
    assert np.hypot(ROOM.reflectances, ROOM.scattered) == pytest.approx([0.8, 0.8, 0.9])
    assert list(ROOM.tables) == ["foam"]


@pytest.mark.parametrize(
    ("foam", "message"),
    [
        ("scatter = 0.1", "materials.foam: reflectance: missing; expected a number from 0 to 1, or a table"),
        ("table = []", "reflectance: missing"),
        (f"reflectance = 0.5\ntable = [{ROWS}]", "reflectance, table: expected one of them"),
        (
            "table = [{ incidence_deg = 0.0, frequency = 5e4, reflectance = 0.2 }, "
            "{ incidence_deg = 60.0, frequency = 6e4, reflectance = 0.2 }]",
            "table: expected one row for each angle at each frequency, got no row for 0° at 60000 Hz",
        ),
        (f"table = [{ROWS}{ROWS}]", "got 2 rows for 0° at 50000 Hz"),
        (
            "table = [{ incidence_deg = 91.0, frequency = 5e4, reflectance = 0.2 }]",
            "materials.foam.table[0].incidence_deg: expected less than or equal to 90 degrees, got 91.0",
        ),
        (
            "table = [{ incidence_deg = 0.0, frequency = 50.0, reflectance = 0.2 }]",
            "materials.foam.table[0].frequency: expected greater than or equal to 1000 Hz, got 50.0; if this is in "
            "kHz, write 50000.0",
        ),
        (
            "table = [{ incidence_deg = 0.0, frequency = 5e4, reflectance = 1.2 }]",
            "materials.foam.table[0].reflectance: expected less than or equal to 1, got 1.2",
        ),
        (
            "table = [{ incidence_deg = 0.0, frequency = 5e4 }]",
            "materials.foam.table[0].reflectance: missing; it is required",
        ),
        (
            "table = [{ angle_deg = 0.0, frequency = 5e4, reflectance = 1.0 }]",
            "materials.foam.table[0].angle_deg: unknown key",
        ),
        ("table = [[0.0, 5e4, 0.2]]", "materials.foam.table[0]: expected a table"),
    ],
)
def test_a_wrong_table_is_one_clear_error(foam: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        room_with(foam)
    assert str(error.value).startswith("room.toml: materials.foam")
    assert message in str(error.value)


def test_a_new_reflectance_replaces_the_table_and_a_new_scatter_keeps_it() -> None:
    for changed in (with_material(ROOM, "foam", 0.5, 0.36), with_written_material(ROOM, "foam", 0.5, 0.36)):
        assert not changed.tables
        assert changed.reflectances[0] == pytest.approx(0.5 * 0.8)
    for changed in (with_material(ROOM, "foam", None, 0.36), with_written_material(ROOM, "foam", None, 0.36)):
        assert changed.tables.keys() == {"foam"}
        assert changed.reflectances[0] == pytest.approx(0.8 * 0.8)
        assert changed.scattered[0] == pytest.approx(0.8 * 0.6)
    assert materials(with_written_material(ROOM, "foam", None, 0.36))["foam"].scatter == 0.36
