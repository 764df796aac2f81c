"""The fits of the rows that identify, repeated until those that plainly do not fit are found."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Bool
from calib.identification.identify import Identification
from calib.identification.larger_noise import noise_factor
from calib.identification.robust import Loss
from calib.measurement.observations import Measurements
from testbed.files.session import Session
from testbed.identify.fit import Fitted, fit, plain_fit, scatter_covariance
from testbed.identify.handback.links import LinkBelief, link_belief
from testbed.identify.outliers import LookedAt, Looking, second_look
from testbed.identify.records import Choice


@dataclass(frozen=True, slots=True, eq=False)
class CleanFit:
    """Fits without rows that plainly do not fit, and what was found of these."""

    left_out: Bool
    """(m,) rows that identify no more."""
    used: Bool
    """(m,) rows that do."""
    train: Measurements
    """These rows."""
    plain: Identification
    """Of the geometry."""
    links: LinkBelief
    """How far the links may be off, by the file and by the plain fit."""
    pairs: tuple[Fitted, ...]
    """The models: the geometric one first."""
    choice: Choice
    shots: LookedAt
    """Rows that do not fit, by the model that is handed out."""

    @property
    def handed(self) -> Fitted:
        """The model that was chosen."""
        return next(each for each in self.pairs if each[0] == self.choice.chosen)


def clean_fit(
    session: Session,
    looking: Looking,
    shots: LookedAt,
    plain: Identification,
    measurements: Measurements,
    is_train: Bool,
    *,
    model: str,
    loss: Loss,
    leaves_out: bool,
) -> CleanFit:
    """Fit, look for rows that do not fit, and fit without them, until no others are found.

    Parameters
    ----------
    session : Session
        What it says of links and loads.
    looking : Looking
        The rows that may identify, and how bad ones are looked for.
    shots : LookedAt
        What the first look found.
    plain : Identification
        Of the geometry, from all these rows.
    measurements : Measurements
        All rows (m).
    is_train : (m,) array of bool
        Which of them may identify.
    model, loss
        As asked, see `fit`.
    leaves_out : bool
        Whether bad shots are left out; else they are only named.
    """
    frames, places = looking.frames, np.flatnonzero(is_train)
    while True:
        left_out = np.zeros(len(measurements), dtype=bool)
        left_out[places[shots.bad]] = leaves_out
        used = is_train & ~left_out
        train = measurements.rows(used)
        if left_out.any() or loss != "squared":
            plain = plain_fit(frames.start, train, frames.parameters, loss)
        factor = noise_factor(plain.model, train)
        scatter = scatter_covariance(frames.start, plain, train, factor)
        links = link_belief(looking.robot, session, looking, train, plain, scatter, factor)
        pairs, choice = fit(
            frames.start,
            train,
            frames.parameters,
            model=model,
            loss=loss,
            seed=looking.seed,
            plain=plain,
            mounted=looking.mounted,
            known=looking.known,
            links=links.prior,
            held=bool(links.why),
            ladders=looking.bends,
        )
        found = CleanFit(left_out, used, train, plain, links, pairs, choice, shots)
        shots = second_look(looking, found.handed, found.shots)
        if shots is found.shots or not len(shots.bad) or not leaves_out:
            return replace(found, shots=shots)
