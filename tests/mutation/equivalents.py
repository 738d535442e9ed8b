"""Mutants that no test can detect, from `equivalents.toml`."""

import tomllib
from functools import cache
from pathlib import Path

from tests.mutation.mutants import Mutant


def is_equivalent(mutant: Mutant) -> bool:
    """Report whether a mutant is known to have no effect."""
    return key_of(mutant) in known()


def key_of(mutant: Mutant) -> tuple[str, str, str]:
    """Return path, line and change of a mutant."""
    return mutant.path, mutant.text, f"{mutant.before} → {mutant.after}"


@cache
def known() -> frozenset[tuple[str, str, str]]:
    """Return path, line and change of each known equivalent."""
    listed = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["mutants"]
    return frozenset((mutant["file"], mutant["line"], change) for mutant in listed for change in mutant["changes"])
