"""The files that people write and the program reads, each with the schemas of its tables."""

from testbed.files.visits.tables import CampaignFile
from testbed.robots.file import RobotFile, TrackerFile
from testbed.scenario.origin import ORIGIN, OriginTable
from testbed.scenario.scenario import Scenario
from testbed.strict import Strict
from testbed.studies import declared_tables


def roots(file: str) -> list[tuple[str, type[Strict]]]:
    """The schemas of a file, each with the name of its table; the file itself has none."""
    match file:
        case "scene":
            return [("", Scenario), *declared_tables(()).items(), (ORIGIN, OriginTable)]
        case "session":
            return [("", CampaignFile)]
        case "robot":
            return [("", RobotFile)]
        case "tracker":
            return [("", TrackerFile)]
    raise ValueError(f"no file is called {file}")


FILES = ("scene", "session", "robot", "tracker")
