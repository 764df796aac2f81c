"""The noise that several targets on one tool tell by how far they lie apart, whatever the arm does.

A session that states no noise gets that of a laser tracker. Markers of a motion capture system
scatter ten times as much, and what scatters beyond the noise counts as a misfit of the arm: of two
markers 60 mm apart a misfit that turns the tool, at the end of a long arm.
"""

from dataclasses import replace

import numpy as np

from calib.measurement.observations import Measurements
from testbed.files.frames_fit import target_groups
from testbed.files.reflectors.one_tool import pairs_of_targets
from testbed.files.session import Session
from testbed.proposal.drafts import ASSUMED, Draft

FEWEST = 8
"""Poses that see both of two targets."""
MEDIAN = 1.4826
"""Standard deviation of normal noise over the median of its size."""


def with_scatter(draft: Draft, session: Session | None) -> Draft:
    """The draft, with the noise by which its targets stand apart where more than is assumed."""
    stated = draft.document.get("uncertainty", {})
    usual = ASSUMED["position_um"]
    if session is None or not stated.get("assumed") or stated.get("position_um") != usual:
        return draft
    told = noise_between(session.measurements) * 1e6
    rounded = float(f"{told:.2g}")
    if not rounded > usual:
        return draft
    value = int(rounded)
    was, now = (f"position_um = {one} is assumed" for one in (usual, value))
    now += ", by which the targets scatter against each other"
    return replace(
        draft,
        document=draft.document | {"uncertainty": stated | {"position_um": value}},
        notes=tuple(note.replace(was, now) for note in draft.notes),
    )


def noise_between(table: Measurements) -> float:
    """Noise per axis of points by the distances of targets at the same poses [m]; else zero.

    Each pair of targets by its median, as wrong shots say nothing; and of the pairs the lower
    quarter, as a target that is loose stands in two of the three pairs of three.
    """
    found = list[float]()
    groups = [rows for rows in target_groups(table) if not table.is_pose[rows[0]]]
    for both in pairs_of_targets(table, groups):
        if len(both) < FEWEST:
            continue
        apart = np.linalg.norm(np.subtract(*table.position[both.T]), axis=1)
        found.append(MEDIAN * float(np.median(np.abs(apart - np.median(apart)))))
    return float(np.quantile(found, 0.25, method="lower") / np.sqrt(2)) if found else 0.0
