"""Text from files and devices: nothing in it can move the cursor, start a new line or reverse the writing."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis.strategies import characters, text

from sonarhw.errors import harmless, shortened


@pytest.mark.parametrize(
    ("raw", "shown"),
    [
        ("Büro 3, 12 °C – größer", "Büro 3, 12 °C – größer"),
        ("実験室 مختبر", "実験室 مختبر"),
        ("\x1b[31mred\x1b[0m", r"\x1b[31mred\x1b[0m"),
        ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
        ("\x9b2J", r"\x9b2J"),
        ("room\nsonarhw: all is well", r"room\nsonarhw: all is well"),
        ("a\rb\tc\0d\x7f", r"a\rb\tc\x00d\x7f"),
        ("invoice\u202efdp.exe", r"invoice\u202efdp.exe"),
        ("two\u2028lines", r"two\u2028lines"),
        ("not UTF-8 \udcff", r"not UTF-8 \udcff"),
        ("", ""),
    ],
)
def test_control_characters_become_escapes(raw: str, shown: str) -> None:
    assert harmless(raw) == shown


@given(text(characters(exclude_categories=())))
def test_any_text_becomes_printable_and_encodable(raw: str) -> None:
    shown = harmless(raw)
    assert not {"Cc", "Cf", "Cs", "Zl", "Zp"} & {unicodedata.category(character) for character in shown}
    shown.encode()
    assert len(shown.splitlines()) <= 1
    assert harmless(shown) == shown


def test_of_a_long_text_the_begin_and_the_end_are_kept() -> None:
    cut = shortened("begin " + 5000 * "x" + " end", 60)
    assert len(cut) == 60
    assert cut.startswith("begin xxx")
    assert cut.endswith("xxx end")
    assert cut.count("…") == 1
    assert shortened(60 * "x", 60) == 60 * "x"
