"""Drafts of full poses whose rotations fit in no order that is tried: their places alone."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from calib.errors import InputError
from testbed.proposal.data import Document, Found
from testbed.proposal.drafts import Draft
from testbed.proposal.fits.tried import tried_with
from testbed.robots.robot import Robot

OF_TURNS = (
    *("rx_", "ry_", "rz_", "rvx_", "rvy_", "rvz_", "e1_", "e2_", "e3_", "axis_"),
    *("qw", "qx", "qy", "qz", "r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"),
    *("urx", "ury", "urz", "U95rx", "U95ry", "U95rz"),
)
"""How our names of columns of rotations begin."""
NOT_USED = "rotations: they fit in no order that is tried, and are not used; the places are"


def places_alone(
    drafts: Sequence[Draft], looks: tuple[Found, ...], robot: Robot, root: Path
) -> tuple[Draft, str] | None:
    """The draft of the places alone that fits best and how well; None if none does.

    Turns in an order that is not tried are no reason to lose the places beside them.
    """
    places = {
        repr(one.document): one for one in map(_without_turns, drafts) if one is not None
    }  # many differ by the order of turns alone
    if not places:
        return None
    try:
        best, tried, fits = tried_with(list(places.values()), looks, robot, root)
    except InputError:  # what is wrong with the full poses has been said
        return None
    return (best, tried) if fits else None


def _without_turns(draft: Draft) -> Draft | None:
    """A draft of full poses as one of places alone; None of others."""
    frames: Document | None = draft.document.get("frames")
    if frames is None or draft.jointless or frames.get("format", "csv") != "csv":
        return None
    columns = {
        own: theirs
        for own, theirs in frames.get("columns", {}).items()
        if not own.startswith(OF_TURNS)
    }
    keys = {key: value for key, value in frames.items() if key not in ("euler", "gives", "columns")}
    points = keys | ({"columns": columns} if columns else {})
    document = {("points" if key == "frames" else key): (points if key == "frames" else value)
                for key, value in draft.document.items()}  # fmt: skip
    noise = {
        key: value
        for key, value in document.get("uncertainty", {}).items()
        if not key.startswith("rotation")
    }
    notes = tuple(
        note
        for note in draft.notes
        if not note.startswith(("rotations:", "transforms:")) and "rotation_mdeg" not in note
    )
    noise = {} if list(noise) == ["assumed"] else noise
    return replace(draft, document=document | {"uncertainty": noise}, notes=(*notes, NOT_USED))
