"""The structure that `python -m tests.structure` reports stays within its limits."""

import pytest

from tests import structure


def test_firmware_includes_have_no_cycle() -> None:
    assert structure.include_cycles() == []


def test_no_two_modules_share_a_name() -> None:
    assert structure.repeated_modules() == {}


def test_all_installed_names_begin_with_the_name_of_the_project() -> None:
    assert [name for name in structure.installed_packages() if not name.startswith("sonarhw")] == []


@pytest.mark.parametrize(
    ("edges", "expected"),
    [
        ({"a": {"b"}, "b": {"c"}}, []),
        ({"a": {"b"}, "b": {"a", "c"}, "c": set()}, [["a", "b"]]),
        ({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}, [["a", "b", "c"]]),
    ],
)
def test_cycles_are_found(edges: structure.Edges, expected: list[structure.Cycle]) -> None:
    assert structure.cycles(edges) == expected
