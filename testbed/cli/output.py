"""What a verb prints: every stream takes it, whatever its encoding, and whether anyone listens.

What steers a terminal is written out: words of files are only shown.
"""

import errno
import io
import os
import re
import stat
import sys
from contextlib import suppress
from typing import Any

from calib.errors import STEERING, MachineError, visible
from testbed.screen_reader import is_plain

GOOD, CARE = "1;36", "1;33"
"""Bold cyan and bold yellow: told apart by everyone, on dark and on light."""
STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def open_streams() -> None:
    """Point at nothing what the caller has closed, and replace what an encoding does not have.

    Left closed, its number would be that of the next file opened, and print into it.
    """
    for name, mode in STREAMS:
        if getattr(sys, name) is None:
            nothing = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(nothing, mode, encoding="utf-8"))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def say(text: str = "", *, color: str = "") -> None:
    """Print a line on stdout; a reader or terminal that went away (``| head``) is no error."""
    shown = f"\x1b[{color}m{visible(text)}\x1b[0m" if color and colored() else visible(text)
    try:
        print(shown, flush=True)  # noqa: T201  # the one place that prints
    except OSError as error:
        gone = isinstance(error, BrokenPipeError) or (error.errno == errno.EIO and _is_device())
        drop_stdout()
        if gone:
            return
        message = f"cannot be written: {error.strerror}"
        raise MachineError(message, code="F3", where="stdout", fix="free some space") from error


def say_found(text: str, *, good: bool | None = None) -> None:
    """Print what a verb found, folded at the terminal's edge; its verdict has a color.

    The color only says once more what the words say; None: the verdict is neither good nor bad.
    """
    from testbed.report.text import HANGING, VERDICT, folded

    is_verdict = False
    for line in folded(text).split("\n"):
        goes_on = is_verdict and line.startswith(" " * HANGING)
        is_verdict = good is not None and (line.startswith(VERDICT) or goes_on)
        say(line, color=(GOOD if good else CARE) if is_verdict else "")


def say_next(*words: object, when: str = "") -> None:
    """Print the command to type next, as a shell takes it: names with spaces are quoted."""
    import shlex

    say(f"Next       {when}{shlex.join(map(str, words))}")


def colored() -> bool:
    """Whether stdout is a terminal that shows colors, and its user wants them."""
    wanted = not os.environ.get("NO_COLOR") and not is_plain()
    return wanted and sys.stdout.isatty() and os.environ.get("TERM") not in (None, "", "dumb")


def say_json(text: str) -> None:
    """Print a JSON document, with escapes for what the encoding of stdout may not have."""
    import json

    whole = (getattr(sys.stdout, "encoding", None) or "").lower() == "utf-8"
    # these characters stand inside strings only
    escaped = STEERING.pattern if whole else r"[^\n\x20-\x7e]"
    say(re.sub(escaped, lambda found: json.dumps(found[0])[1:-1], text))


def warn(text: str) -> None:
    """Print a line on stderr, if anyone still reads it."""
    with suppress(OSError, ValueError):
        print(visible(text), file=sys.stderr, flush=True)  # noqa: T201  # the one place that prints


class Stderr:
    """The stream of a progress bar: stderr as long as anyone reads it."""

    def write(self, text: str) -> int:
        """Write as much as is wanted."""
        with suppress(OSError, ValueError):
            sys.stderr.write(text)
        return len(text)

    def flush(self) -> None:
        """Show what was written."""
        with suppress(OSError, ValueError):
            sys.stderr.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(sys.stderr, name)


def _is_device() -> bool:
    """Whether stdout is a terminal, also one that was closed, and no file."""
    try:
        return stat.S_ISCHR(os.fstat(sys.stdout.fileno()).st_mode)
    except (OSError, ValueError):
        return False


def drop_stdout() -> None:
    """Point stdout nowhere, so that flushing at exit does not complain."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
