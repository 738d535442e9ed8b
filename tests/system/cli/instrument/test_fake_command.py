"""`sonarhw fake`, `info`, `home`, `turn`, `stop`, `monitor` and `ports` with a fake scanner."""

import re
import signal
from pathlib import Path

from sonarhw.device.faults import KNOWN
from sonarhw.log import read_log
from tests.fixtures.commands import end, lines, printed, printed_json, sonarhw, started
from tests.reference_pages import keys_in_reference

ROOM = ("kuc_siegel", "--place", "figure6")  # it has few paths, so the fake is ready at once


def test_a_fake_on_a_pseudo_terminal_is_scanned_and_removes_its_link(tmp_path: Path) -> None:
    link, log = tmp_path / "scanner", tmp_path / "scan.mcap"
    with started("fake", *ROOM, "--pty", link, "--pace", "max") as fake:
        assert lines(fake, 1) == [f"{link}\n"]
        done = sonarhw("scan", link, "--out", log, "--step", "30")
        assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
        fake.send_signal(signal.SIGTERM)
        assert end(fake) == (0, "")
    assert not link.is_symlink()
    recorded = read_log(log)
    assert len(recorded.readings) == 12
    assert (recorded.info.serial, recorded.info.board) == ("FAKE-0000", "polaroid-6500")


def test_the_help_of_the_fake_names_every_fault() -> None:
    text = printed("fake", "--help")
    assert [name for name in KNOWN if name not in text] == []


def test_a_fake_prints_its_new_url_after_a_move(tmp_path: Path) -> None:
    link = tmp_path / "scanner"
    faults = ("--faults", "move=1@20,move=1@30", "--pace", "100")
    with started("fake", *ROOM, "--pty", link, *faults) as fake:
        assert lines(fake, 3) == [f"{link}\n", f"{link}-1\n", f"{link}-2\n"]
        assert sonarhw("info", f"{link}-2").returncode == 0


def test_a_scan_of_a_fake_with_faults_is_complete_and_reports_the_losses(tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    faults = "drop=1/3000,reset=0.1@r3,move=0.5@r8"
    url = f"fake:kuc_siegel?place=figure6&pace=2&faults={faults}"
    done = sonarhw("scan", url, "--out", log, "--step", "30")
    assert done.returncode == 0
    assert re.search(r"the connection was lost \d+ times? and restored", done.stderr)
    assert [reading.number for reading in read_log(log).readings] == list(range(12))


def test_info_as_json_has_the_documented_keys(url: str) -> None:
    found = printed_json("info", url)
    facts = {"url": url, "origin": "fake", "serial": "FAKE-0002", "protocol": "1.2", "temperature_c": 21.3, "starts": 1}
    assert facts.items() <= found.items()
    assert found["capabilities"]["lowest_angle_deg"] == -720.0
    assert found["link"]["frames_received"] >= 22
    assert set(found) == keys_in_reference("### `sonarhw info")


def test_info_watch_prints_link_statistics_until_it_is_interrupted(url: str) -> None:
    with started("info", url, "--watch") as info:
        shown = lines(info, 15)
        info.send_signal(signal.SIGINT)
        assert end(info) == (130, "")
    assert re.match(r"ready +\d+ frames, 0 missing, .*; clock drift [+-]\d+ ppm", shown[-1])


def test_monitor_shows_frames_until_it_is_interrupted(url: str) -> None:
    with started("monitor", url) as monitor:
        shown = ""
        while "Heartbeat(state=0" not in shown:
            (line,) = lines(monitor, 1)
            assert line
            shown += line
        monitor.send_signal(signal.SIGINT)
        status, closing = end(monitor)
    assert "Info(command=0" in shown
    assert status == 130
    counted = re.fullmatch(rf"{re.escape(url)}: (\d+) frames and 0 rejected blocks in \d+\.\d s\n", closing)
    assert counted
    assert int(counted[1]) >= len(shown.splitlines())
