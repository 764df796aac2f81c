"""How a verb ends: its exit code, one sentence per error, no traceback."""

import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from calib.errors import CalibError, InputError, MachineError

GOOD, SOME_FAILED, BAD_INPUT, MACHINE, DEFECT, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 70, 130, 143
Handler = Callable[[int, FrameType | None], Any] | int | None


class Terminated(BaseException):
    """SIGTERM arrived: no error, the system asks us to end."""


@dataclass(slots=True)
class Exit:
    """How a verb ends and reports its errors; it may fill in more as it goes."""

    debug: bool = False
    as_json: bool = False
    folder: Path | None = None
    """Where a crash report goes."""
    resume: Sequence[str] = ()
    """Command that goes on after an interruption."""
    code: int = GOOD
    """Exit code if nothing is raised."""


@contextmanager
def exit_codes(*, debug: bool = False, as_json: bool = False) -> Iterator[Exit]:
    """Run a verb; whatever it raises becomes one sentence on stderr and an exit code.

    0 good; 1 finished, some trial failed; 2 bad input; 3 machine; 70 our defect; 130 SIGINT; 143
    SIGTERM. A closed pipe ends quietly.
    """
    end = Exit(debug=debug, as_json=as_json)
    old = _catch_sigterm()
    try:
        yield end
    except (KeyboardInterrupt, Terminated) as stop:
        leave(_stopped(end, stop))
    except BrokenPipeError:
        _close_stdout()
        leave(end.code)
    except CalibError as error:
        if debug:
            traceback.print_exc()
        _report(end, str(error), error.code)
        leave(_code(error))
    except Exception as error:
        if debug:
            traceback.print_exc()
        _report(end, _defect(end, error), "X70")
        leave(DEFECT)
    finally:
        if old is not None:
            signal.signal(signal.SIGTERM, old)
    leave(end.code)


def say(text: str = "") -> None:
    """Print a line on stdout; a reader that went away (``| head``) is no error."""
    try:
        print(text, flush=True)  # noqa: T201  # the one place that prints
    except BrokenPipeError:
        _close_stdout()
    except OSError as error:
        _close_stdout()
        message = f"cannot be written: {error.strerror}"
        raise MachineError(message, code="F3", where="stdout", fix="free some space") from error


def warn(text: str) -> None:
    """Print a line on stderr, if anyone still reads it."""
    with suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201  # the one place that prints


def leave(code: int) -> NoReturn:
    """End the verb with an exit code."""
    import typer

    with suppress(OSError, ValueError):
        sys.stdout.flush()
    raise typer.Exit(code)


def _code(error: CalibError) -> int:
    """Exit code of one of our errors."""
    if isinstance(error, MachineError):
        return MACHINE
    return BAD_INPUT if isinstance(error, InputError) else SOME_FAILED


def _report(end: Exit, text: str, code: str) -> None:
    """One error, for people or for programs."""
    if end.as_json:
        import json

        say(json.dumps({"error": {"code": code, "message": text}}, ensure_ascii=False))
    else:
        warn(text)


def _stopped(end: Exit, stop: BaseException) -> int:
    """Say how to go on after an interruption."""
    text = "stopped"
    if end.resume and end.folder is not None and end.folder.exists():
        import shlex

        text += f"; what is finished is kept. To go on:\n  {shlex.join(end.resume)}"
    _report(end, text, "F5")
    return TERMINATED if isinstance(stop, Terminated) else INTERRUPTED


def _defect(end: Exit, error: Exception) -> str:
    """Keep the traceback of a defect of ours in crash.txt and say where."""
    text = f"this is a defect of truebed: {type(error).__name__}: {error}"
    if end.folder is not None and end.folder.is_dir():
        from testbed.store.layout import CRASH

        with suppress(OSError):
            (end.folder / CRASH).write_text(traceback.format_exc(), encoding="utf-8")
            return f"{text}; please report it with {end.folder / CRASH}. [X70]"
    return f"{text}; --debug shows more. [X70]"


def _catch_sigterm() -> Handler:
    """Turn SIGTERM into an exception that unwinds; the handler there was before."""

    def stop(_number: int, _frame: FrameType | None) -> NoReturn:
        raise Terminated

    try:
        return signal.signal(signal.SIGTERM, stop)
    except ValueError:  # not in the main thread
        return None


def _close_stdout() -> None:
    """Point stdout nowhere, so that flushing at exit does not complain."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
