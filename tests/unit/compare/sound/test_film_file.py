"""Films: decoded by other programs, they show the sound moving and the detection at its end."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from sonarhw_compare.film import FilmTiming, caption_at, frames
from sonarhw_compare.film_file import FILMS, check_film, write_film
from sonarhw_compare.sound import PlayedPing
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.errors import MissingExtra

ROOM = load_room("rooms/simple.toml")
PING = PlayedPing(predict_scan(ROOM, ROOM.place("figure9"), load_board("paper"), np.radians([270.0])), 0)
QUICK = FilmTiming(slowness=300.0, frames_per_second=10, hold=0.2)
ORANGE = np.array([0xD5, 0x5E, 0x00])


def orange(picture: np.ndarray) -> int:
    return int((np.abs(picture.astype(int) - ORANGE).sum(axis=-1) < 40).sum())


def decoded(data: bytes, suffix: str) -> list[np.ndarray]:
    if suffix == ".gif":
        with Image.open(BytesIO(data)) as film:
            assert film.info["loop"] == 0
            return [np.asarray(picture) for k in range(film.n_frames) if (film.seek(k), picture := film.convert("RGB"))]
    av = pytest.importorskip("av")
    with av.open(BytesIO(data)) as film:
        return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]


@pytest.mark.parametrize("suffix", FILMS)
def test_a_film_has_all_frames_and_ends_with_the_detection(suffix: str) -> None:
    if suffix != ".gif":
        pytest.importorskip("av")  # extra `video`, which the development tools include
    file = BytesIO()
    write_film(PING, QUICK, file, suffix)
    pictures = decoded(file.getvalue(), suffix)
    moving = len({round(time, 9) for time in QUICK.times(PING)})
    assert moving <= len(pictures) <= len(QUICK.times(PING))  # a GIF joins equal frames at the end
    assert orange(pictures[-1]) > 1.5 * orange(pictures[len(pictures) // 2])  # the reported point is filled


def test_frames_differ_only_where_something_moves() -> None:
    first, *others = frames(PING, QUICK)
    changed = np.any([(frame != first).any(axis=-1) for frame in others], axis=0)
    assert 0.01 < changed.mean() < 0.3


def test_captions_follow_the_events() -> None:
    for time, expected in (
        (0.1e-3, "0.10 ms: the board transmits"),
        (0.6e-3, "0.60 ms: the echo of bottom arrives within blanking and is not detected"),
        (2.0e-3, "2.00 ms: the board does not listen yet (blanking)"),
        (3.0e-3, "3.00 ms: the board listens"),
        (5.0e-3, "5.00 ms: bottom, top, bottom returns; the board would report 0.827 m"),
    ):
        assert caption_at(PING, time) == expected


def test_a_video_without_pyav_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"\.mp4 needs PyAV.*'\.\[video\]'"):
        check_film(".mp4")
    check_film(".gif")
