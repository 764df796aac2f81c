"""The forest plot of a contest: each pose set's error against random sets, with intervals."""

from testbed.report.plots import Look, interval, rows_of
from testbed.report.svg import DARK, MIDDLE, SOFT, drawing, svg_of
from testbed.studies.over_robots import Outcome, percent_of
from testbed.studies.pose_sets.compare import Contest, Entry
from testbed.studies.trial.plots import MOST_VIEWS

LOOKS: dict[Outcome, Look] = {
    "better": {"marker": "o", "color": DARK},
    "worse": {"marker": "^", "color": MIDDLE},
    "undecided": {"marker": "s", "color": SOFT, "markerfacecolor": "white"},
}
"""Marker and color of each outcome."""
SHORT = {"best_of_random": "best of random"}


def kind(entry: Entry) -> str:
    """What kind of set this is, in a few words: the same for every size."""
    trial = entry.trial
    method = SHORT.get(trial.method, trial.method)
    if trial.method == "random":
        return method
    if trial.rows == "paper":
        rows = "" if trial.method == "detmax" else ", paper rows"
        whose = "paper's " if trial.method == "detmax" else ""
        return f"{whose}{trial.selection.criterion} ({method}{rows})"
    return f"{trial.selection.criterion} ({method})"


def kinds(contest: Contest) -> dict[str, dict[int, Entry]]:
    """Entries by kind and size; a second one of its kind and size is called by its name."""
    table: dict[str, dict[int, Entry]] = {}
    for entry in contest.entries:
        row = table.setdefault(kind(entry), {})
        if entry.poses in row:
            row = table.setdefault(entry.trial.name, {})
        row[entry.poses] = entry
    return table


def forest(contest: Contest) -> str:
    """Error against random sets of the same size in percent, one panel per size."""
    sizes = contest.sizes[:MOST_VIEWS]
    rows = {
        name: row
        for name, row in kinds(contest).items()
        if any(m in row and row[m].ratio is not None for m in sizes)
    }
    with drawing(1, len(sizes), height=0.75 + 0.21 * len(rows), sharex=True, sharey=True) as (
        figure,
        axes,
    ):
        for ax, m in zip(axes, sizes, strict=True):
            ax.axvline(0.0, color=SOFT, linewidth=0.9)
            for y, row in enumerate(rows.values()):
                entry = row.get(m)
                if entry is None or entry.ratio is None or entry.joint is None:
                    continue
                look = LOOKS[entry.outcome]
                ends = percent_of(entry.ratio)[1:], percent_of(entry.joint)[1:]
                interval(ax, y, *ends, look["color"])
                ax.plot(percent_of(entry.ratio)[0], y, markersize=4.4, linestyle="none", **look)
            ax.set_title(f"{m} poses")
            ax.set_xlabel("error against random [%]")
            rows_of(ax, list(rows))
        return svg_of(figure)
