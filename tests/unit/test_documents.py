"""Files and Python names that the documents mention exist."""

import importlib.util
import io
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from sonarhw_compare.fit import quantities
from sonarhw_sim.air import Air

from sonarhw import export
from tests.checkout import CHECKOUT
from tests.fixtures.contributing import worked_example
from tests.fixtures.example_logs import example_reading

PAGES = sorted([*CHECKOUT.glob("*.md"), CHECKOUT / "firmware" / "PORTING.md", *(CHECKOUT / "docs").rglob("*.md")])
FILE = re.compile(r"`([\w./-]+/[\w.-]+\.(?:py|c|h|toml|md|sh))`")
EXAMPLES = {"gui/sonarhw_gui/views/histogram.py"}  # a file that the reader of CONTRIBUTING writes
NAME = re.compile(r"`((?:sonarhw|sonarhw_\w+|benchmarks|tests)(?:\.\w+)+)(?<!\.npz)`")  # index.npz is a file in a log


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_a_page_names_exist(page: Path) -> None:
    named = FILE.findall(page.read_text(encoding="utf-8"))
    missing = [name for name in named if not any((start / name).exists() for start in (CHECKOUT, page.parent))]
    assert set(missing) - EXAMPLES == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_names_of_a_page_resolve(page: Path) -> None:
    assert [name for name in NAME.findall(page.read_text(encoding="utf-8")) if not resolves(name)] == []


@pytest.mark.parametrize("package", ["sim", "compare", "gui", "cli"])
def test_the_page_of_a_package_lists_its_folders_and_modules(package: str) -> None:
    page = (CHECKOUT / package / "README.md").read_text(encoding="utf-8")
    parts = [path for path in (CHECKOUT / package).glob("sonarhw_*/*") if not path.name.startswith(("__", "py."))]
    names = [f"{path.name}/" if path.is_dir() else path.name for path in parts]
    assert names
    assert sorted(name for name in names if f"`{name}`" not in page) == []


def resolves(name: str) -> bool:
    """Whether a dotted name is a module, or something defined in one (perhaps in a class)."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        try:
            spec = importlib.util.find_spec(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        if spec is not None:
            source = Path(spec.origin or "")
            stub = source.with_suffix(".pyi")  # names that are loaded on demand
            text = (stub if stub.exists() else source).read_text(encoding="utf-8")
            return all(re.search(rf"\b{part}\b", text) for part in parts[end:])
    return False


HELP = sorted((CHECKOUT / "cli").rglob("*.py"))
UNQUOTED = re.compile(r"sonarhw [^`\n]*(?<!['\"])fake:[^`\n']*\?|(?:,| or) fake:[^`\n']*\?")


@pytest.mark.parametrize("page", [*PAGES, *HELP], ids=lambda page: page.name)
def test_urls_with_characters_of_the_shell_are_quoted(page: Path) -> None:
    assert UNQUOTED.findall(page.read_text(encoding="utf-8")) == []


def test_an_unquoted_url_is_found() -> None:
    assert UNQUOTED.search("$ sonarhw info fake:simple?place=figure9")
    assert UNQUOTED.search('help="socket://HOST:PORT or fake:ROOM?place=NAME."')
    assert not UNQUOTED.search("$ sonarhw info 'fake:simple?place=figure9'")


# the worked examples of CONTRIBUTING


def test_the_export_format_of_the_example_writes_a_line_for_each_reading() -> None:
    names = worked_example("def write_json_lines", vars(export) | {"json": json})
    readings = [example_reading(0), replace(example_reading(1), echo_times=())]
    entry = export.ExportFormat(".jsonl", "Readings as JSON lines", names["write_json_lines"])
    file = io.BytesIO()
    entry.write(SimpleNamespace(scans=[SimpleNamespace(readings=readings)]), file, {})  # type: ignore[arg-type]
    first, second = map(json.loads, file.getvalue().splitlines())
    assert first["range_m"] == readings[0].range
    assert second["range_m"] is None


def test_the_fit_parameter_of_the_example_is_a_quantity() -> None:
    names = worked_example("HUMIDITY = AirQuantity", vars(quantities))
    humidity, air = names["HUMIDITY"], Air(relative_humidity=0.4)
    assert humidity.value(humidity.put(air, 0.7)) == 0.7
    assert getattr(air, humidity.key) == humidity.value(air) == 0.4
