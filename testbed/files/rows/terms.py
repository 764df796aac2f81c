"""What a session knows of its rows for terms of a model that follow them."""

from calib.identification.row_ladders import EXPANSION, RowTerms
from testbed.files.session import Session


def row_terms(session: Session) -> RowTerms:
    """Gears, material and drives of a session, and why its rows are silent."""
    return RowTerms(
        session.gear,
        EXPANSION[session.wanted.material],
        session.rows_say.drive == "current",
        dict(session.rows_say.unsaid),
    )
