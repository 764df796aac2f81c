"""What an instrument gets wrong in all readings alike, from its table to SI units."""

import numpy as np

from calib.arrays import Array
from calib.uncertainty.statement.instrument import InstrumentErrors
from testbed.scenario.systematic import SystematicTable


def errors_of(table: SystematicTable) -> InstrumentErrors:
    """Sizes of the systematic parts in SI units."""
    constant, slope = table.encoder_amplitude_um
    return InstrumentErrors(
        table.range_offset_um * 1e-6,
        table.scale_um_per_m * 1e-6,
        (constant * 1e-6, slope * 1e-6),
        table.target_offset_um * 1e-6,
        float(np.radians(table.target_turn_mdeg * 1e-3)),
        float(np.radians(table.level_mdeg * 1e-3)),
    )


def beam_of(table: SystematicTable) -> Array:
    """Where the beam starts (4, 4) in the frame of the coordinates, its z axis upwards [m].

    Where its circles have their zero does not matter: waves of any phase are as likely.
    """
    up = np.array(table.station_up) / np.linalg.norm(table.station_up)
    across = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    across /= np.linalg.norm(across)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([across, np.cross(up, across), up])
    T[:3, 3] = np.array(table.station_mm or (0.0, 0.0, 0.0)) / 1e3
    return T
