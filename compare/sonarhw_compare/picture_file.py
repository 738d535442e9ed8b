"""Pictures as PNG, PDF or SVG files. Equal figures give equal files: they contain no date, version or random name."""

from io import BytesIO
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = (".png", ".pdf", ".svg")
# None removes an entry that matplotlib writes by default
_METADATA = {".png": {"Software": None}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}


def write_picture(figure: "Figure", file: BinaryIO, suffix: str, *, tight: bool = False) -> None:
    """Write a figure in the format of `suffix`, one of PICTURES; `tight` crops its margins."""
    from matplotlib import rc_context

    with rc_context({"svg.hashsalt": "sonarhw"}):
        box = "tight" if tight else None
        figure.savefig(file, format=suffix.removeprefix("."), metadata=_METADATA[suffix], bbox_inches=box)


def picture_bytes(figure: "Figure", suffix: str, *, tight: bool = False) -> bytes:
    """Return what `write_picture` writes."""
    out = BytesIO()
    write_picture(figure, out, suffix, tight=tight)
    return out.getvalue()
