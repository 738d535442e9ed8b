"""The locks name every dependency with hashes and nothing of one machine, and the page lists each with its licence."""

import re
from datetime import date
from pathlib import Path

import av
import pytest

from requirements.audit import dependencies, vulnerable, without_releases
from requirements.lock import EXTRAS, HERE, PAGE, PROJECT, entries
from tests.checkout import CHECKOUT

LOCKS = sorted(HERE.glob("*.txt"))
PROJECT_TEXT = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
ROWS = [line.strip("| \n").split(" | ") for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:3] != "|--"]
TABLE = {(cells[0], cells[1]): cells for cells in ROWS if len(cells) == 5 and cells[0] != "package"}
LINE = re.compile(
    r"#.*"
    r"|[a-z0-9.-]+==[\w.+]+( ; (python_full_version|sys_platform|platform_\w+|implementation_name) [^/@]*)? \\"
    r"|    --hash=sha256:[0-9a-f]{64}( \\)?"
)


def test_there_is_a_lock_for_each_extra() -> None:
    assert {lock.stem for lock in LOCKS} == {"build", "base", *EXTRAS}
    assert EXTRAS.keys() == PROJECT["project"]["optional-dependencies"].keys()


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_a_lock_holds_only_versions_and_hashes(lock: Path) -> None:
    assert [line for line in lock.read_text().splitlines() if not LINE.fullmatch(line)] == []


def test_each_dependency_is_locked() -> None:
    locked = {match[1] for lock in LOCKS for match in entries(lock)}
    assert dependencies(PROJECT_TEXT) - locked == set()
    build = PROJECT["build-system"]["requires"]
    assert [f"{match[1]}=={match[2]}" for match in entries(HERE / "build.txt")] == build


def test_locks_that_are_installed_together_agree() -> None:
    versions: dict[str, set[str]] = {}
    for lock in LOCKS:
        for match in entries(lock):
            versions.setdefault(match[0].splitlines()[0].split(";")[-1] + match[1], set()).add(match[2])
    assert {name: found for name, found in versions.items() if len(found) > 1} == {}


def test_the_base_needs_no_window_and_no_study() -> None:
    added = {match[1] for name in ("gui", "study") for match in entries(HERE / f"{name}.txt")} - {"colorama"}
    assert {"pyside6-essentials", "pyqtgraph", "pyarrow", "dask", "xarray"} <= added
    assert added & {match[1] for match in entries(HERE / "base.txt")} == set()


def test_compiled_packages_are_locked_for_each_system() -> None:
    # one wheel for each Python from 3.11 to 3.13 on Linux, macOS and Windows at least, and one source archive
    few = {match[1]: match[0].count("sha256:") for match in entries(HERE / "base.txt")}
    assert [name for name in ("numpy", "scipy", "numba", "llvmlite", "matplotlib", "pillow") if few[name] < 10] == []


def test_the_page_lists_every_locked_package_with_date_and_licence() -> None:
    locked = {(match[1], match[2]) for lock in LOCKS for match in entries(lock)}
    assert TABLE.keys() == locked
    assert [cells for cells in TABLE.values() if not (date.fromisoformat(cells[2]) and cells[3])] == []
    # of a package itself, if it leaves no choice; what its wheels contain follows a semicolon
    own = {cells[0]: cells[3].partition(";")[0] for cells in TABLE.values()}
    assert [name for name, licence in own.items() if re.search(r"\bA?GPL", licence) and "LGPL" not in licence] == []


def test_the_page_names_the_licences_of_libraries_in_wheels() -> None:
    libraries = {file.name.split("-")[0] for file in Path(av.__file__).parents[1].glob("av.libs/*")}
    stated = [cells[3] for (name, _), cells in TABLE.items() if name == "av"]
    assert stated
    for library in {"libx264", "libx265"} & libraries:
        assert all(library.removeprefix("lib") in text and "GPL-2.0-or-later" in text for text in stated)


def page_of(released: str) -> str:
    return f"| numpy | 1.0 | {released} | BSD | base |\n| old-one | 1.0 | 2019-01-01 | MIT | base |\n"


@pytest.mark.parametrize(
    ("released", "reason", "found"),
    [
        ("2024-01-01", "", ["old-one"]),
        ("2021-01-01", "", ["numpy", "old-one"]),
        ("2024-01-01", "# last release 2019; it is finished\n", []),
        ("2024-01-01", "# it is finished\n", ["old-one"]),
    ],
)
def test_an_old_dependency_needs_a_reason(released: str, reason: str, found: list[str]) -> None:
    project = f"""
    build-system.requires = []
    [project]
    name = "ours"
    dependencies = [
    "numpy>=1",
    {reason}"Old_One>=1", # reads files
    ]
    [project.optional-dependencies]
    """
    lines = without_releases(project, page_of(released), date(2025, 1, 1))
    assert [line.split(":")[0] for line in lines] == found


def test_known_vulnerabilities_and_unchecked_packages_are_reported() -> None:
    audited = [
        {"name": "one", "version": "1.0", "vulns": []},
        {"name": "two", "version": "2.0", "vulns": [{"id": "CVE-1", "fix_versions": ["2.1", "3.0"]}]},
        {"name": "three", "skip_reason": "not found"},
    ]
    assert [*vulnerable(audited)] == ["two 2.0: CVE-1, fixed in 2.1, 3.0", "three: not found"]
