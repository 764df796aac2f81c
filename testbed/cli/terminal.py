"""What people see on the terminal: progress with time left, and tables; the only user of rich."""

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import pi
from typing import IO, TYPE_CHECKING, Any, cast

from calib.errors import visible
from testbed.cli.output import Stderr, warn
from testbed.progress import Progress
from testbed.report.text import table

if TYPE_CHECKING:
    from testbed.robots.catalog import Robot


@contextmanager
def progress(*, quiet: bool) -> Iterator[Progress]:
    """A progress bar with time left on a terminal, plain lines elsewhere, nothing if quiet."""
    if quiet:
        yield lambda *_: None
    elif sys.stderr.isatty():
        with _bar() as report:
            yield report
    else:
        yield _Lines().report


EVERY = 60.0
"""Between two lines about one step [s]."""


class _Lines:
    """One line per finished step; of one in many pieces, now and then one with the time left."""

    def __init__(self) -> None:
        self._start = self._since = self._said = time.perf_counter()
        self._name, self._place, self._first = "", "", 0

    def report(self, name: str, done: int, steps: int) -> None:
        """Say what has ended and how long it took."""
        now = time.perf_counter()
        if name and name == self._name:
            if now >= self._said + EVERY:
                left = (now - self._since) / max(done - self._first, 1) * (steps - done)
                told = f"{left / 60:.0f} min" if left > 90 else f"{left:.0f} s"
                warn(f"[{done}/{steps}] {name}: about {told} left")
                self._said = now
            return
        if self._name:
            warn(f"{self._place} {self._name}: {now - self._since:.1f} s")
        self._name, self._place, self._first = name, f"[{done + 1}/{steps}]", done
        self._since = self._said = now
        if not name:
            warn(f"done in {now - self._start:.1f} s")


@contextmanager
def _bar() -> Iterator[Progress]:
    """A live bar on stderr."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description:<24}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(file=cast(IO[str], Stderr())), transient=True) as bar:
        task = bar.add_task("begin", total=None)

        def report(name: str, done: int, steps: int) -> None:
            bar.update(task, description=visible(name) or "done", completed=done, total=steps)

        yield report


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


def headline_rows(result: Mapping[str, Any]) -> list[list[str]]:
    """One row per trial and estimator of a result.json."""
    return [
        [
            name,
            mode,
            str(trial["poses"]),
            _mm(found["held_out_before"]["mean_mm"]),
            _mm(found["held_out_after"]["mean_mm"]),
            _mm(found["held_out_after"]["p95_mm"]),
            _mm(found["held_out_after"]["max_mm"]),
            _mm(found["stated_u_3d_rms_mm"]),
            f"{100 * found['held_out_inside_95']:.0f} %",
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
        f"Verdict: {result['verdict']['sentence']}",
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
    for name, names in robot.free_sets.items():
        parts.append(f"free set {name}: {', '.join(names)}")
    parts += [f"source of {what}: {source}" for what, source in robot.sources.items()]
    parts += [f"note: {note}" for note in robot.notes]
    return "\n".join(parts)
