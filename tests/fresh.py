"""What code does in a process that has loaded nothing yet."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def python(*words, cwd=ROOT, check=True, **environment):
    """What came of an interpreter that was given these words and finds this checkout."""
    path = os.pathsep.join(map(str, (ROOT, ROOT / "testbed" / "front")))
    return subprocess.run(
        [sys.executable, *map(str, words)], cwd=cwd, check=check, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": path, **environment}, timeout=300,
    )  # fmt: skip


def printed(code):
    """The words that code prints."""
    return python("-c", code).stdout.split()
