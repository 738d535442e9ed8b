"""Sound on its way: positions against image sources, captions, and films that other programs decode."""

import math
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from sonarhw_compare.film import FilmTiming
from sonarhw_compare.picture_file import FILMS, check_film, write_film
from sonarhw_compare.sound import PlayedPing, front_at, position_at
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.errors import MissingExtra

ROOM = load_room("rooms/simple.toml")


PLACE = ROOM.place("figure9")


SCAN = predict_scan(ROOM, PLACE, load_board("paper"), np.radians([270.0, 33.0]))


WIDTH, HEIGHT = 0.928, 0.742


def folded(value: float, size: float) -> float:
    """Return the coordinate inside a room of walls at 0 and `size` of a point that went straight through them."""
    value = value % (2 * size)
    return min(value, 2 * size - value)


@given(share=st.floats(0.001, 1.0), row=st.integers(0, len(SCAN.paths) - 1))
def test_sound_is_where_the_unfolded_room_says(share: float, row: int) -> None:
    if SCAN.paths.edges[row] >= 0:
        return
    travelled, departure = share * float(SCAN.paths.lengths[row]), float(SCAN.paths.departures[row])
    x, y = PLACE.position
    expected = (folded(x + travelled * math.cos(departure), WIDTH), folded(y + travelled * math.sin(departure), HEIGHT))
    assert position_at(SCAN.paths.outline(row), travelled) == pytest.approx(np.array(expected), abs=1e-9)


def test_the_front_is_an_arc_about_the_image_of_the_source() -> None:
    path = np.array([[1.0, 1.0], [2.0, 0.0], [3.0, 1.0]])  # a wall at y = 0 mirrors the source to (1, -1)
    arc = front_at(path, 2.0, 0.3)
    assert np.hypot(*(arc - (1.0, -1.0)).T) == pytest.approx(np.full(len(arc), 2.0))
    bent = front_at(path, 2.0, 0.3, bend=1)  # an edge at (2, 0) is a source of its own
    assert np.hypot(*(bent - (2.0, 0.0)).T) == pytest.approx(np.full(len(bent), 2.0 - math.sqrt(2)))
    assert len(front_at(path, 3.0, 0.3)) == 0


ROOM = load_room("rooms/simple.toml")


FALSE_WALL = PlayedPing(predict_scan(ROOM, ROOM.place("figure9"), load_board("paper"), np.radians([270.0])), 0)


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
    write_film(FALSE_WALL, QUICK, file, suffix)
    pictures = decoded(file.getvalue(), suffix)
    moving = len({round(time, 9) for time in QUICK.times(FALSE_WALL)})
    assert moving <= len(pictures) <= len(QUICK.times(FALSE_WALL))  # a GIF joins equal frames at the end
    assert orange(pictures[-1]) > 1.5 * orange(pictures[len(pictures) // 2])  # the reported point is filled


def test_a_video_without_pyav_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"\.mp4 needs PyAV.*'\.\[video\]'"):
        check_film(".mp4")
    check_film(".gif")
