"""What all readings of a session share: from its systematic parts to numbers and words."""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Bool
from calib.identification.identify import Identification
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.shared import (
    HIDDEN,
    NOTHING,
    SharedErrors,
    corrected_errors,
    shared_errors,
)
from testbed.files.session import Session
from testbed.identify.calibration import Calibration
from testbed.lengths import column_unit
from testbed.report.page import Section, Table
from testbed.scenario.instrument import beam_of, errors_of
from testbed.store.quantities import METRE, Quantity, below
from testbed.units import fixed, percent

OF_NESTS = "nests that the drift was taken off by"
"""Name of their source."""


def shared_of(
    session: Session, identification: Identification, measurements: Measurements,
    used: Bool, judged: Bool,
) -> SharedErrors | None:  # fmt: skip
    """What the stated systematic parts and the nests leave in an identification; None without any.

    Parameters
    ----------
    session : Session
        Whose instrument it is.
    identification : Identification
        From the rows used.
    measurements : Measurements
        All rows (m).
    used, judged : (m,) array of bool
        Rows identified from, and those whose misses are shown.
    """
    train, test = measurements.rows(used), measurements.rows(judged)
    nests = None
    if session.corrections is not None:
        each = [session.corrections.rows(np.flatnonzero(some)) for some in (used, judged)]
        nests = corrected_errors(OF_NESTS, identification, train, test, (each[0], each[1]))
    if session.systematic is None:
        return nests
    further = len(identification.model.fixtures.stations)
    own = beam_of(session.systematic)
    # what is stated of one session of a robot holds for its others
    others = own if session.visits else np.eye(4)
    beams = np.stack([own, *others[None].repeat(further, axis=0)])
    found = shared_errors(errors_of(session.systematic), identification, train, test, beams)
    return found.joined(nests)


def states_instrument(found: SharedErrors | None) -> bool:
    """Whether systematic errors of the instrument are in what all readings share."""
    return found is not None and found.names != (OF_NESTS,)


def shared_section(calibration: Calibration) -> Section | None:
    """Each source with what it leaves at the tool, and what a held-out pose can show."""
    found = calibration.shared
    if found is None:
        return None
    held = calibration.split.is_test.any()
    scale, unit = column_unit([found.combined, *found.at_tool, *found.seen])
    places = 2 if unit == "µm" else 3
    rows = [
        (name, fixed(at_tool * scale, places), fixed(seen * scale, places), words)
        for name, at_tool, seen, words in zip(
            found.names, found.at_tool, found.seen, found.shown, strict=True
        )
    ]
    whole = ("all together", fixed(found.combined * scale, places), "", "")
    table = Table(
        caption="Standard uncertainty that all readings share, 3-D, root mean square over "
        + ("the held-out poses" if held else "the poses identified from"),
        head=("source", f"at the tool {unit}", f"seen {unit}", "enough to see it"),
        rows=(*rows, whole),
        align="lrrl",
        note="All readings are assumed to come from one instrument. At the tool: the part that "
        "the estimate takes over, by which the predicted tool point is wrong; a believed region "
        "includes it, and more poses do not reduce it. Seen: the part that the residuals show. "
        f"no: less than {HIDDEN:g} of what is left at the tool. negligible: less than "
        f"{percent(NOTHING)} of the whole is left there. The level of a station counts only for "
        "positions relative to gravity.",
    )
    return Section("shared", "Errors that all readings share", (table,))


def shared_numbers(found: SharedErrors | None) -> Iterator[Quantity]:
    """The same for result.json; nothing where nothing is stated."""
    if found is None:
        return
    yield Quantity("u_3d_mm", found.combined, METRE)
    for name, at_tool, seen, words in zip(
        found.names, found.at_tool, found.seen, found.sentences, strict=True
    ):
        yield from below(f"sources/{name}", [
            Quantity("at_tool_u_3d_mm", at_tool, METRE),
            Quantity("seen_u_3d_mm", seen, METRE),
            Quantity("sentence", words),
        ])  # fmt: skip
