"""What code prints in a process that has loaded nothing yet."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def printed(code: str) -> list[str]:
    """Its words."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=True,
    )  # fmt: skip
    return done.stdout.split()
