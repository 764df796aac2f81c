"""Keys that somebody gave and nothing reads, because what they belong to is switched off."""

from collections.abc import Callable, Iterator

import numpy as np

from testbed.faults import flat
from testbed.scenario.laboratory import SYSTEMATIC
from testbed.scenario.scenario import Scenario
from testbed.scenario.tables import BudgetSettings, Settings
from testbed.units import listed

Asked = Callable[[Scenario], object]
MOTION = ("speed_deg_s", "speed_mm_s", "approach_deg", "dwell_s", "damping")


def _nonzero(key: str) -> Asked:
    """Whether a number of [truth], or one of its numbers, is not zero."""
    return lambda scenario: np.any(getattr(scenario.truth, key))


def _of(key: str) -> Asked:
    """Whether a key of [tracker] is there, and on."""
    return lambda scenario: getattr(scenario.tracker, key, False)


def _poses(scenario: Scenario) -> bool:
    """Whether full poses are measured."""
    return scenario.tracker.measures == "pose"


def _loaded(scenario: Scenario) -> bool:
    """Whether anything hangs on the arm."""
    return bool(scenario.truth.payload_kg or any(scenario.truth.payloads_kg))


def _found(scenario: Scenario) -> bool:
    """Whether any place is to be found by the calibration."""
    fixtures = scenario.fixtures
    return fixtures is not None and bool(fixtures.stations_mm or fixtures.free)


NEEDS: tuple[tuple[str, tuple[str, ...], Asked, str], ...] = (
    ("truth", ("twist_share",), _nonzero("angle_sd_deg"), "angle_sd_deg is 0"),
    ("truth", ("offset_share",), _nonzero("length_sd_mm"), "length_sd_mm is 0"),
    ("truth", ("transmission_waves",), _nonzero("transmission_mdeg"), "transmission_mdeg is 0"),
    ("truth", ("encoder_periods",), _nonzero("encoder_mdeg"), "encoder_mdeg is 0"),
    ("truth", ("gear_ratio",), _nonzero("gear_mdeg"), "gear_mdeg is 0"),
    ("truth", ("backlash_side",), _nonzero("backlash_mdeg"), "backlash_mdeg is 0"),
    ("truth", ("thermal_h", "thermal_um_per_m_k"), _nonzero("thermal_k"), "thermal_k is 0"),
    ("truth", ("thermal_k",), _nonzero("thermal_um_per_m_k"), "thermal_um_per_m_k is 0"),
    ("truth", ("payload_center_mm",), _loaded, "payload_kg is 0"),
    ("truth", MOTION, _nonzero("motion"), "motion is false"),
    ("tracker", ("rotation_mdeg", "outlier_deg", "target_turn_mdeg"), _poses,
     'measures is "point"'),
    ("tracker", SYSTEMATIC, _of("systematic"), "systematic is false"),
    ("tracker", ("nests_s",), _of("drift_um_per_sqrt_h"), "drift_um_per_sqrt_h is 0"),
    ("tracker", ("outlier_mm", "outlier_deg"), _of("outliers"), "outliers is 0"),
    ("fixtures", ("distance_um",), lambda s: s.fixtures and s.fixtures.anchors_mm,
     "there are no anchors_mm"),
    ("fixtures", ("turn_sd_deg",), lambda s: s.fixtures and s.fixtures.stations_mm,
     "there are no stations_mm"),
    ("fixtures", ("place_sd_mm",), _found, "nothing has to be found"),
    ("studies", ("pose_count_max",), lambda s: s.studies.pose_count, "pose_count is false"),
    ("budget", tuple(BudgetSettings.model_fields), lambda s: s.studies.paper_budget,
     "[studies] paper_budget is false"),
    ("plan", ("target_is", "stiff_joints"), lambda s: s.plan.target_um, "target_um is 0"),
)  # fmt: skip
"""Keys of a table, who reads them, and what is the case where nothing does."""


def idle_settings(scenario: Scenario) -> Iterator[str]:
    """Sentences on keys that were given other values than usual, and change nothing.

    None where a study of many robots was asked for: these switch terms on by themselves.
    """
    given = flat(scenario.given)
    if any(path[0] in scenario.tables for path in given):
        return
    for name, keys, asked, why in NEEDS:
        odd = [
            key for key in keys if (name, key) in given and _unusual(getattr(scenario, name), key)
        ]
        if odd and not asked(scenario):
            verb = "change" if odd[1:] else "changes"
            yield f"[{name}] {listed(odd)} {verb} nothing: {why}"


def _unusual(table: Settings, key: str) -> bool:
    """Whether a key of a table has another value than by default."""
    return bool(getattr(table, key) != type(table).model_fields[key].default)
