"""Golden texts, word for word, so that a change is seen.

Write one again with ``TRUEBED_UPDATE=1 pytest FILE``, and read the difference.
"""

import os
from pathlib import Path


def assert_as_written(text, name):
    """The text is that of a golden file."""
    golden = Path(__file__).with_name(name)
    if os.environ.get("TRUEBED_UPDATE"):
        golden.write_text(text, encoding="utf-8")
    assert text == golden.read_text(encoding="utf-8")
