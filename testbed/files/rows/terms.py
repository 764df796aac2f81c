"""What a session knows of its rows for terms of a model that follow them."""

from calib.geometry.gravity import weight_of
from calib.identification.row_ladders import EXPANSION, RowTerms
from testbed.files.session import Session
from testbed.robots.robot import Robot


def row_terms(session: Session, robot: Robot) -> RowTerms:
    """Gears, material and drives of a session, what loads them, and why its rows are silent."""
    return RowTerms(
        session.gear,
        EXPANSION[session.wanted.material],
        session.rows_say.drive == "current",
        dict(session.rows_say.unsaid),
        weight_of(robot.model.chain, moments=robot.moments),
    )
