"""What a campaign publishes of how its true arm moves."""

from testbed.store.quantities import METRE, RADIAN, Quantity
from testbed.studies.trial.bending.records import Ways


def motion_headline(ways: Ways) -> list[Quantity]:
    """Widths of the loops, what still swings when the tracker looks, and both sides' ends apart."""
    return [
        Quantity("loop_width_mdeg", ways.loop_width, RADIAN),
        Quantity("tool_loop_width_um", ways.tool_width, METRE),
        Quantity("from_rest_mean_um", ways.seen.mean(), METRE),
        Quantity("from_rest_max_um", ways.seen.max(), METRE),
        Quantity("both_sides_mean_um", ways.apart.mean(), METRE),
        Quantity("both_sides_max_um", ways.apart.max(), METRE),
    ]
