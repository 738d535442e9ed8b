"""The help of a command, with arguments and values as users type them: `LOG...`, not `{LOG}...` and `<list[Path]>`.

In lists of commands, each has its whole first sentence; Typer cuts it on narrow terminals.
"""

import re
from collections.abc import Callable
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

_Function = TypeVar("_Function", bound=Callable[..., Any])
_WHOLE_SENTENCE = 1000  # characters
_VALUES = {"int": "INTEGER", "float": "NUMBER", "path": "FILE", "str": "TEXT"}


class CommandList(typer.Typer):
    """Commands whose help shows no Python types."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(cls=_PlainGroup, **settings)

    def command(self, name: str | None = None, **settings: Any) -> Callable[[_Function], _Function]:
        """Return the decorator that adds a command, as `Typer.command` does."""
        return super().command(name, cls=_PlainCommand, **settings)


class _PlainGroup(TyperGroup):
    def get_short_help_str(self, limit: int = _WHOLE_SENTENCE) -> str:
        return super().get_short_help_str(max(limit, _WHOLE_SENTENCE))


class _PlainCommand(TyperCommand):
    def get_short_help_str(self, limit: int = _WHOLE_SENTENCE) -> str:
        return super().get_short_help_str(max(limit, _WHOLE_SENTENCE))

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        for title, kind in (("Arguments", "argument"), ("Options", "option")):
            parameters = [parameter for parameter in self.get_params(ctx) if parameter.param_type_name == kind]
            rows = [(parameter, parameter.get_help_record(ctx)) for parameter in parameters]
            if shown := [(_plain(parameter, row[0]), row[1]) for parameter, row in rows if row is not None]:
                with formatter.section(title):
                    formatter.write_dl(shown)


def _plain(parameter: Any, name: str) -> str:
    """Return an argument as in the usage, and an option with the value that it expects."""
    if parameter.param_type_name == "argument":
        return f"{parameter.display_name_raw}{'...' if parameter.nargs != 1 else ''}"
    return re.sub(r"<(?:list\[)?([^] >]+)[^>]*>", lambda type_: _VALUES.get(type_[1], type_[1]), name)
