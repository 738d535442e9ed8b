"""Report how the repository is built: small modules, import and include cycles, repeated names.

Run `python -m tests.structure`. `tests/unit/test_structure.py` checks the limits.
"""

import ast
import re
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import grimp
from grimp import ImportGraph

from tests.checkout import CHECKOUT

OTHER_PACKAGES = ("tests", "benchmarks")
SMALL = 150  # code lines
GENERATED = ("build", "__pycache__")

Cycle = list[str]
Edges = dict[str, set[str]]


def installed_packages() -> dict[str, Path]:
    """Return the folder of each top-level name that an installation adds."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
    return {name: CHECKOUT / folder for name, folder in project["tool"]["setuptools"]["package-dir"].items()}


def files_below(*folders: str, suffixes: Iterable[str] = ()) -> Iterator[Path]:
    """Yield the files below these folders of the repository, without what a build or Python writes there."""
    for folder in folders:
        for path in sorted((CHECKOUT / folder).rglob("*")):
            parts = path.relative_to(CHECKOUT).parts
            hidden = any(part in GENERATED or part.startswith(".") for part in parts)
            if path.is_file() and not hidden and (not suffixes or path.suffix in suffixes):
                yield path


@cache
def import_graph() -> ImportGraph:
    """Return every import of the code, also those inside functions and those for type checkers only."""
    code = [name for name in installed_packages() if name not in ("sonarhw_rooms", "sonarhw_examples")]
    return grimp.build_graph(*code, *OTHER_PACKAGES, cache_dir=None)


def module_cycles(graph: ImportGraph) -> list[Cycle]:
    """Return the groups of modules that import each other."""
    return cycles({module: graph.find_modules_directly_imported_by(module) for module in graph.modules})


def small_single_importers(graph: ImportGraph) -> list[str]:
    """Return the modules of the installed packages that are small and that one module alone imports."""
    packages = installed_packages()
    return sorted(
        module
        for module in graph.modules
        if module.split(".")[0] in packages
        and (path := module_path(module)).is_file()
        and code_lines(path.read_text()) < SMALL
        and len(_importers(graph, module)) == 1
    )


def _importers(graph: ImportGraph, module: str) -> set[str]:
    """Return the modules outside of tests and benchmarks that import this one; a stub counts as one."""
    importers = graph.find_modules_that_directly_import(module)
    return {importer for importer in importers if importer.split(".")[0] not in OTHER_PACKAGES}


def module_path(module: str) -> Path:
    """Return the file of a module. That of a package is not one."""
    top, *rest = module.split(".")
    return installed_packages()[top].joinpath(*rest).with_suffix(".py")


def code_lines(text: str) -> int:
    """Count the lines without blank lines, comments and docstrings."""
    documented: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            documented |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    lines = text.splitlines()
    code = (line for number, line in enumerate(lines, 1) if number not in documented)
    return sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in code)


def include_cycles() -> list[Cycle]:
    """Return the groups of firmware units, a source file with its header, that include each other."""
    units: Edges = defaultdict(set)
    files = list(files_below("firmware", suffixes=(".c", ".h")))
    for path in files:
        for included in re.findall(r'^\s*#\s*include\s+"([^"]+)"', path.read_text(), flags=re.MULTILINE):
            homes = [file for file in files if file.name == Path(included).name]
            beside = [file for file in homes if file.parent == path.parent]
            units[_unit(path)] |= {_unit(file) for file in beside or homes} - {_unit(path)}
    return cycles(units)


def _unit(path: Path) -> str:
    return str(path.relative_to(CHECKOUT).with_suffix(""))


def cycles(edges: Edges) -> list[Cycle]:
    """Return the strongly connected groups of two or more."""

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        open_ends = [start]
        while open_ends:
            ahead = edges.get(open_ends.pop(), set()) - found
            found |= ahead
            open_ends += ahead
        return found

    reach = {node: reached(node) for node in edges}
    groups = {tuple(sorted(other for other in reach[node] if node in reach.get(other, ()))) for node in edges}
    return [list(group) for group in sorted(groups) if len(group) > 1]


def repeated_classes() -> dict[str, list[str]]:
    """Return the places of each public class name that two modules of the installed packages define."""
    return _repeated(
        (node.name, path)
        for path in _installed_modules()
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )


def _installed_modules() -> Iterator[Path]:
    folders = (str(folder.relative_to(CHECKOUT)) for folder in installed_packages().values())
    return files_below(*folders, suffixes=(".py",))


def _repeated(named: Iterable[tuple[str, Path]]) -> dict[str, list[str]]:
    places: dict[str, list[str]] = defaultdict(list)
    for name, path in named:
        places[name].append(str(path.relative_to(CHECKOUT)))
    return {name: found for name, found in sorted(places.items()) if len(found) > 1}


def help_texts() -> dict[str, str]:
    """Return what `--help` prints, for each command."""
    import typer
    from sonarhw_cli.app import app
    from typer.main import get_command

    texts: dict[str, str] = {}

    def collect(command: object, context: typer.Context) -> None:
        texts[context.command_path] = context.get_help()
        for name, part in getattr(command, "commands", {}).items():
            collect(part, typer.Context(part, parent=context, info_name=name))

    root = get_command(app)
    collect(root, typer.Context(root, info_name="sonarhw"))
    return texts


def report() -> Iterator[str]:
    """Yield the lines of the report."""
    graph = import_graph()
    small = small_single_importers(graph)
    yield f"modules below {SMALL} code lines with one importer: {len(small)}"
    yield from (f"  {module}" for module in small)
    for title, found in (
        ("import cycles between modules", module_cycles(graph)),
        ("include cycles of the firmware", include_cycles()),
    ):
        yield f"{title}: {len(found)}"
        yield from (f"  {' '.join(cycle)}" for cycle in found)
    repeated = repeated_classes()
    yield f"public class names used twice in the installed packages: {len(repeated)}"
    yield from (f"  {name}: {' '.join(places)}" for name, places in repeated.items())
    yield f"installed top-level names: {' '.join(installed_packages())}"


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in report())
