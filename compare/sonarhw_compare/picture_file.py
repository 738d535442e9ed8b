"""Pictures as PNG, PDF or SVG files, and films as GIF with Pillow, or as MP4 or WebM with PyAV (extra `video`).

Equal figures give equal files: they contain no date, version or random name.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from io import BytesIO
from typing import TYPE_CHECKING, Any, BinaryIO

from sonarhw.errors import MissingExtra

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sonarhw_compare.film import FilmTiming, Frame
    from sonarhw_compare.sound import PlayedPing

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


FILMS = (".gif", ".mp4", ".webm")
_CODECS = {".mp4": ("mp4", "libx264", {"crf": "18"}), ".webm": ("webm", "libvpx-vp9", {"crf": "24", "b": "0"})}
_COLOURS = 64  # of a GIF; the pictures have few, and more would double its size


def write_film(ping: "PlayedPing", timing: "FilmTiming", file: BinaryIO, suffix: str) -> None:
    """Write a film in the format of `suffix`, one of FILMS. Raises MissingExtra if MP4 or WebM needs PyAV."""
    if suffix != ".gif":
        check_film(suffix)
    from sonarhw_compare.film import frames  # loads matplotlib

    drawn = frames(ping, timing)
    if suffix == ".gif":
        _write_gif([*drawn], timing.frames_per_second, file)
    else:
        _write_video(drawn, timing.frames_per_second, file, suffix)


def check_film(suffix: str) -> None:
    """Raise MissingExtra if a film with this suffix needs PyAV, and it is not installed."""
    from importlib.util import find_spec

    if suffix in _CODECS and find_spec("av") is None:
        raise MissingExtra(f"{suffix} needs PyAV (a .gif does not)", "video")


def _write_gif(pictures: Sequence["Frame"], rate: int, file: BinaryIO) -> None:
    """Write an endless GIF. One palette for all frames lets Pillow store only what changes between them."""
    from PIL import Image

    whole = [Image.fromarray(picture) for picture in pictures]
    last = whole[-1].quantize(_COLOURS, Image.Quantize.MEDIANCUT)
    few = [picture.quantize(palette=last, dither=Image.Dither.NONE) for picture in whole]
    few[0].save(file, "GIF", save_all=True, append_images=few[1:], duration=round(1000 / rate), loop=0, optimize=False)


def _write_video(pictures: Iterator["Frame"], rate: int, file: BinaryIO, suffix: str) -> None:
    import av

    form, codec, options = _CODECS[suffix]
    with av.open(file, "w", format=form) as container:
        stream: Any = None
        for picture in pictures:
            height, width = (side - side % 2 for side in picture.shape[:2])  # both codecs need even sizes
            if stream is None:
                stream = container.add_stream(codec, rate=Fraction(rate), options=options)
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            frame = av.VideoFrame.from_ndarray(picture[:height, :width].copy(), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
