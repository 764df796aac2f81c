"""The figures of uncertainty, one function each: what was stated beside what was true."""

from typing import TYPE_CHECKING

from testbed.report.plots import legend_above
from testbed.report.svg import SOFT, drawing, svg_of
from testbed.studies.trial.compare import INTERVAL
from testbed.studies.trial.plots import LOOKS, NAMES
from testbed.studies.trial.records import Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def parameter_errors(trial: Trial) -> str:
    """Error of each parameter in units of its own stated u, and how often intervals held it."""
    names = tuple(dict.fromkeys(n for e in trial.estimates for n in e.identification.names))
    played = [e for e in trial.estimates if e.replications is not None]
    rows = 2 if played else 1
    with drawing(rows, 1, height=1.0 + 1.65 * rows, sharex=True) as (figure, axes):
        ax = axes[0]
        ax.axhspan(-INTERVAL, INTERVAL, color="#e3ecf4", linewidth=0)
        ax.axhline(0.0, color=SOFT, linewidth=0.6)
        for estimate in trial.estimates:
            found = estimate.identification
            x = [names.index(name) for name in found.names]
            error = (estimate.comparison.true_step - found.step) / found.standard_uncertainty
            label = NAMES[estimate.mode]
            ax.plot(x, error, linestyle="none", label=label, **LOOKS[estimate.mode])
        ax.set_yscale("symlog", linthresh=4.0)
        _symlog_ticks(ax)
        ax.set_ylabel("error / stated u")
        ax.set_title(f"{trial.name}: this calibration; shaded: the 95 % interval")
        for estimate in played:
            ax, held = axes[1], estimate.replications
            assert held is not None
            x = [names.index(name) for name in estimate.identification.names]
            if estimate is played[0]:
                low, high = 100 * held.coverage_band
                ax.axhspan(low, high, color="#e3ecf4", linewidth=0)
                ax.set_title(
                    f"{held.count} replications; shaded: where an honest 95 % statement stays "
                    "(99.9 %)"
                )
            look = LOOKS[estimate.mode]
            ax.plot(x, 100 * held.parameter_coverage, linestyle="none", **look)
            ax.set_ylabel("intervals that\nheld the truth [%]")
            ax.set_ylim(-4, 104)
        axes[-1].set_xticks(range(len(names)), names, rotation=90)
        axes[-1].set_xlim(-0.7, len(names) - 0.3)
        legend_above(figure, axes[0])
        return svg_of(figure)


def _symlog_ticks(ax: "Axes") -> None:
    """Ticks of a scale that is linear inside the interval and logarithmic outside."""
    low, high = ax.get_ylim()
    marks = [
        m for m in (-1000, -100, -30, -10, -4, -2, 0, 2, 4, 10, 30, 100, 1000) if low <= m <= high
    ]
    ax.set_yticks(marks, [f"{mark:g}".replace("-", "−") for mark in marks])
    ax.minorticks_off()
