"""The flashed firmware on the emulated board: driver, protocol, chip and simulated ranging board together.

Tests of the board's timing send nothing meanwhile: the times of host messages depend on the load of the machine.
"""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sonarhw import sector
from sonarhw.device.emulated_board import emulated_board
from sonarhw.errors import InputError
from sonarhw.link import Link
from sonarhw.readings import Origin, Ping, PingResult, origin_of
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from tests.contract.talk import Talk, readings
from tests.fixtures.plain_echoes import PlainEchoes
from tests.system.firmware.combinations.images import MEGA, UNO, budgets, vector
from tests.system.firmware.conftest import FIRMWARE, PACE, Echoes, Mishap, scanner_on

DOCUMENT = (FIRMWARE.parent / "docs" / "devices" / "firmware.md").read_text()
TRACE_STORE = 4_800  # bytes
OTHER_VARIABLES = 1_680
FREE_STACK = 1_024


STOPPED_HOST = """
import sys
from sonarhw import Scanner
with Scanner.open(sys.argv[1]) as scanner:
    before = scanner.statistics
    print("open", flush=True)
    scanner.home()
    after = scanner.statistics
    print(after.losses - before.losses, after.rejected_blocks - before.rejected_blocks, flush=True)
"""


def losses_with_a_stop() -> str:
    """Stop the host for longer than the firmware waits for it; return what it prints."""
    with (
        emulated_board(Echoes(0.020), pace=PACE) as board,
        subprocess.Popen([sys.executable, "-c", STOPPED_HOST, board.url], stdout=subprocess.PIPE, text=True) as host,
    ):
        try:
            assert host.stdout.readline() == "open\n"
            host.send_signal(signal.SIGSTOP)
            time.sleep(4.0)
        finally:
            host.send_signal(signal.SIGCONT)
        losses = host.stdout.readline()
    assert host.returncode == 0
    return losses


def test_the_time_of_the_board_stops_while_the_machine_stops_the_host() -> None:
    """Otherwise the firmware treats the host as gone each time, and returns to the first baud rate.

    A busy machine may also stop the emulator for longer than the driver waits for bytes, which is no fault.
    """
    assert any(losses_with_a_stop() == "0 0\n" for _ in range(3))


def test_as_fast_as_possible_the_board_does_not_give_up_a_host_that_sends_in_time() -> None:
    program = "linux-polaroid-step-dir"  # runs hundreds of times faster than real time, on a busy machine too
    with emulated_board(Echoes(), pace="max", combination=program) as board, Link(board.url) as link:
        talk = Talk(link)
        talk.greet()
        began = talk.received[-1].frame.time_us
        # sends every half second of real time; the firmware gives up after two seconds of its own time
        messages = talk.until(lambda _: talk.received[-1].frame.time_us > began + 2_500_000)
    assert not any(isinstance(message, msg.Refused) for message in messages)


def test_pings_are_as_frequent_as_documented() -> None:
    rows = re.findall(r"^\| ([\d.]+) ms, [\d.]+ m \| ([\d.]+)° \| (yes|yes or no) \| ([\d.]+) \|$", DOCUMENT, re.M)
    assert len(rows) == 4
    with emulated_board(Echoes(0.020), pace=PACE) as board, Link(board.url) as link:
        talk = Talk(link)
        talk.greet()
        talk.ask(msg.SetBaud(1_000_000), msg.Accepted)
        link.set_baud(1_000_000)
        talk.home()
        for listen, step, traces, documented in rows:
            for trace in [True, False][: len(traces.split(" or "))]:
                talk.ask(msg.Configure(round(float(listen) * 1000), 2_380, int(trace), 343_200), msg.Settings)
                # in board time, without host messages in between
                fired = fire_times_without_host_messages(talk, msg.StartScan(0, round(float(step) * 1e6), 9, 1, 1))
                assert 1e6 / np.median(np.diff(fired)) == pytest.approx(float(documented), abs=0.1)


def fire_times_without_host_messages(talk: Talk, order: msg.StartScan) -> list[int]:
    """Return the times of the pings of a scan, µs. Sends nothing meanwhile, so the scan must end within 2 s."""
    since = len(talk.received)
    talk.send(order)
    messages = talk.until(lambda all: any(isinstance(one, msg.Finished) for one in all), since, alive=False)
    assert [message.outcome for message in messages if isinstance(message, msg.Finished)] == [msg.Outcome.DONE]
    return [message.fired_us for message in readings(messages)]


def test_memory_and_stack_stay_within_the_documented_limits(built: Path) -> None:
    sizes = subprocess.run(["avr-size", "-A", built / f"{MEGA}.elf"], capture_output=True, text=True, check=True).stdout
    used = sum(int(size) for size in re.findall(r"^\.(?:data|bss|noinit)\s+(\d+)", sizes, re.M))
    assert used <= TRACE_STORE + OTHER_VARIABLES
    with scanner_on(Echoes(*np.arange(1, 60) * 1e-3)) as (_, scanner):
        for traces in (True, False):
            scanner.configure(trace=traces)
            list(scanner.scan(sector(0, 20, 5)))
        assert scanner.device_statistics().stack_free >= FREE_STACK


def test_interrupt_handlers_stay_within_their_budgets() -> None:
    handlers = budgets(MEGA)
    assert len(handlers) == 7
    with scanner_on(Echoes(0.001, 0.007, 0.020)) as (board, scanner):
        scanner.configure(trace=True)
        list(scanner.scan(sector(0, 30, 10)))
        scanner.configure(blanking=0.050)
        list(scanner.scan(sector(0, 10, 10)))
        longest = board.longest_interrupts()
    for (name, _), budget in handlers.items():
        assert 0 < longest[vector(MEGA, name)] <= budget, name


@pytest.mark.parametrize(
    ("combination", "way", "cause"), [(MEGA, "reset", msg.ResetCause.BUTTON), (UNO, "hang", msg.ResetCause.WATCHDOG)]
)
def test_a_scan_continues_after_a_reset(combination: str, way: str, cause: msg.ResetCause) -> None:
    echoes = Mishap(0.020, before=3)
    with scanner_on(echoes, combination=combination) as (board, scanner):
        assert origin_of("scan", scanner.info.firmware, scanner.info.serial) is Origin.FAKE
        assert scanner.device_statistics().reset_cause == msg.ResetCause.POWER
        echoes.act = getattr(board, way)
        readings = [*scanner.scan(sector(0, 40, 5))]
        assert (scanner.info.boot, scanner.device_statistics().reset_cause) == (2, cause)
        assert scanner.statistics.resets == 1
    assert sorted(reading.number for reading in readings) == [*range(8)]


class Interrupted(Echoes):
    """Echo source that sends bytes to the board at the start of each ping, when the board does not read them."""

    line: Link

    def receive(self, ping: Ping) -> PingResult:
        """Send noise and return the given echoes."""
        self.line.write(b"\x55" * 400 + b"\0")
        return super().receive(ping)


def test_lost_received_bytes_are_counted_and_cause_no_error() -> None:
    echoes = Interrupted(0.020)
    with emulated_board(echoes, pace=PACE) as board, Link(board.url) as echoes.line:
        talk = Talk(echoes.line)
        talk.greet()
        talk.home()
        _, messages, finished = talk.act(msg.StartScan(0, 1_000_000, 3, 1, 1))
        assert finished.outcome == msg.Outcome.DONE
        assert sum(isinstance(message, msg.ReadingMessage) for message in messages) == 3
        assert talk.ask(msg.AskStatistics(), msg.Statistics).overruns >= 3 * (400 - 128)


def test_a_host_that_never_pauses_delays_neither_heartbeats_nor_pings() -> None:
    with emulated_board(Echoes(0.020), pace=PACE) as board, Link(board.url) as link:
        talk = Talk(link)
        talk.greet()
        talk.home()
        talk.ask(msg.StartScan(0, 1_000_000, 700, 1, 1), msg.Started)
        since, began = len(talk.received), talk.received[-1].frame.time_us
        ended = threading.Event()

        def chatter() -> None:
            while not ended.is_set():
                talk.send(msg.AskStatistics())

        writer = threading.Thread(target=chatter)
        writer.start()
        try:
            talk.until(lambda _: talk.received[-1].frame.time_us > began + 4_000_000, since, alive=False)
        finally:
            ended.set()
            writer.join()
        received = talk.received[since:]
        beats = [item.frame.time_us for item in received if isinstance(item.message, msg.Heartbeat)]
        # a ping listens for 65 ms, and the board sends nothing meanwhile
        assert len(beats) >= 14
        assert max(later - earlier for earlier, later in pairwise(beats)) < 350_000
        assert sum(isinstance(item.message, msg.ReadingMessage) for item in received) >= 25
        statistics = [item.message for item in received if isinstance(item.message, msg.Statistics)]
        assert {one.reset_cause for one in statistics} == {msg.ResetCause.POWER}
        # the line was full: the board could not keep all bytes
        assert statistics[-1].overruns > 1000


class Broken(Echoes):
    """Echo source that fails at the first ping."""

    def receive(self, ping: Ping) -> PingResult:
        """Raise ZeroDivisionError."""
        raise ZeroDivisionError


def test_a_failing_echo_source_ends_the_board_and_its_error_is_raised() -> None:
    with pytest.raises(ZeroDivisionError), emulated_board(Broken(), pace=PACE) as board:  # noqa: PT012
        with Link(board.url) as link:
            talk = Talk(link)
            talk.greet()
            talk.home()
            talk.send(msg.StartScan(0, 1_000_000, 3, 1, 1))
        assert board.wait() == 0


def test_serial_number_and_count_of_starts_survive_a_power_failure(tmp_path: Path) -> None:
    infos = []
    for _ in range(2):
        with scanner_on(Echoes(0.020), eeprom=tmp_path / "eeprom") as (_, scanner):
            infos.append(scanner.info)
    assert re.fullmatch(r"SONAR-[0-9A-F]{6}", infos[0].serial)
    assert [info.serial for info in infos] == [infos[0].serial] * 2
    assert [info.boot for info in infos] == [1, 2]


def test_a_client_that_never_sets_the_speed_of_the_terminal_gets_answers() -> None:
    with emulated_board(Echoes(), pace=PACE) as board:
        terminal = os.open(board.url, os.O_RDWR | os.O_NOCTTY)
        try:
            os.write(terminal, encode_frame(Frame(msg.Hello.TYPE, 1, 0, msg.Hello(1, 0).pack())))
            received = b""
            while not received.endswith(b"\0"):
                received += os.read(terminal, 100)
        finally:
            os.close(terminal)
        frame = next(FrameDecoder().feed(received))
        assert frame.type == msg.Info.TYPE


def test_the_link_to_the_terminal_replaces_and_removes_nothing_of_the_user(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.write_text("mine")
    link.symlink_to("elsewhere")
    for taken in (file, link):
        with pytest.raises(InputError, match=f"{taken.name}: exists already"), emulated_board(PlainEchoes(), taken):
            pass
    assert (file.read_text(), os.readlink(link)) == ("mine", "elsewhere")
