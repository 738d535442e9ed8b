"""The structure that `python -m tests.structure` reports stays within its limits."""

import pytest

from tests import structure

SMALL_WITH_ONE_IMPORTER = {
    "sonarhw.device.emulated_board": "a device of the driver; its importer is a command",
    "sonarhw.foxglove": "needs the extra `foxglove`, which `serve --foxglove` alone loads",
    "sonarhw_compare.import_formats": "`--help` lists the formats, and the readers of the formats load slowly",
    "sonarhw_compare.rooms.frame": "headings and direction of a room; its importer, the search, is a long module",
    "sonarhw_gui.window.garbage": "settings of the process, tested in a process that loads nothing else",
    "sonarhw_gui.window.display": "checks whether Qt can be loaded, so it is loaded before",
    "sonarhw_cli.rooms": "commands; the list of all commands is another idea",
}


def test_a_small_module_with_one_importer_is_part_of_it() -> None:
    small = structure.small_single_importers(structure.import_graph())
    assert {name for name in small if not is_view(name)} - SMALL_WITH_ONE_IMPORTER.keys() == set()


def is_view(module: str) -> bool:
    """Whether a module is a view of the window; each view is a module, of any length."""
    return module.startswith("sonarhw_gui.views.") and "entry = ViewEntry(" in structure.module_path(module).read_text()


def test_imports_form_no_cycle() -> None:
    assert structure.module_cycles(structure.import_graph()) == []


def test_no_two_public_classes_share_a_name() -> None:
    assert structure.repeated_classes() == {}


def test_firmware_includes_have_no_cycle() -> None:
    assert structure.include_cycles() == []


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
