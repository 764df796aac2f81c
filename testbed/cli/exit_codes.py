"""How a verb ends: its exit code, one sentence per error, no traceback."""

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
from testbed.cli.output import drop_stdout, say_json, warn
from testbed.machine import Room, lacking, ran_out, require_room
from testbed.screen_reader import plain_if

GOOD, SOME_FAILED, BAD_INPUT, MACHINE, DEFECT, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 70, 130, 143
Handler = Callable[[int, FrameType | None], Any] | int | None


class Terminated(BaseException):
    """SIGTERM or SIGHUP arrived: no error, the system asks us to end."""


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
def exit_codes(
    *, debug: bool = False, as_json: bool = False, plain: bool = False, room: Room | None = None
) -> Iterator[Exit]:
    """Run a verb; whatever it raises becomes one sentence on stderr and an exit code.

    0 good; 1 finished, some trial failed; 2 bad input; 3 machine; 70 our defect; 130 SIGINT; 143
    SIGTERM, or SIGHUP when the terminal closes. A closed pipe ends quietly. With `plain`
    all that is printed inside is for a screen reader.
    """
    end = Exit(debug=debug, as_json=as_json)
    old = _catch_stops()
    try:
        if room is not None:
            require_room(room)
        with plain_if(plain):
            yield end
    except (KeyboardInterrupt, Terminated) as stop:
        leave(_stopped(end, stop))
    except BrokenPipeError:
        drop_stdout()
        leave(end.code)
    except CalibError as error:
        if debug:
            warn(traceback.format_exc().rstrip())
        _report(end, str(error), error.code)
        leave(_code(error))
    except Exception as error:
        if debug:
            warn(traceback.format_exc().rstrip())
        scarce = ran_out(error) or lacking(error)
        if scarce is not None:
            _report(end, str(scarce), scarce.code)
            leave(MACHINE)
        _report(end, _defect(end, error), "X70")
        leave(DEFECT)
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)
    leave(end.code)


def leave(code: int) -> NoReturn:
    """End the verb with an exit code."""
    import typer

    with suppress(OSError, ValueError):
        sys.stdout.flush()
    raise typer.Exit(code)


def _code(error: CalibError) -> int:
    """Exit code of one of our errors; a file that could not be opened for lack of room is good."""
    if isinstance(error, MachineError) or ran_out(error) is not None:
        return MACHINE
    return BAD_INPUT if isinstance(error, InputError) else SOME_FAILED


def _report(end: Exit, text: str, code: str) -> None:
    """One error, for people or for programs."""
    if end.as_json:
        import json

        say_json(json.dumps({"error": {"code": code, "message": text}}, ensure_ascii=False))
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
        from testbed.disk import atomic_write
        from testbed.store.layout import CRASH

        with suppress(OSError, MachineError):
            atomic_write(end.folder / CRASH, traceback.format_exc().encode(errors="replace"))
            return f"{text}; please report it with {end.folder / CRASH}. [X70]"
    return f"{text}; --debug shows more. [X70]"


def _catch_stops() -> dict[int, Handler]:
    """Turn SIGTERM and SIGHUP into an exception that unwinds; the handlers there were before.

    What the process was started to ignore stays ignored: so does SIGHUP under nohup. A closing
    terminal sends it twice; the second one does not disturb the unwinding.
    """

    def stop(_number: int, _frame: FrameType | None) -> NoReturn:
        for number in old:
            signal.signal(number, signal.SIG_IGN)
        raise Terminated

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    old: dict[int, Handler] = {}
    with suppress(ValueError):  # not in the main thread
        for number in numbers:
            if signal.getsignal(number) != signal.SIG_IGN:
                old[number] = signal.signal(number, stop)
    return old
