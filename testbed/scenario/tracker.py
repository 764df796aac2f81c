"""[tracker]: the instrument, where it stands, how it scatters, what it gets wrong every time."""

from typing import Annotated, Literal

from pydantic import Field

from testbed.scenario.tables import Point, Settings

Micrometres = Annotated[float, Field(ge=0.0, le=10_000.0)]
Noise = Annotated[float, Field(gt=0.0, le=10_000.0)]
HalfAngle = Annotated[float, Field(gt=0.0, le=180.0)]
Seconds = Annotated[float, Field(gt=0.0, le=86_400.0)]
Shots = Annotated[int, Field(ge=0, le=5000)]


class PaperTracker(Settings):
    """[tracker] preset "paper": isotropic noise, the robot's repeatability included in it."""

    preset: Literal["paper"] = "paper"
    station_mm: Point = (2600.0, -2000.0, 300.0)
    """Beam origin in the base frame."""
    measures: Literal["pose", "point"] = "pose"
    reflector_mm: Point = (0.0, 0.0, 0.0)
    """Reflector in the tool frame; only for measures = "point"."""
    position_um: Noise = 17.5
    """Standard deviation per axis."""
    rotation_mdeg: Noise = 11.0
    """Standard deviation per axis."""
    acceptance_deg: HalfAngle = 180.0
    """The target is seen within this angle about the tool's z axis; 180: from anywhere."""
    pose_s: Seconds = 10.0
    """From one shot to the next; what warms up or drifts does so meanwhile."""


class At960Tracker(Settings):
    """[tracker] preset "at960": spherical noise, constant and per metre of range."""

    preset: Literal["at960"] = "at960"
    station_mm: Point = (2600.0, -2000.0, 300.0)
    """Beam origin in the base frame."""
    measures: Literal["pose", "point"] = "pose"
    reflector_mm: Point = (0.0, 0.0, 0.0)
    """Reflector in the tool frame; only for measures = "point"."""
    range_um: tuple[Noise, Micrometres] = (2.0, 0.15)
    """Along the beam: constant, per metre."""
    transverse_um: tuple[Noise, Micrometres] = (3.0, 1.5)
    """Across the beam: constant, per metre."""
    centering_um: Micrometres = 2.5
    rotation_mdeg: tuple[Noise, Noise, Noise] = (2.0, 2.0, 3.5)
    """Pitch, yaw, roll of the target, about its own axes."""
    acceptance_deg: HalfAngle = 180.0
    """The target is seen within this angle about the tool's z axis; 180: from anywhere."""
    pose_s: Seconds = 10.0
    """From one shot to the next; what warms up or drifts does so meanwhile."""
    systematic: bool = False
    """Whether the station has errors of its own, drawn once per campaign: the next five keys."""
    range_offset_um: Micrometres = 2.5
    """Half width of the offset of all ranges."""
    scale_um_per_m: Micrometres = 0.2
    """Standard deviation of the scale of all ranges."""
    encoder_um: tuple[Micrometres, Micrometres] = (7.5, 3.0)
    """Amplitude across the beam, constant and per metre, of the errors that go with sin(azimuth)
    and sin(2 elevation)."""
    target_offset_um: Micrometres = 2.5
    """Standard deviation per axis of where the target sits on the tool."""
    target_turn_mdeg: Micrometres = 5.0
    """Half width per axis of how the target is turned on the tool."""
    drift_um_per_sqrt_h: Micrometres = 0.0
    """Random walk of the station, per axis; 0: it stands still."""
    nests_s: Seconds = 600.0
    """The nests are measured when a visit begins and again after this time; what they show is
    taken off until the next time."""
    outliers: Shots = 0
    """Shots of each visit that are grossly wrong; the data does not say which."""
    outlier_mm: Annotated[float, Field(ge=0.0, le=10_000.0)] = 0.5
    """Standard deviation per axis of a wrong shot."""
    outlier_deg: Annotated[float, Field(ge=0.0, le=180.0)] = 0.1
    """Standard deviation per axis of its rotation."""
    missed: Shots = 0
    """Shots of each visit that fail: their rows are missing."""


TrackerSettings = Annotated[PaperTracker | At960Tracker, Field(discriminator="preset")]


def tracker_contradictions(
    tracker: PaperTracker | At960Tracker, poses: dict[str, int]
) -> list[str]:
    """Sentences, one per contradiction of [tracker] with itself or the poses of each visit."""
    if isinstance(tracker, PaperTracker):
        return []
    return [
        f"[tracker] outliers is {tracker.outliers} and missed is {tracker.missed}; "
        f"{name} has {count} {'pose' if count == 1 else 'poses'}; no good shot is left; lower them"
        for name, count in poses.items()
        if tracker.outliers + tracker.missed >= count
    ]
