"""A mutant is detected if a test fails or does not end, and its file is restored."""

import json
import subprocess
import sys
from pathlib import Path

from tests.hang_guard import HANG

TRIALS = """
import json, sys
from pathlib import Path
from tests.mutation.mutants import mutants_of
from tests.mutation.trial import Tree
source = Path(sys.argv[1], "counting.py").read_bytes()
tree = Tree(Path(sys.argv[1]), startup=float(sys.argv[3]))
mutants = [mutant for mutant in mutants_of("counting.py", source) if str(mutant) in sys.argv[4:]]
print(json.dumps({str(mutant): tree.survives(mutant, [sys.argv[2]], 0.1) for mutant in mutants}))
"""

COUNTING = "def count(n):\n    k = 0\n    while k != n:\n        k += 1\n    return k\n"


def survives(folder: Path, test: str, tests: str, *mutants: str, startup: float = HANG) -> dict[str, bool]:
    (folder / "counting.py").write_text(COUNTING)
    (folder / "pytest.ini").write_text("[pytest]\n")
    (folder / "test_counting.py").write_text(tests)
    done = subprocess.run(
        [sys.executable, "-c", TRIALS, str(folder), test, str(startup), *mutants], stdout=subprocess.PIPE, check=True
    )
    assert (folder / "counting.py").read_text() == COUNTING
    found: dict[str, bool] = json.loads(done.stdout)
    return found


def test_mutants_are_detected_by_failures_and_by_endless_loops(tmp_path: Path) -> None:
    tests = "from counting import count\n\ndef test_it():\n    assert count(3) is not None\n"
    harmless = "counting.py:3: k != n  →  (k == n)"
    failing, endless = "counting.py:5: return k  →  return None", "counting.py:4: k += 1  →  k -= 1"
    found = survives(tmp_path, "test_counting.py::test_it", tests, harmless, failing)
    found |= survives(tmp_path, "test_counting.py::test_it", tests, endless, startup=2.0)
    assert found == {harmless: True, failing: False, endless: False}


def test_a_test_that_fails_only_once_detects_nothing(tmp_path: Path) -> None:
    seen = tmp_path / "seen"
    once = "from pathlib import Path\n\ndef test_once():\n"
    once += f"    seen = Path({str(seen)!r})\n    passes = seen.exists()\n    seen.touch()\n    assert passes\n"
    harmless = "counting.py:3: k != n  →  (k == n)"
    assert survives(tmp_path, "test_counting.py::test_once", once, harmless) == {harmless: True}
    assert seen.exists()
