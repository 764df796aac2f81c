"""Robot calibration as estimation on arrays: numpy and scipy only, no files, no simulator.

The names below are the front door; each is imported from its module at first use.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from calib import design as design
    from calib import errors as errors
    from calib import uncertainty as uncertainty
    from calib.calibration import CalibratedRobot as CalibratedRobot
    from calib.calibration import calibrate as calibrate
    from calib.compensation import compensate as compensate
    from calib.geometry.chain import Chain as Chain
    from calib.geometry.fixtures import Fixtures as Fixtures
    from calib.geometry.model import RobotModel as RobotModel
    from calib.geometry.operating import OperatingConditions as OperatingConditions
    from calib.geometry.parameters import parameters_of as parameters_of
    from calib.identification.identify import identify as identify
    from calib.identification.prior import Prior as Prior
    from calib.identification.result import Identification as Identification
    from calib.measurement.observations import Measurements as Measurements
    from calib.measurement.observations import joined as joined
    from calib.measurement.tables import distances as distances
    from calib.measurement.tables import points as points
    from calib.measurement.tables import poses as poses
    from calib.single_poses import SinglePoses as SinglePoses
    from calib.uncertainty.judgement import Circumstances as Circumstances
    from calib.uncertainty.judgement import Judgement as Judgement
    from calib.uncertainty.judgement import judge as judge
else:
    import sys
    from importlib import import_module

    HOMES = {
        "CalibratedRobot": "calibration",
        "Chain": "geometry.chain",
        "Circumstances": "uncertainty.judgement",
        "Fixtures": "geometry.fixtures",
        "Identification": "identification.result",
        "Judgement": "uncertainty.judgement",
        "Measurements": "measurement.observations",
        "OperatingConditions": "geometry.operating",
        "Prior": "identification.prior",
        "RobotModel": "geometry.model",
        "SinglePoses": "single_poses",
        "calibrate": "calibration",
        "compensate": "compensation",
        "design": "",
        "distances": "measurement.tables",
        "errors": "",
        "identify": "identification.identify",
        "joined": "measurement.observations",
        "judge": "uncertainty.judgement",
        "parameters_of": "geometry.parameters",
        "points": "measurement.tables",
        "poses": "measurement.tables",
        "uncertainty": "",
    }
    """Module of each name; a room is its own."""

    def __getattr__(name):
        if name not in HOMES:
            message = f"module 'calib' has no attribute '{name}'"
            word = name.lower()
            near = [one for one in HOMES if len(word) > 2 and word in one.lower()]
            near.sort(key=lambda one: not one.lower().startswith(word))
            message += f"; it has {' and '.join(near)}" * bool(near)
            raise AttributeError(message, name=name, obj=sys.modules[__name__])  # for suggestions
        home = HOMES[name]
        if not home:
            return import_module(f"calib.{name}")
        return getattr(import_module(f"calib.{home}"), name)

    def __dir__():
        return sorted(HOMES)
