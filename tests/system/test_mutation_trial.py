"""A mutant is detected if a test fails or does not end, and its file is restored."""

import json
import subprocess
import sys
from pathlib import Path

TRIALS = """
import json, sys
from pathlib import Path
from tests.mutation.mutants import mutants_of
from tests.mutation.trial import Tree
source = Path(sys.argv[1], "counting.py").read_bytes()
tree = Tree(Path(sys.argv[1]), startup=2.0)
mutants = [mutant for mutant in mutants_of("counting.py", source) if str(mutant) in sys.argv[2:]]
print(json.dumps({str(mutant): tree.survives(mutant, ["test_counting.py"], 0.1) for mutant in mutants}))
"""


def test_mutants_are_detected_by_failures_and_by_endless_loops(tmp_path: Path) -> None:
    counting = "def count(n):\n    k = 0\n    while k != n:\n        k += 1\n    return k\n"
    (tmp_path / "counting.py").write_text(counting)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    (tmp_path / "test_counting.py").write_text(
        "from counting import count\n\ndef test_it():\n    assert count(3) is not None\n"
    )
    harmless = "counting.py:3: k != n  →  (k == n)"
    failing, endless = "counting.py:5: return k  →  return None", "counting.py:4: k += 1  →  k -= 1"
    command = [sys.executable, "-c", TRIALS, str(tmp_path), harmless, failing, endless]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    assert json.loads(done.stdout) == {harmless: True, failing: False, endless: False}
    assert (tmp_path / "counting.py").read_text() == counting
