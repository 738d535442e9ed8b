"""The two programs of the page on a minimum scanner pass every stage, and planted faults are named at theirs."""

import os
import subprocess
import sys
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sonarhw.bringup import Diagnosis, examine
from sonarhw.errors import NoAnswer
from sonarhw.host.scanner import Scanner
from sonarhw.protocol_check import check_protocol
from sonarhw.readings import sector
from tests.checkout import CHECKOUT
from tests.transcripts import blocks_of

PROGRAMS = {
    block.info: block.text
    for block in blocks_of(CHECKOUT / "docs" / "devices" / "minimum_scanner.md")
    if block.info in ("python", "c")
}
# the modules of MicroPython and the functions of Arduino that the programs use; the device is at standard input
MICROPYTHON = """
import os, select, sys, time, types

class Pin:
    IN = OUT = 0
    def __init__(self, *given, **named): pass
    def on(self): pass
    def off(self): pass
    duty_ns = __init__
    def read(self):
        ready, _, _ = select.select([0], [], [], 0.001)
        return os.read(0, 512) if ready else None
    def write(self, data):
        os.write(1, data)

machine = types.ModuleType("machine")
machine.UART = machine.PWM = machine.Pin = Pin
machine.time_pulse_us = lambda pin, level, most: 6000
sys.modules["machine"] = machine
time.sleep_us = time.sleep_ms = lambda duration: None
"""
ARDUINO = """
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#define min(a, b) ((a) < (b) ? (a) : (b))
typedef uint8_t byte;
enum { LOW, HIGH, OUTPUT };
static void delay(unsigned long) {}
static void delayMicroseconds(unsigned) {}
static void digitalWrite(byte, byte) {}
static void pinMode(byte, byte) {}
struct Servo { void attach(byte) {} void write(int) {} };
void setup();
void loop();
int main() { setup(); for (;;) loop(); }
"""
HOST = """
#include <poll.h>
#include <time.h>
#include <unistd.h>
static uint32_t micros() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000000ull + now.tv_nsec / 1000;
}
static uint32_t pulseIn(byte, byte, uint32_t) { return 6000; }
struct {
  void begin(long) {}
  int available() { pollfd input = {0, POLLIN, 0}; return poll(&input, 1, 1) > 0; }
  int read() { byte value; if (::read(0, &value, 1) != 1) exit(0); return value; }
  void write(byte value) { write(&value, 1); }
  void write(const byte *data, int count) { while (count-- > 0) if (::write(1, data++, 1) != 1) exit(0); }
} Serial;
"""
AVR = """
volatile uint32_t something;
static uint32_t micros() { return something; }
static uint32_t pulseIn(byte, byte, uint32_t) { return something; }
struct {
  void begin(long) {}
  int available() { return something; }
  int read() { return something; }
  void write(byte value) { something = value; }
  void write(const byte *data, int count) { while (count-- > 0) something = *data++; }
} Serial;
"""


@contextmanager
def running(command: list[str]) -> Iterator[str]:
    """Run a device at a pseudo-terminal, and yield its port."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with subprocess.Popen(command, stdin=master, stdout=master) as process:
        try:
            yield os.ttyname(slave)
        finally:
            process.kill()
            os.close(master)
            os.close(slave)


def micropython(folder: Path, program: str) -> list[str]:
    (folder / "main.py").write_text(MICROPYTHON + program, encoding="utf-8")
    return [sys.executable, str(folder / "main.py")]


def compiled(folder: Path, compiler: list[str], functions: str, program: str) -> str:
    (folder / "Servo.h").write_text("")
    (folder / "Arduino.h").write_text(ARDUINO + functions)
    (folder / "minimum.cpp").write_text(program, encoding="utf-8")
    options = ["-std=gnu++11", "-Wall", "-Wextra", "-Werror", "-I", str(folder), "-include", "Arduino.h"]
    built = str(folder / "minimum")
    subprocess.run([*compiler, *options, str(folder / "minimum.cpp"), "-o", built], check=True)
    return built


def arduino(folder: Path, program: str) -> list[str]:
    return [compiled(folder, ["g++"], HOST, program)]


def test_the_arduino_program_fits_into_an_uno(tmp_path: Path) -> None:
    compiler = ["avr-g++", "-mmcu=atmega328p", "-DF_CPU=16000000", "-Os"]
    built = compiled(tmp_path, compiler, AVR, PROGRAMS["c"])
    sizes = subprocess.run(["avr-size", built], check=True, capture_output=True, text=True).stdout
    text, data, bss = map(int, sizes.splitlines()[1].split()[:3])
    assert text + data < 24_000  # of 32 256 bytes; the core of the Arduino and its Servo library need the rest
    assert data + bss < 1500  # of 2048


@pytest.mark.parametrize("language", ["python", "c"])
def test_a_minimum_scanner_passes_every_stage_and_scans(language: str, tmp_path: Path) -> None:
    build = micropython if language == "python" else arduino
    with running(build(tmp_path, PROGRAMS[language])) as port:
        stages = list(check_protocol(port, turns=True))
        assert [(stage.check, stage.verdict) for stage in stages if stage.verdict != "pass"] == []
        assert len(stages) == 11
        with Scanner.open(port) as scanner:
            readings = list(scanner.scan(sector(0, 60, 10)))
            turntable = {made.check: made for made in examine(scanner, True, None)}
    assert turntable["steps"].verdict == "skip"
    assert turntable["echo moves"].text == "the table does not turn as far as the check"
    assert [round(reading.angle * 57.29578) for reading in readings] == [0, 10, 20, 30, 40, 50]
    assert all(reading.echo_times == (0.006,) for reading in readings)


MEASURE = "    if scanning:\n        measure()"
CONFIGURE = "elif kind == 0x02:"
SETTINGS = ", 0x84, command, listen_us, blanking_us, 0"
READING = ", 0x87, number, sweep, ping, angle, fired"
# by name: what is replaced in the program, by what, and the stage and the words that name it
FAULTS = {
    "big-endian CRC": ('"<I", crc32(body)', '">I", crc32(body)', "Hello", "CRC in big-endian order"),
    "CRC of the payload": ("crc32(body))))", "crc32(body[11:]))))", "Hello", "a CRC of the payload only"),
    "CRC not inverted": ("crc32(body))))", "crc32(body) ^ 0xFFFFFFFF)))", "Hello", "a CRC that is not inverted"),
    "no byte stuffing": ("uart.write(stuff(", 'uart.write(b"\\0" + (', "Hello", "not byte-stuffed"),
    "no zero byte": ('.split(b"\\0")) + b"\\0"', '.split(b"\\0"))', "Hello", "bytes without a zero byte"),
    "prints text": ("uart.write(stuff(", 'uart.write(b"got it\\n" + stuff(', "Hello", "text instead of frames"),
    "silent": ("uart.write(stuff(", "len(stuff(", "Hello", "no byte in answer to Hello"),
    "short time": ('"<HQ", sequence, clock()', '"<HI", sequence, clock() % 2**32', "Hello", "has 8 bytes, not 4"),
    "command": ('"<BHBB", 0x81, command', '"<BHBB", 0x81, command + 1', "Hello", "in `command`"),
    "only Hello": (CONFIGURE, f"{CONFIGURE}\n        return\n    elif 0:", "Configure", "answers Hello, not Configure"),
    "own speed": ("blanking_us, 0, sound)", "blanking_us, 0, 343)", "Configure", "speed_of_sound 343"),
    "no heartbeat": ("if greeted and clock()", "if False and clock()", "Heartbeat", "no Heartbeat"),
    "no Finished": ("    send(finished)\n\n", "\n\n", "Home", "no Finished for Home"),
    "angle": ("turn(start + step *", "turn(500 + start + 2 * step *", "StartScan", "angle"),
    "echo in µs": ("[width * 1000]", "[width]", "StartScan", "echo"),
    "fired": ("head = struct", "fired = 0\n    head = struct", "StartScan", "fired_us"),
    "fired in ms": ("head = struct", "fired //= 1000\n    head = struct", "StartScan", "in the header of a frame"),
    "always forwards": ("index if sweep % 2 else index", "index if False else index", "StartScan", "runs backwards"),
    "no readings": (MEASURE, "    if False:\n        measure()", "StartScan", "after each ping"),
    "wrong temperature": ("angle, fired, -32768", "angle, fired, 29300", "StartScan", "in 0.01 °C"),
    "no temperature": (f'BiQhB"{READING}, -32768', f'BiQB"{READING}', "StartScan", "temperature i16"),
    "wide count": ('"<BIHBiQhB"', '"<BIHBiQhH"', "StartScan", "echoes u32[]"),
    "no microsteps": ('"<hII", -32768, 0, 360', '"<hI", -32768, 0', "Hello", "microsteps u32"),
    "busy": ("3 if scanning else 0", "3 if scanning else 1", "Heartbeat", "HOMING"),
    "carries out again": ("if command == last and kind != 0x01", "if False", "repetition", "begins another scan"),
    "another reading": ("send(readings[kept])", "send(readings[kept][:-1] + b'!')", "Resend", "do not measure again"),
    "deaf": (MEASURE, "    while scanning:\n        measure(), time.sleep(0.02)", "Stop", "each pass of the main"),
    "endless scan": ("        finish(1)\n", "        pass\n", "Stop", "STOPPED"),
    "sequence": ("(sequence + 1) & 0xFFFF", "(sequence + 2) & 0xFFFF", "Hello or Configure", "follows"),
    "prints JSON": ("uart.write(stuff(", 'uart.write(b"{}\\n") or len(stuff(', "Hello", "text instead of frames"),
    "late": (CONFIGURE, f"{CONFIGURE}\n        time.sleep(0.7)", "Configure", "answers Configure after"),
    "late Hello": ("greeted = True\n", "greeted = True\n        time.sleep(1.2)\n", "Configure", "still answers Hello"),
    "short Settings": (f'BI"{SETTINGS}, sound', f'B"{SETTINGS}', "Configure", "speed_of_sound u32"),
    "no Accepted": ("True\n        reply(", "True\n        bool(", "Home", "without Accepted before it"),
    "deaf to repetition": ("  send(answer)\n        if", "  if", "repetition", "Finished of StartScan without Started"),
    "refuses a repetition": ("send(answer)\n", 'return refuse(command, 4, "")\n', "repetition", "the same sequence"),
    "no Resend": ("elif kind == 0x07 and", "elif kind == 0x17 and", "Resend", "every version has this command"),
    "milliseconds": ("sequence, clock()", "sequence, clock() // 1000", "clock", "times as fast"),
}


def checked(program: str, folder: Path) -> Diagnosis:
    with running(micropython(folder, program)) as port:
        return list(check_protocol(port, turns=True))[-1]


@pytest.mark.parametrize("name", FAULTS)
def test_a_planted_fault_is_named_at_its_stage(name: str, tmp_path: Path) -> None:
    old, new, stage, words = FAULTS[name]
    assert PROGRAMS["python"].count(old) >= 1
    found = checked(PROGRAMS["python"].replace(old, new), tmp_path)
    assert found.check in stage.split(" or "), found  # a heartbeat may come before or after Hello
    assert found.verdict == "FAIL"
    assert words in found.text + found.advice
    assert found.advice


def test_a_scan_of_a_device_that_answers_only_hello_ends_with_the_same_sentence(tmp_path: Path) -> None:
    old, new, _, words = FAULTS["only Hello"]
    sentence = "; `sonarhw doctor URL --protocol` checks its firmware"
    beating = PROGRAMS["python"].replace(old, new)
    for program in (beating, beating.replace(*FAULTS["no heartbeat"][:2])):
        with (
            running(micropython(tmp_path, program)) as port,
            Scanner.open(port) as scanner,
            pytest.raises(NoAnswer, match=words + sentence),
        ):
            scanner.configure()
    newer = PROGRAMS["python"].replace('"<BHBB", 0x81, command, 1, 0', '"<BHBB", 0x81, command, 1, 2')
    silent = newer.replace('refuse(command, UNKNOWN, "unknown command")', "return")
    with (
        running(micropython(tmp_path, silent)) as port,
        pytest.raises(NoAnswer, match="answers Hello, not AskCapabilities" + sentence),
    ):
        Scanner.open(port)
