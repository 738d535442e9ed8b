"""Text of messages: counts with nouns, and text from files and devices, made harmless for terminals and spreadsheets.

A name may contain escape sequences that move the cursor or change colours, line breaks that pretend to be another
message, and marks that reverse the direction of writing. A file name that is not UTF-8 contains surrogates.
"""

import unicodedata

_ESCAPED = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories: control, format, surrogate, line and paragraph separator


def harmless(text: str) -> str:
    """Return a text with every control character, direction mark, line break and surrogate as an escape: `\\x1b`."""
    return text if text.isprintable() else "".join(map(_harmless_character, text))


def _harmless_character(character: str) -> str:
    if unicodedata.category(character) in _ESCAPED:
        return character.encode("unicode_escape").decode("ascii")
    return character


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters: of a longer one the begin and the end, with … between them."""
    if len(text) <= most:
        return text
    end = most // 3
    return f"{text[: most - end - 1]}…{text[-end:]}"


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: `1 reading`, `2 readings`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def counted_are(count: int, noun: str) -> str:
    """Return a count as the begin of a sentence: `1 reading is`, `2 readings are`."""
    return f"{counted(count, noun)} {'is' if count == 1 else 'are'}"
