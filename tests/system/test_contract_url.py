"""`pytest tests/contract --url`: with a fake scanner, and without a scanner at the URL."""

import subprocess
import sys

from tests.checkout import CHECKOUT
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice
from tests.hang_guard import HANG

ONE_TEST = "tests/contract/test_scanner.py::test_a_scan_gives_every_reading_once_in_time_order"


def contract_tests(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG, cwd=CHECKOUT)


def test_a_fake_url_is_a_scanner_under_test() -> None:
    done = contract_tests("-q", ONE_TEST, "--url", "fake:rooms/kuc_siegel.toml?place=figure6&pace=10")
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 passed" in done.stdout


def test_a_text_device_is_tested_with_its_own_tests() -> None:
    sketch = SKETCHES["CSV over a whole turn"]
    with PrintingDevice(sketch.rounds()) as device:
        done = contract_tests("-q", "tests/contract", "--url", f"lines:{device.port}?{sketch.query}")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert "3 passed" in done.stdout


def test_without_a_scanner_one_line_states_why() -> None:
    url, reason = "/dev/no-such-port", "there is no such port; `sonarhw ports` lists the existing ones"
    done = contract_tests("tests/contract", "-q", "--url", url)
    assert done.returncode == 2
    lines = [line for line in done.stdout.splitlines() if line]
    (line,) = [line for line in lines if f"--url {url}: no scanner to test: " in line]
    assert reason in line
    assert "failed" not in done.stdout
    assert "error" not in done.stdout.lower()
    assert len(lines) <= 3
