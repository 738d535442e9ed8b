"""The Makefile: targets end when their commands end."""

import subprocess
from pathlib import Path

from tests.checkout import CHECKOUT


def test_demo_ends_while_the_rest_is_compiled(tmp_path: Path) -> None:
    (tmp_path / "bin").mkdir()
    for name, text in (("python", "exec sleep 20"), ("sonarhw", "echo shown")):
        program = tmp_path / "bin" / name
        program.write_text(f"#!/bin/sh\n{text}\n")
        program.chmod(0o755)
    command = ["make", f"VENV={tmp_path}", f"--assume-old={tmp_path}/installed"]
    for made in ("installed", "compiled_for_demo"):
        (tmp_path / made).touch()
    done = subprocess.run([*command, "demo"], cwd=CHECKOUT, capture_output=True, text=True, timeout=10, check=True)
    assert done.stdout.endswith("shown\n")
