"""The manual page is up to date, and lists every command and option of the group."""

import runpy

import typer
from sonarhw_cli.app import app

from tests.checkout import CHECKOUT

PAGE = (CHECKOUT / "docs/reference/sonarhw.1").read_text()


def test_the_page_is_generated_from_the_commands() -> None:
    generated = runpy.run_path(str(CHECKOUT / "docs/site/man_page.py"))
    assert generated["man_page"]() == PAGE, "run: python docs/site/man_page.py"


def test_the_page_has_every_command_and_no_line_that_roff_takes_for_a_macro() -> None:
    commands = [name for name, command in typer.main.get_command(app).commands.items() if not command.hidden]
    assert all(f".B {name}" in PAGE for name in commands)
    macros = {line.split()[0] for line in PAGE.splitlines() if line.startswith((".", "'"))}
    assert macros == {".TH", ".SH", ".B", ".TP", ".nf", ".fi"}
