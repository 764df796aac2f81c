"""Frames of held-out visits: fitted to some of their poses, the robot held; the others judge."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, frozen
from calib.errors import InputError
from calib.geometry.frames import inverse
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, parameters_of
from calib.identification.identify import Identification, identify
from calib.identification.start.start import start_frames
from calib.identification.sufficiency import require_equations
from calib.measurement.observations import Measurements, joined
from calib.measurement.prediction import predict
from calib.uncertainty.statement.gain import least_squares_gain
from testbed.files.refusal import refusal
from testbed.files.session import Session
from testbed.files.visits.tables import FEWEST
from testbed.identify.records import FittedModel, HeldOutSplit
from testbed.identify.visits.split import frame_rows
from testbed.units import counted

HARDLY = 1e-6
"""Weight of a pose that fits frames, beside one that identifies: it tells nothing of the links."""


@dataclass(frozen=True, slots=True, eq=False)
class OwnFrames:
    """The frames of held-out visits, and the rows that they are fitted to."""

    numbers: tuple[str, ...]
    rows: Bool
    """(m,)"""
    table: Measurements
    """These rows."""
    start: RobotModel
    """Where the frames are about, beside the training's."""

    def among(self, measurements: Measurements) -> "OwnFrames":
        """The same by other covariances of all rows (m)."""
        return replace(self, table=measurements.rows(self.rows))

    def placed(self, model: RobotModel) -> RobotModel:
        """A model with these frames fitted, all other numbers held."""
        return self._fit(model).model

    def extended(self, found: Identification) -> Identification:
        """An identification with these frames among its numbers.

        References
        ----------
        Two steps: x from the training, then f = G (y - A x) from the poses of the frames. With
        K = G A the covariance is [[C, -C K'], [-K C, G N G' + K C K']].
        """
        own = self._fit(found.model)
        everything = found.parameters.freeing((*found.names, *own.names))
        return replace(
            found,
            model=own.model,
            parameters=everything,
            step=_filled(everything, (found, found.step), (own, own.step)),
            covariance=self._joint(found, own, found.covariance, own.covariance),
            rank=found.rank + own.rank,
            notes=(*found.notes, *self._notes(own)),
        )

    def of_fit(self, fit: FittedModel) -> tuple[Identification, Array]:
        """The identification of a fit with these frames, and what its residuals' scatter says."""
        own = self._fit(fit.identification.model)
        factor = max(1.0, fit.noise_factor)
        scatter = self._joint(fit.identification, own, fit.scatter, factor**2 * own.covariance)
        return self.extended(fit.identification), scatter

    def weighed(self, found: Identification, used: Bool) -> Identification:
        """An extended identification as an estimate by the rows used and those of the frames.

        A row that hardly counts tells frames that it alone shows, and no number that others show.
        """
        weights = np.full(len(self.rows), HARDLY)
        weights[used] = found.weights if len(found.weights) else 1.0
        return replace(found, weights=frozen(weights[used | self.rows]))

    def _fit(self, model: RobotModel) -> Identification:
        """Least squares over these frames alone."""
        here, there = self.start, model.fixtures
        named = {name.split(".")[0] for name in self.numbers}

        def placed(kind: str, mine: Array, theirs: Array, first: int) -> Array:
            own = [f"{kind}{k + first}" in named for k in range(len(mine))]
            return np.where(np.reshape(own, (-1, *[1] * (mine.ndim - 1))), mine, theirs)

        own = here.fixtures
        # the start stands about another base by what the links moved it
        about = model.chain.T_world_base @ inverse(here.chain.T_world_base)
        fixtures = replace(
            there,
            reflectors=placed("reflector", own.reflectors, there.reflectors, 1),
            stations=placed("station", about @ own.stations, there.stations, 2),
            tools=placed("tool", own.tools, there.tools, 2),
        )
        begun = replace(model, fixtures=fixtures)
        return identify(begun, self.table, parameters_of(begun, self.numbers))

    def _joint(
        self, found: Identification, own: Identification, links: Array, frames: Array
    ) -> Array:
        """Covariance of all numbers from those of the training's and of the frames alone."""
        G = least_squares_gain(own.model, own.parameters, self.table)
        A = predict(own.model, self.table).rows[:, :, found.parameters.free_index]
        K = np.einsum("mfe,mek->fk", G, A)
        moved = np.block([[links, -links @ K.T], [-K @ links, frames + K @ links @ K.T]])
        together = found.parameters.freeing((*found.names, *own.names))
        order = np.concatenate([found.parameters.free_index, own.parameters.free_index])
        places = np.argsort(order, kind="stable")
        assert len(places) == together.n_free  # no number is of both
        return frozen(moved[np.ix_(places, places)])

    def _notes(self, own: Identification) -> tuple[str, ...]:
        """What became of the frames, in words."""
        frames = list(dict.fromkeys(name.split(".")[0] for name in self.numbers))
        said = (
            f"{', '.join(frames)} of held-out sessions: fitted to {self.table.n_poses} of their "
            "poses, the robot held"
        )
        return (said, *own.reduction.sentences)


def own_frames(session: Session, start: RobotModel, split: HeldOutSplit) -> OwnFrames | None:
    """The frames of held-out visits; None where there are none.

    Parameters
    ----------
    session : Session
        Of several visits.
    start : RobotModel
        Nominal links, the frames of the training visits about where they are.
    split : HeldOutSplit
        Of its rows; those of held-out visits that do not judge fit their frames.
    """
    numbers = tuple(name for visit in session.visits if visit.held_out for name in visit.numbers)
    if not numbers:
        return None
    rows, measurements = frame_rows(session, split), session.measurements
    table = measurements.rows(rows)
    require_determined(session, start, table, numbers)
    free_tool = session.wanted.tool == "free"
    both = joined([measurements.rows(split.is_train), table])
    found = start_frames(start, both, free_tool=free_tool).model
    return OwnFrames(numbers, rows, table, found)


def require_determined(
    session: Session, model: RobotModel, table: Measurements, free: Collection[str]
) -> None:
    """Refuse frames of a visit that its poses do not determine.

    Parameters
    ----------
    session : Session
        Of several visits.
    model : RobotModel
        Nominal links.
    table : Measurements
        The rows that frames are fitted to.
    free : collection of str
        Names of the numbers that are fitted.

    Raises
    ------
    InputError
        M27: names the visit, and how many poses would do.
    """
    for k, visit in enumerate(session.visits):
        frames = {name.split(".")[0] for name in visit.numbers}
        if not k:
            frames |= {"base", "tool", "station1", "tool1"}
        numbers = [name for name in free if name.split(".")[0] in frames]
        if not numbers:
            continue
        shown = np.zeros(len(table), dtype=np.bool_)
        for kind in ("station", "tool", "reflector"):
            own = [int(name[len(kind) :]) for name in frames if name[len(kind) :].isdigit()
                   and name.startswith(kind)]  # fmt: skip
            shown |= np.isin(getattr(table, kind) + 1, own)
        rows = table.rows(shown)
        every = session.measurements.rows(np.flatnonzero(session.visit == k))
        where = f'{session.stated_in}: frames of session "{visit.name}"'
        if rows.n_poses < every.n_poses:
            where += f" ({rows.n_poses} of its {counted(every.n_poses, 'pose')}, the rest held out)"
        if not len(rows):
            raise refusal(
                where, "session", "no pose determines them", code="M27",
                fix=f"measure {FEWEST} poses or more there",
            )  # fmt: skip
        try:
            require_equations(model, rows, parameters_of(model, numbers))
        except InputError as error:
            raise error.located(where) from error


def _filled(together: Parameters, *parts: tuple[Identification, Array]) -> Array:
    """Values (f,) of all free numbers from those of each part."""
    full = np.zeros(len(together.names))
    for one, values in parts:
        full[one.parameters.free_index] = values
    return frozen(full[together.free_index])
