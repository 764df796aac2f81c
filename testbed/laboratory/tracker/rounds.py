"""Rounds: runs of the program in each of which one target is followed from one place.

A visit of poses is as many runs as there are pairs of a place and a target. Every run approaches
the poses anew, so that its rows have joint scatter of their own.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.frames import slide
from calib.geometry.model import RobotModel
from calib.measurement.noise import with_joint_noise
from calib.measurement.observations import DISTANCE, GIVEN, POINT, Measurements
from calib.measurement.prediction import perfect, predict
from calib.measurement.residual import table_whiteners
from testbed.laboratory.tracker.errors import GrossErrors
from testbed.laboratory.tracker.of_scenario import tracker_from
from testbed.laboratory.tracker.tracker import Tracker
from testbed.scenario.fixtures import ranged_targets, targets_mm
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import Point
from testbed.streams import stream


@dataclass(frozen=True, slots=True, eq=False)
class Round:
    """One run of the program: one target followed from one place."""

    name: str
    """As "station 2, B"; its random streams are named after it."""
    kind: str
    """pose, point or distance."""
    place: str
    """"station 2", or the anchor's name."""
    target: str
    """Name of the reflector."""
    tracker: Tracker
    """Where the scenario has place and target; at an anchor it only ranges."""
    station: int = 0
    """Of the fixtures; 0 is the world."""
    reflector: int = GIVEN
    """Of the fixtures where its place is to be found."""
    anchor: int = GIVEN
    """Of the fixtures; -1 for the tracker's own rounds."""

    @property
    def equations(self) -> int:
        """Of each row."""
        return 1 if self.kind == DISTANCE else 3 if self.kind == POINT else 6

    def standing(self, fixtures: Fixtures) -> Tracker:
        """The tracker where these fixtures have its place and target."""
        at, target = self.tracker.T_world_tracker, self.tracker.reflector
        if self.station:
            at = fixtures.stations[self.station - 1]
        if self.anchor != GIVEN:
            at = slide(*fixtures.anchors[self.anchor])
        if self.reflector != GIVEN:
            target = fixtures.reflectors[self.reflector]
        return replace(self.tracker, T_world_tracker=at, reflector=target)

    def own_covariance(self, model: RobotModel, q: Array) -> Array:
        """Scatter (m, 6, 6) of the device alone, as the columns of its rows have it."""
        T = model.poses(q)
        own = self.tracker.own_covariance(self.tracker.targets(T), T[:, :3, :3])
        return self._along_beam(model, q, own)

    def joint_covariance(self, model: RobotModel, q: Array, sigma_q: Array) -> Array:
        """What the joints scatter (m, 6, 6), as the columns of its rows have it."""
        offset = np.broadcast_to(self.tracker.reflector, (len(q), 3))
        scatter = with_joint_noise(model, q, np.zeros((len(q), 6, 6)), sigma_q, offset=offset)
        return self._along_beam(model, q, scatter)

    def covariance(self, model: RobotModel, q: Array, sigma_q: Array) -> Array:
        """Stated covariance (m, 6, 6) at poses q (m, n), axes of the station [m, rad].

        Taken at the nominal model, whose stations have the axes of the world. A distance has its
        variance at [0, 0], and ones below.
        """
        covariance = self._along_beam(model, q, self.tracker.covariance(model, q, sigma_q))
        if self.kind == DISTANCE:
            covariance[:, range(1, 6), range(1, 6)] = 1.0
        return covariance

    def _along_beam(self, model: RobotModel, q: Array, covariance: Array) -> Array:
        """Of a distance the variance along the beam alone, at [0, 0]; of others all there is."""
        if self.kind != DISTANCE:
            return covariance
        beam = self.tracker.targets(model.poses(q)) - self.tracker.station
        u = beam / np.linalg.norm(beam, axis=1, keepdims=True)
        along = np.zeros_like(covariance)
        along[:, 0, 0] = np.einsum("mi,mij,mj->m", u, covariance[:, :3, :3], u)
        return along

    def rows(self, model: RobotModel, q: Array, sigma_q: Array) -> Array:
        """Whitened rows (m, e, P) of poses q (m, n) not measured yet, all numbers of the model."""
        table = perfect(model, self.table(q, self.covariance(model, q, sigma_q)))
        rows = table_whiteners(table) @ predict(model, table).rows
        return np.asarray(rows[:, : self.equations])

    def rows_in(self, table: Measurements) -> Index:
        """Rows of a table that came from this round."""
        offset = self.tracker.reflector * (self.reflector == GIVEN)
        own = (table.kind == self.kind) & (table.station == self.station)
        own &= (table.reflector == self.reflector) & (table.anchor == self.anchor)
        return np.flatnonzero(own & (table.offset == offset).all(axis=1))

    def table(self, q: Array, covariance: Array) -> Measurements:
        """Rows for poses q (m, n) without readings; distances read one metre."""
        m, far = len(q), self.kind == DISTANCE
        return Measurements(
            q=q,
            position=np.zeros((m, 3)),
            rotation=np.broadcast_to(np.eye(3), (m, 3, 3)),
            covariance=covariance,
            kind=np.full(m, self.kind),
            offset=np.broadcast_to(self.tracker.reflector * (self.reflector == GIVEN), (m, 3)),
            pose_id=np.arange(m),
            repeat=np.zeros(m, dtype=np.int64),
            reflector=np.full(m, self.reflector),
            station=np.full(m, self.station),
            anchor=np.full(m, self.anchor),
            distance=np.full(m, float(far)),
        )

    def measure(
        self,
        fixtures: Fixtures,
        T_true: Array,
        q: Array,
        pose_id: Index,
        repeat: int,
        covariance: Array,
        rng: np.random.Generator,
        time: Array,
    ) -> Measurements:
        """Readings of true tool poses T_true (m, 4, 4), as `Tracker.measure` makes them.

        `fixtures` are the true ones; what is read is in the axes of the station that really stands
        there.
        """
        tracker = self.standing(fixtures)
        seen = tracker.measure(T_true, q, pose_id, repeat, covariance, rng, time=time)
        blank = replace(
            self.table(seen.q, seen.covariance), pose_id=seen.pose_id, repeat=seen.repeat
        )
        if self.kind == DISTANCE:
            far = np.linalg.norm(seen.position - tracker.station, axis=1)
            return replace(blank, distance=far)
        position, rotation = seen.position, seen.rotation
        if self.station:
            R, t = tracker.T_world_tracker[:3, :3], tracker.T_world_tracker[:3, 3]
            position = (position - t) @ R
            rotation = rotation if self.kind == POINT else R.T @ rotation
        return replace(blank, position=position, rotation=rotation)


def world_mm(places: Iterable[Point], chain: Chain) -> Array:
    """Places (k, 3) of the base frame in the world, both in mm: files have them in mm."""
    R, t = chain.T_world_base[:3, :3], chain.T_world_base[:3, 3]
    return np.array(list(places), dtype=np.float64).reshape(-1, 3) @ R.T + 1e3 * t


def nominal_fixtures(scenario: Scenario, chain: Chain) -> Fixtures:
    """Free reflectors, all anchors and further stations where the scenario has them."""
    settings = scenario.fixtures
    if settings is None:
        return Fixtures()
    free = [xyz for name, xyz in targets_mm(scenario).items() if name in settings.free]
    stations = world_mm(settings.stations_mm, chain) / 1e3
    return Fixtures(
        np.array(free, dtype=np.float64).reshape(-1, 3) / 1e3,
        world_mm(settings.anchors_mm.values(), chain) / 1e3,
        np.array([slide(*place) for place in stations]).reshape(-1, 4, 4),
    )


def first_tracker(scenario: Scenario, chain: Chain, *, seed: int | None = None) -> Tracker:
    """The tracker of a scenario at its first station, on the target that is judged."""
    tracker = tracker_from(scenario.tracker, chain, seed=seed)
    if tracker.measures != POINT:
        return tracker
    first = next(iter(targets_mm(scenario).values()))
    return replace(tracker, reflector=np.array(first) / 1e3)


def free_fixtures(scenario: Scenario, fixtures: Fixtures) -> tuple[str, ...]:
    """Names of the numbers of the fixtures that a calibration finds: all but known anchors'."""
    settings = scenario.fixtures
    if settings is None:
        return ()
    known = enumerate(settings.anchors_mm)
    held = tuple(f"anchor{k + 1}." for k, name in known if name not in settings.free)
    return tuple(name for name in fixtures.names if not name.startswith(held))


def true_fixtures(scenario: Scenario, nominal: Fixtures, *, seed: int | None = None) -> Fixtures:
    """Where they really are: each drawn from a stream of its own, known places as they are.

    From the seed of the scenario, or another one.
    """
    settings = scenario.fixtures
    if settings is None:
        return nominal
    drawn_from = scenario.seed if seed is None else seed

    def normal(name: str, count: int) -> Array:
        return stream(drawn_from, "truth", "fixtures", name).standard_normal(count)

    free = [name for name in targets_mm(scenario) if name in settings.free]
    place, turn = settings.place_sd_mm / 1e3, float(np.radians(settings.turn_sd_deg))
    point, frame = np.full(3, place), np.repeat([place, turn], 3)
    stations = [f"station {k + 2}" for k in range(len(settings.stations_mm))]
    steps = [
        *(point * normal(name, 3) for name in free),
        *(point * normal(name, 3) * (name in settings.free) for name in settings.anchors_mm),
        *(frame * normal(name, 6) for name in stations),
    ]
    return nominal.moved(np.concatenate([*steps, np.zeros(0)]))


def rounds_of(scenario: Scenario, tracker: Tracker, fixtures: Fixtures) -> tuple[Round, ...]:
    """All rounds of a visit: station by station, then anchor by anchor; none without [fixtures]."""
    settings = scenario.fixtures
    if settings is None:
        return ()
    places, kind = targets_mm(scenario), tracker.measures
    free = [name for name in places if name in settings.free]
    numbers = {name: free.index(name) if name in free else GIVEN for name in places}
    targets = {name: np.array(xyz) / 1e3 for name, xyz in places.items()}
    # a 6-D target is at the tool frame, wherever the reflectors for distances are
    seen = tuple(places) if kind == POINT else ("",)
    rounds = []
    for s in range(1 + len(fixtures.stations)):
        at = fixtures.stations[s - 1] if s else tracker.T_world_tracker
        for name in seen:
            own = replace(
                tracker, T_world_tracker=at, reflector=targets.get(name, tracker.reflector)
            )
            place = f"station {s + 1}"
            title = f"{place}, {name}" if name else place
            number = numbers.get(name, GIVEN)
            rounds.append(Round(title, kind, place, name, own, s, number))
    constant, slope = settings.distance_um
    for k, anchor in enumerate(settings.anchors_mm):
        for name in ranged_targets(scenario):
            sensor = Tracker(
                slide(*fixtures.anchors[k]),
                "point",
                targets[name],
                range_sd=(constant * 1e-6, slope * 1e-6),
                transverse_sd=(0.0, 0.0),
                centering_sd=0.0,
                rotation_sd=(1.0, 1.0, 1.0),
                acceptance=tracker.acceptance,
                pose_time=tracker.pose_time,
                gross_errors=GrossErrors(),
            )
            title = f"{anchor}, {name}"
            rounds.append(Round(title, DISTANCE, anchor, name, sensor, 0, numbers[name], k))
    return tuple(rounds)


def stacked_rows(
    rounds: tuple[Round, ...], model: RobotModel, q: Array, sigma_q: Array, visible: Bool
) -> Array:
    """Whitened rows (m, r, P) of all rounds at poses q (m, n), zero where a round sees nothing."""
    parts = [
        one.rows(model, q, sigma_q) * visible[:, k, None, None] for k, one in enumerate(rounds)
    ]
    return np.concatenate(parts, axis=1)
