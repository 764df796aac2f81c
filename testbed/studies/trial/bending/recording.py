"""An arm that moves in the recording: two ways to one pose in slow motion, and what swings on."""

import numpy as np

from calib.geometry.bodies import Z
from testbed.recording import style
from testbed.recording.cell import draw_arm
from testbed.recording.chart import Chart, Series
from testbed.recording.layout import FRAMES_PER_SECOND
from testbed.recording.pen import Pen
from testbed.recording.story import Chapter
from testbed.recording.timeline import Motion, Phase, glide
from testbed.robots.robot import Robot
from testbed.studies.trial.bending.records import Ways
from testbed.studies.trial.recording_cell import ShownTrial
from testbed.studies.trial.recording_ghost import MOVE
from testbed.units import micrometres

SWING_SIZE = 0.08
"""Largest drawn distance of the tool from where it would rest [m]."""
GLIDE = 12
"""Steps on the way to where a film begins, which is not played."""


def move_chapter(shown: ShownTrial, ways: Ways, robot: Robot) -> Chapter:
    """How the true robot comes to one pose from both sides, and what of it dies away."""
    factor = style.nice_factor(SWING_SIZE, float(ways.film_away.max()))
    slower = 1 / (ways.film_step * FRAMES_PER_SECOND)
    chain, before = shown.setting.nominal.chain, shown.setting.test_q[-1]
    rows, at = [], []
    for film in np.split(ways.film_q, ways.film_starts[1:]):
        rows.append(glide(np.array([before, film[0]]), 2 * GLIDE)[GLIDE:])
        at.append(sum(map(len, rows)) + np.arange(len(film)))
        rows.append(film)
        before = film[-1]
    q = np.vstack(rows)

    def draw(pen: Pen, phase: Phase) -> None:
        bends = np.zeros((*pen.timeline.q.shape, 3))
        bends[phase.at] = factor * ways.film_bends
        turned, across = pen.timeline.q + bends[:, :, Z], bends[:, :, :Z]
        path = f"world/swings_x{factor}"
        draw_arm(pen, path, robot, turned, (chain,), color=style.GHOST_COLOR, across=across)

    return Chapter(
        name=MOVE,
        local="film",
        color=style.MOVE_PHASE,
        motion=Motion(len(q), np.concatenate(at), q),
        text=(
            "#### Move: two ways to one pose",
            f"- {slower:.0f} times slower than the robot: it comes, stops, and swings on",
            f"- purple ghost: the true robot beside where it would rest, drawn {factor} times",
            "- curve: so far is its tool from there",
            "- then it comes from the other side; friction leaves the tool "
            f"{micrometres(float(ways.apart.mean()), 2)} um apart, mean of "
            f"{len(ways.apart)} poses",
        ),
        draw=draw,
        charts=(
            Chart(
                "move",
                "Tool beside its place at rest [um] by time [s]",
                (Series("tool", 1e6 * ways.film_away, style.LINE_COLOR),),
                ways.film_step * np.arange(len(ways.film_away)),
            ),
        ),
    )
