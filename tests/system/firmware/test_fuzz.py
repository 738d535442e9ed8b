"""Hostile bytes cause no crash, no hang and no sending while listening; run with sanitizers."""

import subprocess
from pathlib import Path

from tests.conftest import Count


def test_hostile_sessions_cause_no_error(built: Path, count: Count) -> None:
    for seed in range(count(2, 200)):
        subprocess.run([built / "fuzz", "1000", str(seed)], check=True)


def test_random_bytes_cause_no_error(built: Path) -> None:
    noise = b"".join(bytes([(n * n * 2654435761 >> 13) & 0xFF]) for n in range(60_000))
    subprocess.run([built / "fuzz"], input=noise, check=True)
