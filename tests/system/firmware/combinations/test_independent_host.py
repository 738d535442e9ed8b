"""A host written from firmware_protocol.md alone talks to every emulated image and program, without a special case."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import pytest

from sonarhw.device.emulated_board import emulated_board
from tests.system.firmware.combinations.document_host import DocumentHost, codes
from tests.system.firmware.combinations.images import combinations
from tests.system.firmware.conftest import PACE, Echoes

FLIGHT = 0.0123  # s


@contextmanager
def connected(combination: str) -> Iterator[DocumentHost]:
    """A host that is connected to the emulated board."""
    with emulated_board(Echoes(FLIGHT), pace=PACE, start_deg=20, combination=combination) as board:
        host = DocumentHost(board.url)
        try:
            yield host
        finally:
            host.close()


def find_zero(host: DocumentHost) -> None:
    """Home, or set the zero by hand where the device refuses to home because it has no mark."""
    since = len(host.received)
    sequence, _ = host.send("Home")
    answer = host.wait(lambda one: one.fields.get("command") == sequence, since)
    if answer.name == "Refused":
        assert answer.fields["code"] == codes("Refusal")["OUT_OF_RANGE"]
        assert host.answer("SetZero").name == "Accepted"
    else:
        end = host.wait(lambda one: one.name == "Finished" and one.fields["command"] == sequence, since)
        assert end.fields["outcome"] == codes("Outcome")["DONE"], end


EVERY = combinations() + combinations("PROGRAMS")
SWITCHED = [(combination, "ONE_SWITCH") for combination in EVERY if combination.endswith("step-dir")]


@pytest.mark.parametrize(("combination", "wiring"), [*((combination, "") for combination in EVERY), *SWITCHED])
def test_a_host_written_from_the_document_scans(combination: str, wiring: str) -> None:
    with connected(combination) as host:
        assert host.answer("AskStatistics").fields["code"] == codes("Refusal")["NO_HELLO"]
        info = host.greet().fields
        setting = codes("Wiring").get(wiring, 0)
        assert host.answer("ConfigureWiring", change=setting, inverted=setting).fields["inverted"] == setting
        able = host.answer("AskCapabilities").fields
        if able["fastest_baud"]:
            host.use_baud(able["fastest_baud"])
        listen = min(20_000, able["longest_listen_us"])
        configure = {"listen_us": listen, "blanking_us": max(2_380, able["shortest_blanking_us"]), "trace": 0}
        asked = {"speed_of_sound": 343_200, "pulses": 0, "echoes": 4, "rearm_us": 0, "trace_rate": 0, "trace_bits": 0}
        assert host.answer("Configure", **configure, **asked).name == "Settings"
        order = {"start": 0, "step": 10_000_000, "headings": 4, "sweeps": 2, "pings": 1, "in_place": 0}
        refused = host.answer("StartScan", **order, first=0, count=0).fields
        assert refused["code"] == codes("Refusal")["NOT_HOMED"]
        find_zero(host)
        end, received, wire = host.act("StartScan", **order, first=0, count=0)
        assert (end.fields["outcome"], end.fields["readings"]) == (codes("Outcome")["DONE"], 8)
        found = [one.fields for one in received if one.name == "ReadingMessage"]
        assert [one["number"] for one in found] == [*range(8)]
        step = 360e6 / info["microsteps"]
        wanted = [0, 10e6, 20e6, 30e6, 30e6, 20e6, 10e6, 0]
        assert [one["angle"] for one in found] == pytest.approx(wanted, abs=step / 2 + 1)
        assert [one["echoes"][0] for one in found] == pytest.approx([FLIGHT * 1e9] * 8, abs=1000)
        fired = [one["fired_us"] for one in found]
        assert min(b - a for a, b in pairwise(fired)) >= able["ping_period_us"]
        beats = [one.time_us for one in received if one.name == "Heartbeat"]
        # delayed by listening, and by messages before it
        assert max(b - a for a, b in pairwise(beats)) <= 250_000 + listen + 5_000
        check_repeats(host, wire, found)
        beyond = host.answer("Turn", angle=able["highest_angle"] + 1_000_000, relative=0).fields
        assert beyond["code"] == codes("Refusal")["OUT_OF_RANGE"]
        assert host.answer("AskStatistics").fields["pings"] == 8
        assert host.answer("Stop").name == "Accepted"


def check_repeats(host: DocumentHost, scan: bytes, found: list[dict[str, object]]) -> None:
    """A repeated command is answered again and not carried out again; kept readings are sent again."""
    since = len(host.received)
    host.send_again(scan)
    host.wait(lambda one: one.name == "Finished", since)
    assert [one.name for one in host.received[since:] if one.name != "Heartbeat"] == ["Started", "Finished"]
    since = len(host.received)
    assert host.answer("Resend", first=6, count=2).name == "Accepted"
    host.wait(lambda one: one.name == "ReadingMessage" and one.fields["number"] == 7, since)
    assert [one.fields for one in host.received[since:] if one.name == "ReadingMessage"] == found[6:]
