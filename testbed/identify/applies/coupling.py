"""Joints that turn with others, where that explains what the model misses."""

from calib.identification.outliers.coupled import coupled
from testbed.files.rows.counts import COUPLED, added
from testbed.identify.calibration import Calibration
from testbed.robots.robot import Robot
from testbed.units import listed


def coupling_words(calibration: Calibration, robot: Robot) -> tuple[str, ...]:
    """That drives which pass through each other explain what the model misses, where they do.

    The reading of the files looks for ratios that leave centimeters, with nominal links. Smaller
    ones are hidden by what these are off, and stand out once the links are fitted. Asked only
    where a test refutes the numbers and nothing moved, of joints of which robot.toml states
    nothing.
    """
    if not calibration.refuted or calibration.moved is not None:
        return ()
    kinds, controller = robot.model.chain.kinds, robot.controller
    pairs = [
        (a, b)
        for a, b in COUPLED
        if b < len(kinds) and kinds[a] == kinds[b] == "revolute" and b not in controller.stated
    ]
    table = calibration.measurements.rows(calibration.is_used)
    chosen, plain = calibration.fit.identification, calibration.fits[0].identification
    found = coupled(chosen, table, pairs)
    if found is None and plain is not chosen:  # whose other joint errors may have followed some
        found = coupled(plain, table, pairs)
        if found is not None and found.left > chosen.chi_square:
            return ()
    if found is None:
        return ()
    turns = [f"joint {b + 1} by {ratio:+.5f} of joint {a + 1}" for a, b, ratio in found.ratios]
    texts = [
        f"q{b + 1} = J{b + 1}"
        + "".join(
            f" {'-' if ratio < 0 else '+'} {abs(ratio):.5f} J{a + 1}"
            for a, c, ratio in found.ratios
            if c == b
        )
        for b in sorted({b for _, b, _ in found.ratios})
    ]
    more = "s" * (len(found.ratios) > 1)
    return (
        f"Joints that turn with others ({listed(turns)}), as drives that pass through each other "
        f"do, explain {100 * found.explained:.0f} % of the errors beyond noise (p < 0.001): "
        f"{added(controller, *texts)}, or the ratio{more} of its maker, and identify again",
    )
