"""Which tests execute a line, by the coverage data of a run with one context for each test.

Three kinds of lines are not recorded by test: those of modules and classes, which run at import, those of compiled
kernels, and those of functions with a cache, which run for the first test only. For them, the tests are those that
execute a line where the name defined there is used or whose file contains the name, and then those that execute any
other line of the file. A test of an enumeration or a kernel alone executes no line of the product that is recorded.

Tests whose file names the function or class around the line, or its module, come first.
"""

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from coverage import CoverageData

_DURATION = re.compile(r"^([0-9.]+)s +(?:setup|call|teardown) +(tests/.*)$", re.MULTILINE)
_CACHE = re.compile(r"\b(lru_)?cache\b")
_WORD = re.compile(r"[\w.]{4,}")  # a name, also with dots
_DEFAULT = 1.0  # s, of a test without a recorded duration
_UNSEEN = 100  # lines that a test executes in kernels and other processes
_DIRECT = 0.1  # cost of a test that names what is changed, relative to other tests

_Line = tuple[str, int]  # path relative to the checkout, and line number


class Covering:
    """The tests that execute each line, and their durations."""

    def __init__(self, checkout: Path, recorded: Path, sources: Iterable[str]) -> None:
        """Read `*.coverage` and `*.log` of the folder `recorded`. `sources` are paths relative to `checkout`."""
        self._tests: dict[_Line, set[str]] = defaultdict(set)
        self._files: dict[str, set[str]] = defaultdict(set)
        self._durations: dict[str, float] = defaultdict(float)
        self._lines: dict[str, int] = defaultdict(int)  # executed by a test
        self._defined: dict[_Line, set[str]] = defaultdict(set)
        self._bodies: dict[_Line, range] = {}
        self._cached: set[_Line] = set()  # in functions with a cache
        self._used: dict[str, set[_Line]] = defaultdict(set)
        self._around: dict[_Line, set[str]] = defaultdict(set)  # names of the functions and classes around a line
        self._words = {
            test.relative_to(checkout).as_posix(): set(_WORD.findall(test.read_text(encoding="utf-8")))
            for test in (checkout / "tests").rglob("test_*.py")
        }
        for file in sorted(recorded.glob("*.coverage")):
            self._read_contexts(file)
        for file in sorted(recorded.glob("*.log")):
            for seconds, test in _DURATION.findall(file.read_text(encoding="utf-8")):
                self._durations[test] += float(seconds)
        for source in sources:
            self._read_names(source, ast.parse((checkout / source).read_bytes()))

    def tests(self, path: str, line: int) -> list[str]:
        """Return the tests that execute a line: quick tests of little code first, which detect most mutants.

        Tests of one function with other parameters come later, because they detect much the same.
        """
        reached, others = self._reached((path, line), set()), set()
        names = self._around[path, line] | self._defined[path, line]
        if (path, line) in self._cached:
            reached = reached.union(*(self._reached(user, set()) for user in self._users((path, line))))
        if (path, line) in self._cached or not self._tests.get((path, line)):
            reached = reached | {test for test in self._durations if self._contains(test, names)}
            others = self._files[path] - reached
        names = names | {_module(path)}
        return [*self._sorted(reached, names), *self._sorted(others, names)]

    def _contains(self, test: str, names: set[str]) -> bool:
        """Report whether the file of a test contains one of the names."""
        return not self._words.get(test.partition("::")[0], set()).isdisjoint(names)

    def _cost(self, test: str, names: set[str]) -> float:
        return self.duration(test) * (_UNSEEN + self._lines[test]) * (_DIRECT if self._contains(test, names) else 1.0)

    def _sorted(self, tests: Iterable[str], names: set[str]) -> list[str]:
        seen: Counter[str] = Counter()
        costs = {}
        for cost, test in sorted((self._cost(test, names), test) for test in tests):
            function = test.partition("[")[0]
            seen[function] += 1
            costs[test] = cost * seen[function]
        return sorted(costs, key=lambda test: costs[test])

    def duration(self, test: str) -> float:
        """Return the recorded duration of a test, s."""
        return self._durations.get(test, _DEFAULT)

    def _read_contexts(self, file: Path) -> None:
        data = CoverageData(str(file))
        data.read()
        for measured in data.measured_files():
            path = _from_checkout(measured)
            for line, contexts in data.contexts_by_lineno(measured).items():
                # "" is the import; a context is a test and its phase: "tests/unit/test_a.py::test_b|run"
                tests = {context.rpartition("|")[0] for context in contexts if "|" in context}
                self._tests[path, line] |= tests
                self._files[path] |= tests
                for test in tests:
                    self._lines[test] += 1

    def _read_names(self, path: str, tree: ast.Module) -> None:
        for node in ast.walk(tree):
            match node:
                case ast.Name(ctx=ast.Load()):
                    self._used[node.id].add((path, node.lineno))
                case ast.Attribute(ctx=ast.Load()):
                    self._used[node.attr].add((path, node.lineno))
                case ast.ClassDef():
                    for line in range(node.lineno, (node.end_lineno or 0) + 1):
                        self._around[path, line].add(node.name)
                case ast.FunctionDef():
                    for line in range(node.lineno, (node.end_lineno or 0) + 1):
                        self._defined[path, line] = {node.name}
                        self._around[path, line].add(node.name)
                        self._bodies[path, line] = range(node.body[0].lineno, (node.end_lineno or 0) + 1)
                        if any(_CACHE.search(ast.unparse(one)) for one in node.decorator_list):
                            self._cached.add((path, line))
        for statement in _import_time(tree):
            names = _names(statement)
            for line in range(statement.lineno, (statement.end_lineno or 0) + 1):
                self._defined[path, line] |= names

    def _reached(self, line: _Line, seen: set[_Line]) -> set[str]:
        if line in seen:
            return set()
        seen.add(line)
        if self._tests.get(line):
            return self._tests[line]
        # a default of a parameter, or a kernel
        body: set[str] = set()
        for other in self._bodies.get(line, ()):
            body |= self._tests.get((line[0], other), set())
        if body:
            return body
        return set().union(*(self._reached(user, seen) for user in self._users(line)))

    def _users(self, line: _Line) -> set[_Line]:
        """Return the lines where a name defined at a line is used."""
        return {user for name in self._defined.get(line, ()) for user in self._used.get(name, ())} - {line}


def _import_time(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the assignments of the module and of its classes."""
    for node in tree.body:
        for statement in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(statement, ast.Assign | ast.AnnAssign):
                yield statement


def _names(statement: ast.stmt) -> set[str]:
    targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
    return {node.id for target in targets if target for node in ast.walk(target) if isinstance(node, ast.Name)}


def _from_checkout(measured: str) -> str:
    """Return the path of a measured file relative to the checkout in which it was measured."""
    parts = Path(measured).parts
    package = next(part for part in parts if part in ("sonarhw", "sonarhw_sim", "sonarhw_compare"))
    first = len(parts) - 1 - parts[::-1].index(package)
    folder = {"sonarhw_sim": ("sim",), "sonarhw_compare": ("compare",)}.get(package, ())
    return str(Path(*folder, *parts[first:]))


def _module(path: str) -> str:
    """Return the dotted name by which a source file is imported."""
    parts = Path(path).with_suffix("").parts
    return ".".join(parts[1:] if parts[0] in ("sim", "compare") else parts)
