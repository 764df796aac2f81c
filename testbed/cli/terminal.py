"""What people see on the terminal: progress with time left, and tables; the only user of rich."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from math import pi
from typing import IO, TYPE_CHECKING, Any, cast

from calib.errors import visible
from testbed.cli import timings
from testbed.cli.course import TimeLeft
from testbed.cli.output import Stderr, warn
from testbed.progress import Progress
from testbed.report.text import table, verdict_lines
from testbed.screen_reader import is_plain

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot


@contextmanager
def progress(
    work: str = "",
    planned: Mapping[str, int] | None = None,
    *,
    quiet: bool,
    workers: int = 1,
    learn: bool = True,
) -> Iterator[Progress]:
    """A progress bar with time left on a terminal, plain lines elsewhere, nothing if quiet.

    Parameters
    ----------
    work : str
        The verb and what it is played on: how long its steps took the last time is looked up, and
        kept for the next one when the block ends well.
    planned : mapping, optional
        Pieces of the steps that there will be, where that is known beforehand.
    quiet : bool
        Whether nothing is shown.
    workers : int
        Processes that play pieces side by side.
    learn : bool
        Whether the times are those of the whole work, to be kept.
    """
    course = TimeLeft(timings.expected(work, planned) if work else {}, workers)
    with nullcontext(_nothing) if quiet else _bar(course) if redrawn() else _lines(course) as show:

        def report(name: str, done: int, steps: int) -> None:
            course(name, done, steps)
            show(name, done, steps)

        yield report
    if work and learn and course.steps and not course.name:
        timings.remember(work, course.took)


def redrawn() -> bool:
    """Whether a line on stderr can be drawn again and again."""
    return sys.stderr.isatty() and not is_plain() and os.environ.get("TERM") != "dumb"


def _nothing(_name: str, _done: int, _steps: int) -> None:
    """Show nothing."""


EVERY = 60.0
"""Between two lines about one step [s]."""


@contextmanager
def _lines(course: TimeLeft) -> Iterator[Progress]:
    """One line per finished step; of one in many pieces, now and then one with the time left.

    Pieces count as steps: the line of those that were played says from which to which.
    """
    name, first, last = "", 0, 0
    start = since = said = course.clock()

    def report(begins: str, done: int, steps: int) -> None:
        nonlocal name, first, last, since, said
        now = course.clock()
        if begins and begins == name:
            last = done + 1  # one piece more of the same step
            if now >= said + EVERY and (left := course.left()) is not None:
                warn(f"[{done}/{steps}] {name}: about {timings.in_words(left)} left in all")
                said = now
            return
        if name:
            place = f"{first}-{last}" if last > first else f"{first}"
            warn(f"[{place}/{steps}] {name}: {now - since:.1f} s")
        name, first, last = begins, done + 1, done + 1
        since = said = now
        if not begins:
            warn(f"done in {now - start:.1f} s")

    yield report


@contextmanager
def _bar(course: TimeLeft) -> Iterator[Progress]:
    """A live bar on stderr: it moves with the time, also inside a long step."""
    from rich.console import Console
    from rich.progress import Progress, ProgressColumn, Task
    from rich.progress_bar import ProgressBar
    from rich.table import Column
    from rich.text import Text

    name = ""

    class LiveColumn(ProgressColumn):
        """One column, drawn from the course as it is at that moment."""

        def __init__(self, draw: Callable[[], str | ProgressBar], **column: Any) -> None:
            super().__init__(Column(no_wrap=True, **column))
            self._draw = draw

        def render(self, _task: Task) -> Text | ProgressBar:
            drawn = self._draw()
            return Text(drawn) if isinstance(drawn, str) else drawn

    def left() -> str:
        seconds = course.left()
        return f"about {timings.in_words(seconds)} left" if seconds else ""

    console = Console(file=cast(IO[str], Stderr()))
    narrow = console.width < NARROW
    columns = [
        LiveColumn(
            lambda: visible(name),
            min_width=None if narrow else 24,
            max_width=max(console.width - WORDS, 8) if narrow else None,
        ),
        LiveColumn(lambda: f"{min(course.done + 1, course.steps)}/{course.steps}" if name else ""),
        LiveColumn(left),
    ]
    if not narrow:
        columns.insert(
            1, LiveColumn(lambda: ProgressBar(total=1.0, completed=course.share(), width=30))
        )
    with Progress(*columns, console=console, transient=True, refresh_per_second=4) as bar:
        bar.add_task("")

        def report(begins: str, _done: int, _steps: int) -> None:
            nonlocal name
            name = begins or "done"

        yield report


WORDS = 25
"""Columns of a terminal that place and time left take."""
NARROW = 70
"""Columns of a terminal below which there is no room for a bar beside the words."""


HEAD = (
    "trial",
    "estimator",
    "poses",
    "before mm",
    "after mm",
    "p95 mm",
    "max mm",
    "u mm",
    "in 95 %",
    "chi2/dof",
    "believable",
)
"""Columns of the headline table: position errors on held-out poses, rms stated u (k = 1)."""


ESTIMATORS = {"whitened": "default"}
"""What a report calls an estimator, where that is not its key."""


def headline_rows(result: Mapping[str, Any]) -> list[list[str]]:
    """One row per trial and estimator of a result.json."""
    from testbed.units import percent, plain

    return [
        [
            name,
            ESTIMATORS.get(mode, mode),
            str(trial["poses"]),
            _mm(found["held_out_before"]["mean_mm"]),
            _mm(found["held_out_after"]["mean_mm"]),
            _mm(found["held_out_after"]["p95_mm"]),
            _mm(found["held_out_after"]["max_mm"]),
            _mm(found["stated_u_3d_rms_mm"]),
            plain(percent(found["held_out_inside_95"])),
            "-" if found["chi_square_per_dof"] is None else f"{found['chi_square_per_dof']:.2f}",
            "yes" if found["believable"] else "no" if found.get("contradicted", True) else "?",
        ]
        for name, trial in result["trials"].items()
        for mode, found in trial["estimates"].items()
    ]


def headline(result: Mapping[str, Any]) -> str:
    """The headline table of one run with its notice and verdict."""
    title = f"{result['scenario']}, seed {result['seed']}: tool error on held-out poses"
    parts = [
        result["notice"],
        table(title, HEAD, headline_rows(result)),
        "",
        *verdict_lines(result["verdict"]["sentence"]),
    ]
    parts += [f"FAILED {key}: {reason}" for key, reason in result.get("failed", {}).items()]
    return "\n".join(parts)


def _mm(value: float) -> str:
    """A length in mm, to a tenth of a micrometre."""
    return f"{value:.4f}"


def robot_text(robot: "Robot") -> str:
    """A robot for people: geometry, limits, named sets, sources."""
    chain = robot.model.chain
    rows = []
    for i, (theta, d, a, alpha, beta) in enumerate(chain.links):
        slides = chain.kinds[i] == "prismatic"
        unit, scale = ("mm", 1e3) if slides else ("deg", 180 / pi)
        low, high = robot.limits[i] * scale
        rows.append(
            [
                f"{i + 1} {chain.kinds[i]}",
                f"{theta * 180 / pi:g}",
                f"{d * 1e3:g}",
                f"{a * 1e3:g}",
                f"{alpha * 180 / pi:g}",
                f"{beta * 180 / pi:g}",
                f"{low:g} to {high:g} {unit}",
                f"{robot.repeatability[i] * 1e6:g} {'um' if slides else 'urad'}",
            ]
        )
    head = ("joint", "theta deg", "d mm", "a mm", "alpha deg", "beta deg", "limits")
    parts = [table(robot.title, (*head, "repeatability sd"), rows), ""]
    parts += filter(None, [robot.controller.sentence])
    for name, names in robot.free_sets.items():
        parts.append(f"free set {name}: {', '.join(names)}")
    parts += [f"source of {what}: {source}" for what, source in robot.sources.items()]
    parts += [f"note: {note}" for note in robot.notes]
    return "\n".join(parts)
