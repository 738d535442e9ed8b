"""The structure that `python -m tests.structure` reports stays within its limits."""

import pytest

from tests import structure

MOST_FILES = 13  # twelve and an `__init__.py`
LARGER = {
    "firmware/avr": "a unit is a source file and its header",
    "docs/screenshots": "pictures",
    "rooms": "one file for each room",
}


def test_folders_hold_few_files() -> None:
    above = {folder: count for folder, count in structure.files_per_folder().items() if count > MOST_FILES}
    assert above.keys() == LARGER.keys()


def test_imports_form_no_cycle() -> None:
    graph = structure.import_graph()
    assert structure.module_cycles(graph) == []
    assert structure.folder_cycles(graph) == []


def test_no_two_public_classes_share_a_name() -> None:
    assert structure.repeated_classes() == {}


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
