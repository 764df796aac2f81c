"""Whether the robot keeps a tolerance: decisions before and after its correction, in words."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.shown import length_unit
from calib.uncertainty.statement.conformity import Conformity, conformity
from calib.uncertainty.statement.deciding import what_decides
from calib.uncertainty.statement.stated_point import widened
from testbed.identify.calibration import Calibration
from testbed.identify.handback.delivered import Delivered
from testbed.lengths import as_stated, with_unit
from testbed.report.page import Block, Section, Table, Text
from testbed.units import fixed, listed, percent, significant

UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Decided:
    """Decisions on one set of points."""

    key: str
    """In result.json."""
    what: str
    """Which points, of which robot."""
    by: Conformity
    missing: int
    """Points beside these that have no region."""

    @property
    def rule(self) -> str:
        """How the rule is called."""
        return rule_name(self.by)

    @property
    def word(self) -> str:
        """PASS if all points pass, FAIL if one fails, else UNDECIDED."""
        counts = self.counts
        return "FAIL" if counts["fail"] else "UNDECIDED" if counts["undecided"] else "PASS"

    @property
    def counts(self) -> dict[str, int]:
        """How many of each outcome: pass, fail, undecided."""
        found = {word: self.by.counts.get(word, 0) for word in ("pass", "fail", "undecided")}
        return found | {"undecided": found["undecided"] + self.missing}

    @property
    def risk(self) -> float | None:
        """Largest probability that a point that passed is out of tolerance; None if none passed."""
        return self.by.largest_risk


def at_held_out(calibration: Calibration, q: Array) -> tuple[Conformity, Conformity] | None:
    """Decisions at joints q (n, j) on the robot as it was, and on one that the model corrects.

    What is decided on is the mean point by the identified model, not one noisy reading of it, so
    that a correction leaves nothing of its deviation but the uncertainty. None without a tolerance,
    or where no region is believed.
    """
    belief, asked = calibration.proof.belief, calibration.decision
    if belief is None or asked is None or not calibration.decidable:
        return None
    S = widened(belief.regions(q, target=belief.proven.target))
    identified, nominal = (
        belief.proven.target.positions(model, model.poses(q))
        for model in (belief.model, calibration.before)
    )
    goes = identified - nominal
    before, after = (
        conformity(d, S, asked.tolerance, rule=asked.rule) for d in (goes, np.zeros_like(goes))
    )
    return before, after


def outcomes(decided: Conformity) -> tuple[str, ...]:
    """Outcomes with the name of their rule: two kinds of pass must never be mixed."""
    words = {word: f"{word}, {rule_name(decided)}" for word in ("pass", "fail")}
    return tuple(words.get(str(one), UNDECIDED) for one in decided.outcome)


def rule_name(decided: Conformity) -> str:
    """How a rule is called."""
    if decided.rule == "simple":
        return "simple acceptance"
    return f"guard band R{100 * decided.probability:g}"


def decided_at(calibration: Calibration, delivered: Delivered) -> tuple[Decided, ...]:
    """What was decided; nothing without a tolerance, or where no region is believed."""
    found, q = [], calibration.stated_q
    if held := at_held_out(calibration, q):
        where = f"{len(q)} {'held-out poses' if calibration.split.is_test.any() else 'poses used'}"
        found += [
            Decided("held_out_before", f"{where}, robot as it was", held[0], 0),
            Decided("held_out_after", f"{where}, robot corrected", held[1], 0),
        ]
    targets = delivered.targets
    if targets is not None and targets.before is not None and targets.after is not None:
        missing = int((~targets.decidable).sum())
        found += [
            Decided("program_before", "program as it was", targets.before, missing),
            Decided("program_after", "corrected program", targets.after, missing),
        ]
    return tuple(found)


def decision_line(found: tuple[Decided, ...]) -> str:
    """All decisions in one line; empty if there are none."""
    if not found:
        return ""
    said = []
    for one in found:
        counts = {f"{word}, {one.rule}": one.counts[word] for word in ("pass", "fail")}
        counts[UNDECIDED] = one.counts["undecided"]
        words = [f"{count} {word}" for word, count in counts.items() if count]
        said.append(f"{one.what}: {one.word} ({', '.join(words)})")
    return f"Tolerance {as_stated(found[0].by.tolerance)}: {'; '.join(said)}."


def decision_words(calibration: Calibration, delivered: Delivered) -> tuple[str, ...]:
    """Pass, fail or undecided, and what would decide it; nothing without a tolerance."""
    asked = calibration.decision
    if asked is None:
        return ()
    if line := decision_line(decided_at(calibration, delivered)):
        return tuple(filter(None, (line, would_decide(calibration))))
    why = "no region of the tool point can be believed"
    if calibration.elsewhere and not calibration.unshown:
        why = "the held-out poses are off as a whole"
    elif calibration.proof.belief is not None:
        why = "the readings do not show where the robot stands"
    return (f"Tolerance {as_stated(asked.tolerance)}: UNDECIDED: {why}.",)


def would_decide(calibration: Calibration) -> str:
    """What would let a corrected robot pass whose tolerance is below R95; empty where it is not."""
    belief, asked, shared = calibration.proof.belief, calibration.decision, calibration.shared
    if belief is None or asked is None or not calibration.decidable:
        return ""
    found = what_decides(
        belief, calibration.stated_q, asked.tolerance,
        shared=None if shared is None else shared.covariance,
    )  # fmt: skip
    if found.radius <= asked.tolerance:
        return ""
    said = (
        f"R95 of the corrected robot is up to {with_unit(found.radius)}: no smaller tolerance can "
        "be decided now. "
    )
    ways = []
    if np.isfinite(found.poses):
        table, judged = calibration.measurements, calibration.split.is_test
        train, held = (
            int(np.ceil(found.poses * table.rows(rows).n_poses))
            for rows in (calibration.is_used, judged)
        )
        ways.append(
            f"{significant(found.poses, 2)} times as many poses (about {train} to identify from"
            + (f" and {held} to hold out)" if held else ")")
        )
    if np.isfinite(found.quieter):
        shots = int(np.ceil(found.quieter**2))
        ways.append(
            f"readings with {significant(found.quieter, 2)} times less noise (the mean of {shots} "
            "readings of each pose, approached anew each time)"
        )
    if ways:
        return f"{said}According to a forecast, {' or '.join(ways)} would decide it."
    staying, shares = (with_unit(part, found.radius) for part in (found.staying, found.shared))
    stays = [f"{staying} remain"] if found.staying else []
    stays += [f"{shares} are shared by all readings"] * bool(found.shared)
    why = f": of R95, {listed(stays)}" if stays else ""
    return f"{said}Neither more poses nor quieter readings would decide it{why}."


def decision_section(found: tuple[Decided, ...]) -> Section | None:
    """The decisions as a table, and the rule that they were made by."""
    if not found:
        return None
    rows, rule = [], found[0].rule
    guarded = found[0].by.rule == "guarded"
    scale, unit = length_unit([one.by.distance.max() for one in found])
    per, wide = length_unit([one.by.guard.max() for one in found])
    places = 1 if unit == "um" else 3
    for one in found:
        band = significant(float(one.by.guard.max()) * per) if guarded else "–"
        risk = "–" if one.risk is None else percent(one.risk)
        far = fixed(float(one.by.distance.max()) * scale, places)
        rows.append((one.what, *map(str, one.counts.values()), far, band, risk))
    told = (
        "Pass: the predicted mean point lies inside the tolerance by at least the guard band, "
        "which is its R95. Fail: it lies outside by at least as much. In between, or without a "
        "region, no decision is possible. The risk that a point that passed is out of tolerance "
        "is at most 5 %."
        if guarded
        else "Simple acceptance, as requested: a point passes if its predicted mean lies within "
        "the tolerance, without a guard band. The table shows how large the risk of a pass is; at "
        "the limit it is 50 % or more."
    )
    if any(one.by.hopeless.any() for one in found):
        told += " At some points the tolerance is smaller than R95, so they cannot pass at all."
    blocks: tuple[Block, ...] = (
        Table(
            caption=f"Tolerance {as_stated(found[0].by.tolerance)} on the distance of the "
            " mean tool point from where it should be",
            head=(
                "at", f"pass, {rule}", f"fail, {rule}", UNDECIDED,
                f"farthest {unit}", f"guard band R95 {wide}", "largest risk of a pass",
            ),
            rows=tuple(rows),
            align="lrrrrrr",
            note="The decisions are about the mean point that the identified model predicts. "
            "Corrected: by that model, the correction leaves nothing but rounding.",
        ),
        Text(told),
    )  # fmt: skip
    return Section("decisions", "Within tolerance?", blocks)
