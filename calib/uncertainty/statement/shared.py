"""What the errors that all readings share leave at the tool, and what no held-out pose shows of it.

An error that is the same all campaign long is in the readings that identify and in those that
judge. The estimate follows it, so that held-out readings agree with what is wrong.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters
from calib.identification.identify import Identification
from calib.measurement.corrections import Corrections
from calib.measurement.observations import GIVEN, POINT, Measurements, joined
from calib.measurement.prediction import predict
from calib.shown import Shown, length_words
from calib.uncertainty.statement.gain import beside_held, estimator_gain, of_all_numbers
from calib.uncertainty.statement.instrument import PLACE, SOURCES, InstrumentErrors, shared_rows

HIDDEN = 0.3
"""Seen over left at the tool below which no held-out pose can show a source."""
NOTHING = 0.01
"""A source that leaves less than this share of the whole at the tool does not count."""
UNSEEN = "held-out poses of this instrument show too little of it"
SEEN = "held-out poses show it"
LITTLE = "it hardly reaches the tool"
SHOWN = {SEEN: "yes", UNSEEN: "no", LITTLE: "negligible"}
"""Each sentence in the word of a table."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedErrors(Shown):
    """What all readings share, source by source, and what held-out poses can show of it."""

    names: Annotated[tuple[str, ...], "s"]
    """(s,) sources."""
    at_tool: Annotated[Array, "s"]
    """(s,) 3-D standard uncertainty that each leaves at the tool, RMS over the poses judged [m]."""
    seen: Annotated[Array, "s"]
    """(s,) what each leaves in the position residuals of these poses, likewise [m]."""
    covariance: Annotated[Array, "P", "P"]
    """(P, P) that all of them leave in the numbers of the model [m, rad]."""

    def __repr__(self) -> str:
        size = length_words(self.combined, um=".3g")
        return f"SharedErrors({size} at the tool, {len(self.names)} sources)"

    def joined(self, other: "SharedErrors | None") -> "SharedErrors":
        """Both, independent of each other, over the same poses."""
        if other is None:
            return self
        return SharedErrors(
            (*self.names, *other.names),
            frozen(np.concatenate([self.at_tool, other.at_tool])),
            frozen(np.concatenate([self.seen, other.seen])),
            frozen(self.covariance + other.covariance),
        )

    @property
    def combined(self) -> float:
        """3-D standard uncertainty that all of them leave at the tool, RMS [m]."""
        return float(np.sqrt((self.at_tool**2).sum()))

    @property
    def hidden(self) -> tuple[str, ...]:
        """Sources that count at the tool and that no held-out pose of the instrument can show."""
        return tuple(
            name for name, words in zip(self.names, self.sentences, strict=True) if words == UNSEEN
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """(s,) whether held-out poses can show each of them, in words."""
        counts = self.at_tool > NOTHING * self.combined
        seen = self.seen >= HIDDEN * self.at_tool
        return tuple(
            SEEN if it_shows else UNSEEN if it_counts else LITTLE
            for it_counts, it_shows in zip(counts, seen & counts, strict=True)
        )

    @property
    def shown(self) -> tuple[str, ...]:
        """(s,) the same in a word: yes, no, or negligible."""
        return tuple(SHOWN[words] for words in self.sentences)


def shared_errors(
    errors: InstrumentErrors,
    identification: Identification,
    train: Measurements,
    judged: Measurements,
    T_station_beam: Array,
) -> SharedErrors:
    """What the errors of the instrument leave after an identification by weighted least squares.

    Parameters as in `planned_errors`.
    """
    model, parameters = identification.model, identification.parameters
    gain = estimator_gain(identification, train)
    return planned_errors(errors, model, parameters, gain, train, judged, T_station_beam)


def planned_errors(
    errors: InstrumentErrors,
    model: RobotModel,
    parameters: Parameters,
    gain: Array,
    train: Measurements,
    judged: Measurements,
    T_station_beam: Array,
) -> SharedErrors:
    """What the errors of the instrument leave at the tool, and what of it residuals can show.

    Each target on the tool has a place of its own that it is wrong by.

    Parameters
    ----------
    errors : InstrumentErrors
        Their sizes.
    model : RobotModel
        Identified; of a plan the nominal one.
    parameters : Parameters
        Its free numbers.
    gain : (m, f, 6) array
        F: how they follow each row of `train` [m, rad].
    train : Measurements
        What is identified from; its readings play no part.
    judged : Measurements
        Rows of the same campaign, held out where there are any: both columns are of these.
    T_station_beam : (s, 4, 4) array
        As in `shared_rows`.

    References
    ----------
    C_sys = F B S B' F'; at the tool J C_sys J', in a residual (B_h - J_h F B) S (B_h - J_h F B)'.
    JCGM 100:2008, 4.3, 5.2.
    """
    free = parameters.free_index
    both, m = joined([train, judged]), len(train)
    B = shared_rows(errors, model, both, T_station_beam) * np.sqrt(errors.variance)
    looked_at = np.column_stack([both.offset, both.is_pose, both.reflector, both.tool])
    _, target = np.unique(looked_at, axis=0, return_inverse=True)
    rows = predict(model, judged).rows[:, :3, free]
    names, left, seen, covariance = [], [], [], np.zeros((len(free), len(free)))
    for name in dict.fromkeys(SOURCES):
        own = B[:, :, [k for k, source in enumerate(SOURCES) if source == name]]
        if not own.any():
            continue
        group = target.ravel() if name == SOURCES[PLACE.start] else np.zeros(len(both), np.int64)
        moved = np.zeros((int(group.max()) + 1, len(free), own.shape[2]))
        np.add.at(moved, group[:m], gain @ own[:m])
        part = np.einsum("gak,gbk->ab", moved, moved)
        absorbed = rows @ moved[group[m:]]
        # what other targets left in the estimate shows at this one, too
        others = _variance(rows, part) - (absorbed**2).sum((1, 2))
        shown = ((own[m:, :3] - absorbed) ** 2).sum((1, 2)) + np.maximum(others, 0.0)
        names.append(name)
        left.append(at_the_tool(model, judged, parameters, part))
        seen.append(np.sqrt(shown.mean()))
        covariance += part
    return SharedErrors(
        tuple(names), frozen(left), frozen(seen), beside_held(parameters, covariance)
    )


def corrected_errors(
    name: str,
    identification: Identification,
    train: Measurements,
    judged: Measurements,
    corrections: tuple[Corrections, Corrections],
) -> SharedErrors:
    """What the errors of corrections leave after an identification by weighted least squares.

    Parameters
    ----------
    name : str
        What the source is called.
    identification : Identification
        From `train`.
    train, judged : Measurements
        Rows identified from, and those that both columns are of.
    corrections : tuple of Corrections
        Of the rows of `train` and of `judged`.

    References
    ----------
    As `planned_errors`, with S of each correction.
    """
    gain, free = estimator_gain(identification, train), identification.parameters.free_index
    rows = predict(identification.model, judged).rows[:, :3, free]
    moved = corrections[0].followed(gain)
    whole = np.moveaxis(moved, 0, 1).reshape(len(free), -1)
    part, seen = whole @ whole.T, corrections[1].left(rows, moved)
    left = at_the_tool(identification.model, judged, identification.parameters, part)
    return SharedErrors(
        (name,), frozen([left]), frozen([np.sqrt(seen.mean())]),
        of_all_numbers(identification, part),
    )  # fmt: skip


def at_the_tool(
    model: RobotModel, judged: Measurements, parameters: Parameters, covariance: Array
) -> float:
    """3-D standard uncertainty of the tool, RMS, by a covariance (f, f) of the free numbers [m]."""
    tool = _tool_rows(model, judged)[:, :, parameters.free_index]
    return float(np.sqrt(_variance(tool, covariance).mean()))


def _variance(rows: Array, covariance: Array) -> Array:
    """Sum over x, y, z of the variances (m,) of what rows (m, 3, f) are the derivatives of."""
    return np.asarray(np.einsum("mif,fg,mig->m", rows, covariance, rows, optimize=True))


def _tool_rows(model: RobotModel, table: Measurements) -> Array:
    """Derivatives (m, 3, P) of each row's target in the world, however it was measured."""
    m = len(table)
    as_points = replace(
        table,
        kind=np.full(m, POINT),
        station=np.zeros(m, np.int64),
        anchor=np.full(m, GIVEN),
        distance=np.zeros(m),
    )
    return predict(model, as_points).rows[:, :3]
