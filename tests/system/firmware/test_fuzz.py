"""Hostile bytes at everything behind the line, under sanitizers: no crash, no hang, nothing said while it listens."""

import subprocess
from pathlib import Path

from tests.conftest import Count


def test_hostile_sessions_do_no_harm(built: Path, count: Count) -> None:
    for seed in range(count(2, 200)):
        subprocess.run([built / "fuzz", "1000", str(seed)], check=True)


def test_bytes_at_random_do_no_harm(built: Path) -> None:
    noise = b"".join(bytes([(n * n * 2654435761 >> 13) & 0xFF]) for n in range(60_000))
    subprocess.run([built / "fuzz"], input=noise, check=True)
