"""Messages of the library are for commands, window and Python programs alike: they name no option of a command."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.checkout import CHECKOUT

PACKAGES = ("sonarhw", "sim/sonarhw_sim", "compare/sonarhw_compare")
COMMAND_LINES = ("emulated_board.py", "scenes.py")  # the arguments of programs, not messages
OPTION = re.compile(r"(?<![\w-])--[a-z]")
WHOLE_COMMAND = re.compile(r"`(sonarhw|ros2) [^`]*`")


def texts(tree: ast.AST) -> Iterator[str]:
    """Yield every text that is not a docstring; of a formatted one, its constant parts, joined."""
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
        elif not isinstance(node, ast.Expr):
            yield from (
                child.value
                for child in ast.iter_child_nodes(node)
                if isinstance(child, ast.Constant) and isinstance(child.value, str)
            )


def names_option(text: str) -> bool:
    return OPTION.search(WHOLE_COMMAND.sub("", text)) is not None


def test_options_are_named_only_inside_whole_commands() -> None:
    found = [
        f"{path.relative_to(CHECKOUT)}: {text}"
        for package in PACKAGES
        for path in sorted(Path(CHECKOUT, package).rglob("*.py"))
        if path.name not in COMMAND_LINES
        if OPTION.search(source := path.read_text(encoding="utf-8"))  # few need to be parsed
        for text in texts(ast.parse(source))
        if names_option(text)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ('raise E(f"{x}: give --room")', True),
        ('raise E("give a room")', False),
        ('raise E("run `sonarhw scan --room R`")', False),
        ('"""Doc of --room."""', False),
        ('f("a-b--c")', False),
    ],
)
def test_an_option_in_a_text_is_found(source: str, expected: bool) -> None:
    assert any(map(names_option, texts(ast.parse(source)))) is expected
