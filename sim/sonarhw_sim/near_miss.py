"""Suggestions for misspelt names: `; did you mean 'center'?`."""

from collections.abc import Iterable
from difflib import get_close_matches

_ALIKE = 0.6  # similarity from 0 to 1; 'pressure' and 'pressure_kpa' have 0.8
_MOST_LETTERS = 100  # longer words are not compared: the time is quadratic


def near_miss(word: str, known: Iterable[str]) -> str | None:
    """Return the most similar of the known names, or None if none is similar."""
    names = {name.casefold(): name for name in known}
    close = get_close_matches(word.casefold(), names, n=1, cutoff=_ALIKE) if len(word) <= _MOST_LETTERS else []
    return names[close[0]] if close else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `; did you mean 'NAME'?` for the most similar of the known names, or an empty text."""
    near = near_miss(word, known)
    return f"; did you mean {near!r}?" if near is not None else ""
