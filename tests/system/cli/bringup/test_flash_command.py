"""`sonarhw flash`: avrdude writes the prebuilt image to an emulated bootloader, and never to an unknown board."""

import stat
import subprocess
from pathlib import Path

import pytest

from sonarhw.controllers import IMAGES
from tests.checkout import CHECKOUT
from tests.fixtures.commands import sonarhw
from tests.system.cli.bringup.bootloader import bootloader_board
from tests.system.firmware.combinations.images import combinations

FOLDER = CHECKOUT / "sonarhw" / "images"
IMAGE = FOLDER / "mega-polaroid-step-dir.hex"
OLD = "sonarhw-mega 0.0.9"
OLD_UNO = "sonarhw-uno 0.0.9"


def bytes_of(image: Path) -> bytes:
    """Return the bytes of an Intel HEX file that starts at address 0."""
    memory, base = bytearray(), 0
    for line in image.read_text().split():
        record = bytes.fromhex(line[1:])
        size, address, kind = record[0], int.from_bytes(record[1:3], "big"), record[3]
        if kind == 2:
            base = int.from_bytes(record[4:6], "big") * 16
        elif kind == 0:
            assert base + address == len(memory)
            memory += record[4 : 4 + size]
    return bytes(memory)


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program named avrdude, first on the path, that writes its arguments to a file and fails."""
    program = tmp_path / "bin" / "avrdude"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\necho "$@" > {tmp_path}/arguments\necho "chip does not answer" >&2\nexit 1\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}:/usr/bin:/bin")
    return tmp_path / "arguments"


def test_the_prebuilt_images_are_fresh_builds_of_every_combination() -> None:
    make = ["make", "-C", CHECKOUT / "firmware", "WERROR=-Werror", "combinations"]
    subprocess.run(make, check=True, capture_output=True)
    assert sorted(IMAGES) == sorted(combinations()) == sorted(path.stem for path in FOLDER.iterdir())
    for name in IMAGES:
        fresh = CHECKOUT / "firmware" / "build" / f"{name}.hex"
        assert bytes_of(FOLDER / f"{name}.hex") == bytes_of(fresh), "run: make -C firmware images"


CHEAP = ("hc-sr04", "servo")
CHOSEN = ("--ranging", "hc-sr04", "--turning", "servo")


@pytest.mark.parametrize(
    ("firmware", "board", "options", "image"),
    [
        (OLD, {}, (), "mega-polaroid-step-dir"),
        (OLD_UNO, {"chip": "atmega328p", "parts": CHEAP}, CHOSEN, "uno-hc-sr04-servo"),
        (OLD_UNO, {"chip": "atmega328p", "parts": CHEAP}, ("--controller", "nano", *CHOSEN), "uno-hc-sr04-servo"),
        # without options a board keeps the parts that it is built for
        (OLD_UNO, {"chip": "atmega328p", "parts": CHEAP, "before": CHEAP}, (), "uno-hc-sr04-servo"),
        ("", {}, ("--force", "--controller", "mega"), "mega-polaroid-step-dir"),
    ],
    ids=["mega", "uno", "nano", "as before", "silent"],
)
def test_a_board_is_written(firmware: str, board: dict[str, object], options: tuple[str, ...], image: str) -> None:
    with bootloader_board(firmware, **board) as served:
        done = sonarhw("flash", served.port, *options)
        written = bytes_of(FOLDER / f"{image}.hex")
        assert bytes(served.flash[: len(written)]) == written
    greeted = f"sonarhw-{image.partition('-')[0]} 0.1.0, protocol 1.2, SONAR-000005"
    assert (done.returncode, done.stdout) == (0, f"{served.port}: {greeted}\n")


@pytest.mark.parametrize(
    ("before", "options", "message"),
    [
        (
            ("hc-sr04", "worm-gear"),
            (),
            "no prebuilt firmware for 'worm-gear', for which the board is built; to change that, "
            "run `sonarhw flash PORT --turning NAME`\n",
        ),
        (("hc-sr04", "servo"), ("--ranging", "polaroid"), "no prebuilt firmware for uno-polaroid-servo"),
    ],
)
def test_parts_need_an_image(before: tuple[str, str], options: tuple[str, ...], message: str, stand_in: Path) -> None:
    with bootloader_board(OLD_UNO, chip="atmega328p", before=before) as board:
        done = sonarhw("flash", board.port, *options)
    assert done.returncode == 2
    assert message in done.stderr
    assert not stand_in.exists()


@pytest.mark.parametrize(("profile", "turning"), [("polaroid-6500", "servo"), ("hc-sr04", "step-dir")])
def test_a_board_that_answers_for_another_ranging_board_or_turntable_is_an_error(profile: str, turning: str) -> None:
    with bootloader_board(OLD_UNO, chip="atmega328p", parts=(profile, turning)) as board:
        done = sonarhw("flash", board.port, "--ranging", "hc-sr04", "--turning", "servo")
    assert done.returncode == 1
    assert f"'sonarhw-uno 0.1.0' for '{profile}' and '{turning}' answers; " in done.stderr
    assert "expected sonarhw-uno for hc-sr04 and servo; flash it again" in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [({"chip": "atmega328p"}, "signature"), ({"writes": False}, "verification mismatch")],
    ids=["other chip", "nothing is kept"],
)
def test_avrdude_refuses_another_chip_and_a_failed_verification(options: dict[str, object], message: str) -> None:
    with bootloader_board(OLD, **options) as board:
        done = sonarhw("flash", board.port)
    assert done.returncode == 1
    assert "avrdude ends with exit status 1" in done.stderr
    assert message in done.stderr.lower()
    if "chip" in options:
        assert not any(byte != 0xFF for byte in board.flash)


@pytest.mark.parametrize("firmware", ["", "other-board 1.0"])
def test_an_unknown_board_is_not_flashed(firmware: str, stand_in: Path) -> None:
    with bootloader_board(firmware) as board:
        done = sonarhw("flash", board.port)
    assert done.returncode == 2
    assert done.stderr.endswith(
        f"{board.port}: the board is not recognised; if you are sure, add --force and --controller\n"
    )
    assert not stand_in.exists()


def test_avrdude_gets_port_chip_and_image_and_its_last_line_is_shown(stand_in: Path) -> None:
    with bootloader_board(OLD) as board:
        done = sonarhw("flash", board.port)
    assert done.returncode == 1
    assert done.stderr.endswith("avrdude ends with exit status 1: chip does not answer\n")
    arguments = stand_in.read_text().strip()
    assert arguments == f"-q -p atmega2560 -c wiring -P {board.port} -b 115200 -D -U flash:w:{IMAGE}:i"


def test_a_missing_avrdude_is_named_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    done = sonarhw("flash", "/dev/ttyACM0")
    assert done.returncode == 2
    assert "avrdude: not found; install it: apt install avrdude" in done.stderr
    assert done.stderr.count("\n") == 1
