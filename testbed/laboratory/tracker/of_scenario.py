"""The tracker that a scenario asks for, in SI units, and how wrong it may be."""

from typing import Any

import numpy as np

from calib.geometry.chain import Chain
from calib.geometry.frames import leveled, slide, transform
from calib.uncertainty.statement.instrument import InstrumentErrors
from testbed.laboratory.tracker.errors import NESTS, GrossErrors, StationBias, StationDrift, draw
from testbed.laboratory.tracker.tracker import Tracker
from testbed.scenario.laboratory import At960Tracker, PaperTracker
from testbed.streams import stream


def tracker_from(
    settings: PaperTracker | At960Tracker, chain: Chain, *, seed: int | None = None
) -> Tracker:
    """The tracker of a scenario.

    Parameters
    ----------
    settings : PaperTracker or At960Tracker
        [tracker] of the scenario.
    chain : Chain
        Nominal; its base is what the place of the station refers to. The tracker stands level
        there, however the base is turned.
    seed : int, optional
        Seed of the campaign, from which systematic errors are drawn; without it there are none:
        planning does not know them.
    """
    T, axes = chain.T_world_base, leveled(chain.T_world_base)
    place = (T @ slide(*(np.array(settings.station_mm) / 1e3)))[:3, 3]
    at: dict[str, Any] = {
        "T_world_tracker": transform(axes, place),
        "measures": settings.measures,
        "reflector": np.array(settings.reflector_mm) / 1e3,
        "acceptance": float(np.radians(settings.acceptance_deg)),
        "pose_time": settings.pose_s,
    }
    if isinstance(settings, PaperTracker):
        every_axis = (settings.position_um * 1e-6, 0.0)
        turn = float(np.radians(settings.rotation_mdeg * 1e-3))
        return Tracker(
            range_sd=every_axis,
            transverse_sd=every_axis,
            centering_sd=0.0,
            rotation_sd=(turn, turn, turn),
            **at,
        )
    pitch, yaw, roll = (float(np.radians(sd * 1e-3)) for sd in settings.rotation_mdeg)
    bias = drift = None
    if settings.systematic and seed is not None:
        size = bias_size(settings)
        bias = StationBias(size, draw(size, stream(seed, "station", "bias")))
    if settings.drift_um_per_sqrt_h:
        # the nests stand around the robot's base, with the room's floor below them
        nests, rate = np.array(NESTS) @ axes.T + T[:3, 3], settings.drift_um_per_sqrt_h
        drift = StationDrift(rate * 1e-6 / 60.0, settings.nests_s, nests)
    return Tracker(
        range_sd=_in_meters(settings.range_um),
        transverse_sd=_in_meters(settings.transverse_um),
        centering_sd=settings.centering_um * 1e-6,
        rotation_sd=(pitch, yaw, roll),
        bias=bias,
        drift=drift,
        gross_errors=GrossErrors(
            settings.outliers,
            settings.outlier_mm / 1e3,
            float(np.radians(settings.outlier_deg)),
            settings.missed,
        ),
        **at,
    )


def bias_size(settings: At960Tracker) -> InstrumentErrors:
    """How large the systematic errors of a scenario's tracker may be."""
    uniform = 3**-0.5  # standard deviation of a half width
    return InstrumentErrors(
        uniform * settings.range_offset_um * 1e-6,
        settings.scale_um_per_m * 1e-6,
        _in_meters(settings.encoder_um),
        settings.target_offset_um * 1e-6,
        uniform * float(np.radians(settings.target_turn_mdeg * 1e-3)),
        float(np.radians(settings.level_mdeg * 1e-3)),
    )


def _in_meters(pair: tuple[float, float]) -> tuple[float, float]:
    """Constant and per-meter part, from um and um/m."""
    return pair[0] * 1e-6, pair[1] * 1e-6
