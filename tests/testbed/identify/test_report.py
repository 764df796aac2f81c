"""The page of a calibration: verdict first, every number that of the record, no network."""

import re
import tempfile
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib.geometry.joint_errors import harmonic_terms
from calib.identification.fit_statistics import RED
from calib.identification.identify import Status
from calib.identification.lack_of_fit import LackOfFit
from calib.identification.outliers.moved import Moved
from calib.identification.outliers.tails import LongTails
from calib.uncertainty.drift.drifting import Drifting
from calib.uncertainty.drift.memory import SlowDrift
from calib.uncertainty.drift.steady import SteadyDrift
from calib.uncertainty.regions import coverage_factor
from calib.uncertainty.tool_point import tool_statement
from calib.uncertainty.trust import Trust, trust
from testbed.identify.calibration import MOUNTING
from testbed.identify.errors import figures_of
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.states import HandedNumber, handed_numbers
from testbed.identify.headline import deg, headline_cells
from testbed.identify.report import plots
from testbed.identify.report.errors import accuracy_section, residual_section
from testbed.identify.report.page import delivered_blocks, page_of
from testbed.identify.report.parameters import _cells, drawn_waves
from testbed.identify.statements import statements_of
from testbed.identify.to_do.next_step import next_step
from testbed.identify.words import (
    ELSEWHERE,
    GUARDED,
    GUESSED,
    MEASURED,
    NOTHING,
    UNGUARDED,
    UNTESTED,
    believed_words,
    mark,
    notice,
    reasons,
    terminal_text,
    verdict,
)
from testbed.report.page import SIMULATED, Table, render
from testbed.report.text import verdict_lines
from testbed.robots.write.dh_table import DhRow
from testbed.units import micrometres, plain
from tests.calibrated import real, sound
from tests.reported import VERSIONS, printed_pages, read, said_twice, undrawn
from tests.testbed.identify.test_shared import calibrated as shared_session

DELIVERED = Delivered(("robot.toml has the robot's poses to 1e-15 m",), ("2 of 2 corrected",), 0)


@cache
def html(make):
    return render(page(make))


@cache
def page(make):
    return page_of(make(), DELIVERED, VERSIONS)


def test_the_page_opens_and_ends_with_where_its_numbers_come_from():
    reader = read(html(real))
    assert reader.open == []
    assert reader.text[0] == reader.text[-1] == MEASURED
    assert notice(sound()) == SIMULATED
    assert reader.links[0] == "campaign.rrd"
    assert all(link.startswith("#") for link in reader.links[1:])
    assert tempfile.gettempdir() not in html(real)


def test_the_own_file_that_is_handed_back_is_named_with_its_kind():
    for kind, told in (
        ("urdf", "URDF with corrected origins"),
        ("mjcf", "MJCF with corrected places"),
    ):
        delivered = replace(DELIVERED, **{kind: "robot/a_corrected"})
        assert delivered.own_file == (kind.upper(), "robot/a_corrected")
        first = delivered_blocks(delivered)[0]
        assert first.text.endswith(f" robot/a_corrected: your own {told}.")
    assert DELIVERED.own_file == ("", "")
    assert "your own" not in delivered_blocks(DELIVERED)[0].text


@pytest.mark.parametrize("make", [real, sound])
def test_no_sentence_is_said_twice(make):
    assert said_twice(html(make)) == []


@pytest.mark.parametrize("make", [real, sound])
def test_a_calibration_prints_on_five_pages_with_room_for_more(make, tmp_path):
    """Other robots have more to say: in the first box, which shifts all tables, and at the end."""
    more, spare = "word " * 45, '<div style="height: 6cm"></div>'
    fuller = html(make).replace("Next step.</b>", f"Next step.</b> {more}")
    assert more in fuller
    assert printed_pages(fuller.replace("<footer", f"{spare}<footer"), tmp_path) <= 5


def test_print_leaves_waves_of_joints_to_the_file_where_a_figure_draws_them():
    section = next(one for one in page(real).sections if one.anchor == "parameters")
    table = next(block for block in section.blocks if isinstance(block, Table))
    waves = [row[0].startswith("harmonic") for row in table.rows]
    assert sum(waves) == len(waves) - table.on_paper > 0
    assert not any(waves[: table.on_paper])
    plain = next(one for one in page(sound).sections if one.anchor == "parameters")
    assert plain.blocks[1].on_paper is None


def test_what_is_believed_is_said_before_anything_else():
    shown, point = page(real), real().proof.point
    assert shown.believable
    assert shown.mark == GUARDED == mark(sound())
    radius = f"R95 (3-D radius, 95 %) of the mean tool point is {point.radius_mean * 1e6:.0f} um"
    radius += ", without systematic errors of the instrument"
    assert f"{radius}; it can be believed" in plain(shown.verdict)
    assert plain(shown.reasons[0]).startswith(
        f"The mean tool point lies within {micrometres(point.radius_mean)} um"
    )
    # five times the stated noise, less what 56 numbers learn from 360 equations
    assert any(re.match(r"The residuals are [45]\.\d times", text) for text in shown.reasons)
    assert not any("times as large as the stated noise" in text for text in reasons(sound()))


def test_noise_that_is_only_assumed_is_named_with_what_rests_on_it():
    stated = sound()
    guessed = replace(stated, source=replace(stated.source, noise_assumed=True))
    counts = "held-out poses guard it. Their noise counts as error, since it is only assumed."
    told = guessed  # as by repeats
    belief = replace(told.proof.belief, noise_counts=True)
    guessed = replace(told, proof=replace(told.proof, belief=belief))
    said = [counts in believed_words(one) for one in (guessed, told, stated)]
    assert said == [True, False, False]
    assert [mark(one) for one in (guessed, told, stated)] == [GUESSED, GUESSED, GUARDED]
    allows = "The noise of the readings is assumed: R95 allows for less of it, "
    rests = "The noise of the readings is assumed, and R95 with it; "
    for found, said in ((guessed, (1, 0)), (told, (0, 1)), (stated, (0, 0))):
        starts = [sum(text.startswith(one) for text in reasons(found)) for one in (allows, rests)]
        assert tuple(starts) == said


def test_the_verdict_and_the_headline_are_the_held_out_figures():
    found, shown = real(), page(real)
    before, after = found.before_test, found.fit.test
    for value in (before.position.mean * 1e3, after.position.mean * 1e3):
        assert f"{value:.3f}" in shown.verdict
    for value in (before.rotation.mean, after.rotation.mean):
        assert f"{np.degrees(value):.3f}" in shown.verdict
    rows = shown.headline.rows
    assert [row[0] for row in rows] == ["nominal, frames fitted", "geometric", "extended (chosen)"]
    assert shown.headline.strong == (2,)
    assert rows[2][1] == f"{after.position.mean * 1e3:.3f}"


def test_every_number_of_the_robot_has_a_row_with_its_u_or_says_held():
    found, shown = real(), page(real)
    section = next(one for one in shown.sections if one.anchor == "parameters")
    table = section.blocks[1]
    names = found.fit.identification.model.names
    assert tuple(row[0] for row in table.rows) == names
    held = [row[0] for row in table.rows if row[-1] == "held"]
    assert set(held) == set(names) - set(found.fit.identification.names)
    a2 = next(one.row for one in handed_numbers(found) if one.row.name == "a2")
    place = found.fit.identification.names.index("a2")
    assert a2.expanded == pytest.approx(2e3 * np.sqrt(found.covariance[place, place]), rel=1e-12)


def test_waves_of_a_joint_with_a_map_are_drawn_and_have_no_rows():
    """Few waves are numbers that a person reads; dozens a joint fill pages and say nothing."""
    few = harmonic_terms(6)
    many = [one for one in harmonic_terms(6, tuple(range(1, 33))) if one.joint == 2]
    assert drawn_waves(few) == set()
    rest = [one for one in few if one.joint != 2]
    assert drawn_waves([*rest, *many]) == {one.name for one in many}


def test_columns_that_say_nothing_of_points_are_left_out():
    found = sound()
    head, rows = headline_cells(found)
    assert "mean deg" in head
    alone = [replace(one, test=replace(one.test, rotation=None)) for one in found.fits]
    points = replace(
        found, fits=tuple(alone), before_test=replace(found.before_test, rotation=None)
    )
    fewer, cells = headline_cells(points)
    assert set(head) - set(fewer) == {"mean deg", "max deg"}
    assert {len(row) for row in cells} == {len(fewer)}
    assert [row[0] for row in cells] == [row[0] for row in rows]
    assert "deg" not in terminal_text(points, DELIVERED).split("Verdict")[0]


def test_sections_are_linked_and_drawn():
    text = html(real)
    reader = read(text)
    for section in page(real).opened().sections:
        assert section.anchor in reader.ids
    assert text.count("<svg") == 6 + 1  # the first one for a phone, too
    assert len(text) < 1_500_000


def test_the_terminal_says_the_same_in_plain_text():
    text = terminal_text(real(), DELIVERED)
    assert text.splitlines()[0] == MEASURED
    assert "\n".join(verdict_lines(plain(page(real).verdict))) in text
    assert "2 of 2 corrected." in text


def test_what_speaks_against_the_noise_is_said_on_the_terminal_and_what_to_do_about_a_drift():
    """Both were below the fold of the report alone."""
    found = real()
    told = " ".join(terminal_text(found, DELIVERED).split())
    assert "The parameters alone do not explain the readings: " in told.partition("Of note:")[2]
    assert "The readings drift" not in told
    proof = found.proof
    slow = Drifting(0.002, SlowDrift(5e-6, 30.0, np.zeros((30, 30))))
    for seen in (slow, replace(slow, p_value=0.04)):  # so near by chance in one set of 25
        judged = trust(
            found.fit.identification, belief=proof.belief, point=proof.point,
            questions=proof.questions, held_out=proof.held_out, drifting=seen,
        )  # fmt: skip
        drifts = replace(found, proof=replace(proof, drifting=seen, trust=judged))
        told = " ".join(terminal_text(drifts, DELIVERED).split())
        assert ("Successive readings are correlated (p = 0.002)" in told) == (seen is slow)
        assert ("measure nests on the floor" in next_step(drifts)) == (seen is slow)
        # a step makes neighbors alike: beside one, no drift is claimed
        step = Moved("station", 0, 10, 11, 20, np.zeros(6), 3e-4, 0.9, 1e-9)
        beside = " ".join(terminal_text(replace(drifts, moved=step), DELIVERED).split())
        assert "correlated" not in beside
        assert ("cannot be asked beside what moved" in beside) == (seen is slow)
        assert not any("correlated" in text for text in reasons(replace(drifts, moved=step)))


def test_few_training_poses_claim_no_drift_that_their_misfit_explains_as_well():
    """Of nine arms that sag, measured at 7 poses and 20 held-out ones, two were said to drift."""
    found = real()
    slow = Drifting(0.002, SlowDrift(5e-6, 30.0, np.zeros((30, 30))), few=7)
    drifts = replace(found, proof=replace(found.proof, drifting=slow))
    assert not slow.seen
    assert "7 training poses do not tell the two apart" in slow.sentence
    assert "includes a drift of up to 5.0 um per axis over 30 rows as a precaution" in slow.sentence
    assert "The readings drift" not in next_step(drifts)


def test_a_worse_model_is_not_said_to_fall_and_is_not_recommended():
    found = real()
    worse = replace(found.fit, test=found.before_test, misses=found.before_misses)
    turned = replace(
        found, before_test=found.fit.test, before_misses=found.fit.misses,
        fits=(found.fits[0], worse),
    )  # fmt: skip
    assert " RISES from " in verdict(turned)
    assert next_step(turned).startswith("Do not use this model")


def test_where_few_rows_miss_most_the_next_step_is_a_second_visit_and_not_that_it_is_no_noise():
    """What visits have told already needs no more of them."""
    found = real()
    for source, said in (("", True), ("noise", False)):
        tails = LongTails(3.0, 1e-6, 4, 14, 60, source)
        step = next_step(replace(found, proof=replace(found.proof, tails=tails)))
        assert ("Measure every pose twice" in step) == said
        assert "it is not noise" not in step or source


def test_only_repeats_tell_that_what_is_left_is_no_noise():
    found = real()
    assert found.refuted
    assert found.fit.identification.lack_of_fit is None  # each pose was measured once
    assert "Only repeated poses can show whether what is left is noise." in next_step(found)
    identification = replace(found.fit.identification, lack_of_fit=LackOfFit(9.0, 1e-9, 60.0, 90))
    fits = [replace(found.fit, identification=identification) if one is found.fit else one
            for one in found.fits]  # fmt: skip
    assert "it is not noise." in next_step(replace(found, fits=tuple(fits)))
    # visits that scatter as much: they were asked for although they were there
    identification = replace(found.fit.identification, lack_of_fit=LackOfFit(1.0, 0.5, 60.0, 90))
    fits = [replace(found.fit, identification=identification) if one is found.fit else one
            for one in found.fits]  # fmt: skip
    step = next_step(replace(found, fits=tuple(fits)))
    assert "Only repeated poses" not in step
    assert "visits of one pose differ by about as much" in step


def test_a_drift_that_the_order_of_the_poses_hides_is_on_the_first_screen():
    """With R95 of 91 um, of which the true points needed 96, nothing there spoke of a drift."""
    for found, refuted in ((sound(), False), (real(), True)):
        assert found.refuted == refuted
        P = found.fit.identification.model.n_numbers
        steady = SteadyDrift(30e-6, 0.001, 0.9, 40e-6, np.zeros((P, P)))
        proof, told = found.proof, []
        for one in (steady, replace(steady, p_value=0.5), None):
            slow = Drifting(float("nan"), None, of_visits=True, steady=one)
            judged = trust(
                found.fit.identification, belief=proof.belief, point=proof.point,
                questions=proof.questions, held_out=proof.held_out, drifting=slow,
            )  # fmt: skip
            drifts = replace(found, proof=replace(proof, drifting=slow, trust=judged))
            said = " ".join(terminal_text(drifts, DELIVERED).split())
            verdict_said, note = said.partition("Of note:")[::2]
            assert "Whether the readings drift cannot be decided, because neighboring" in note
            told.append(
                (
                    "They cannot show a steady drift, which the order of the poses hides: one of "
                    "up to 104 um per axis is in R95." in verdict_said,
                    "measure the first 12 poses once more at the end" in next_step(drifts),
                    any("a drift" in held.promise for held in statements_of(drifts)),
                )
            )
        assert told == [(True, True, True), (True, False, True), (False, False, False)]
    judged = trust(
        found.fit.identification, belief=proof.belief, point=proof.point,
        questions=proof.questions, drifting=Drifting(0.5, None, of_visits=True, steady=steady),
    )  # fmt: skip
    assert f"the region includes {steady.words}" in judged.sentence  # also where visits decide
    slow = Drifting(float("nan"), None, of_visits=True, steady=steady)
    hangs = replace(found, doubted=(MOUNTING,), proof=replace(proof, drifting=slow))
    step = next_step(hangs)
    assert step.startswith(
        "First find out whether the arm hangs on a wall or ceiling, or a steady drift looks like it"
    )
    assert step.endswith("and nests on the floor ([drift]), which take off what the station does.")


def test_nests_are_not_asked_for_where_they_were_measured():
    """The next step asked for nests again, also of a drift that the order of the poses hides."""
    found = sound()
    nests = replace(found.source, drift=("the station drifted: taken off",))
    nothing = np.zeros((1, 1))
    steady, slow = SteadyDrift(30e-6, 0.001, 0.9, 40e-6, nothing), SlowDrift(5e-6, 30.0, nothing)
    hides = Drifting(float("nan"), None, of_visits=True, steady=steady)
    for one, without, with_nests in (
        (hides, "to see whether it is, and nests on the floor", "at the end to see whether it is."),
        (Drifting(0.001, slow), "measure nests on the floor with them", "the nests more often."),
    ):
        drifts = replace(found, proof=replace(found.proof, drifting=one))
        assert without in next_step(drifts)
        assert next_step(replace(drifts, source=nests)).endswith(with_nests)


def test_where_the_order_of_the_poses_hides_a_drift_the_next_step_is_a_second_round():
    """R95 has none in it: with poses sorted along a rail it held 80 % of an arm that grew."""
    found = real()
    for left, said in ((None, True), (SlowDrift(3e-5, 40.0, np.zeros((1, 1))), False)):
        proof = replace(found.proof, drifting=Drifting(float("nan"), left, of_visits=True))
        step = next_step(replace(found, proof=proof))
        assert ("a second time in the same order" in step) == said


def test_more_poses_are_no_help_against_noise_that_is_larger_than_stated():
    """Nobody who reads that R95 is wide knows that the noise he stated may be why."""
    found = real()
    assert found.fit.identification.p_value < RED
    less = replace(found.fit.train.position, mean=0.5 * found.fit.test.position.mean)
    few = replace(found.fit.train, position=less)
    fits = [replace(one, train=few) if one is found.fit else one for one in found.fits]
    step = next_step(replace(found, fits=tuple(fits)))
    assert "more of these may help. If the readings are noisier than stated, state that" in step
    explained = replace(found.fit.identification, p_value=0.5)
    fits = [replace(one, train=few, identification=explained) if one is found.fit else one
            for one in found.fits]  # fmt: skip
    step = next_step(replace(found, fits=tuple(fits)))
    assert step.endswith("more of these may help.")


def test_where_geometry_alone_was_asked_for_and_is_refuted_the_next_step_is_the_choice():
    """Whoever holds the model fixed does not know that more of it would do."""
    found = real()
    held = replace(found, choice=replace(found.choice, asked="geometric"))
    assert next_step(held).startswith("Try --model choose: ")
    assert "--model" not in next_step(found)
    fine = sound()
    assert not fine.refuted
    held = replace(fine, choice=replace(fine.choice, asked="geometric"))
    assert "--model" not in next_step(held)


def test_what_is_quoted_is_not_said_of_files_that_lack_the_joint_errors():
    found = real()
    assert found.choice.chosen == "extended"
    step = next_step(found)
    alone = f"{1e3 * found.fits[0].test.position.mean:.3f} mm"
    assert step.startswith("Send targets corrected by --program CSV, or load robot/robot.toml:")
    assert f"take robot_geometric/, whose mean position error is {alone}." in step
    assert next_step(sound()).startswith("Load the identified robot from robot/, or send")


def without(found, **parts):
    """The calibration with another proof."""
    return replace(found, proof=replace(found.proof, **parts))


def test_what_may_be_quoted_follows_from_what_is_believed():
    found = sound()
    assert "Quote R95 = " in next_step(found)
    assert "um for a single move" in next_step(found)
    alone = without(found, belief=replace(found.proof.belief, n_guards=0))
    assert "no held-out pose guards it" in next_step(alone)
    none = without(found, belief=None, point=None, trust=Trust("none", True, ("Why",)))
    assert "Quote the held-out radius" in next_step(none)
    assert "Do not quote an uncertainty" in next_step(without(none, conformal=None))
    (fit,) = [one for one in none.fits if one is none.fit]
    stopped = replace(fit, identification=replace(fit.identification, status=Status.LIMIT))
    left = replace(none, fits=tuple(stopped if one is fit else one for one in none.fits))
    assert next_step(left).startswith(
        "The fit did not converge. Before you use the identified robot"
    )
    apart = without(found, frame=replace(found.proof.frame, p_base=1e-9))
    assert next_step(apart).startswith("First find out why")


def test_no_radius_is_said_to_be_believed_before_what_moved_is_settled():
    found = sound()
    step = Moved("station", 0, 9, 10, 20, np.array([1e-4, 0, 0, 0, 0, 0]), 1e-4, 0.9, 1e-9)
    for one, status in ((found, "believed"), (replace(found, moved=step), "not before what")):
        radii = [each for each in statements_of(one) if each.key.startswith("region")]
        assert radii
        assert all(each.use.startswith(status) for each in radii)


def test_what_no_held_out_pose_can_show_is_said_to_be_in_no_figure():
    """A scale of the instrument, say, would make a sentence untrue that did not say so."""
    found, parts = sound(), shared_session()
    assert any("No figure includes systematic errors" in text for text in reasons(found))
    assert not any("No figure includes" in text for text in reasons(parts))
    for one, unsaid in ((found, True), (parts, False)):
        with undrawn():
            page = page_of(one, DELIVERED, VERSIONS)
        assert ("Systematic errors of the instrument are in no figure" in page.next_step) == unsaid
        # the verdict is what is quoted: it does not leave that to a remark
        assert ("um, without systematic errors of the instrument; " in verdict(one)) == unsaid
    for one, ending in ((found, ", but no systematic errors"), (parts, ", and systematic errors")):
        promise = next(each.promise for each in statements_of(one) if each.key == "region_mean")
        assert promise.endswith(ending)
    told = found.proof.conformal.sentence
    assert told.startswith("a further reading of the same target, at a pose drawn like the ")
    assert told.endswith("and what all readings share is not")


def test_the_mark_is_good_only_where_held_out_poses_guard_the_region():
    found = sound()
    few = without(found, belief=replace(found.proof.belief, n_guards=0))
    apart = without(found, frame=replace(found.proof.frame, p_base=1e-9))
    none = without(found, belief=None, point=None, trust=Trust("none", True, ("Why",)))
    marks = [mark(one) for one in (found, few, without(few, held_out=None), apart, none)]
    assert marks == [GUARDED, UNGUARDED, UNTESTED, ELSEWHERE, NOTHING]
    assert [text[0] for text in marks] == ["✓", "?", "?", "✗", "✗"]
    told = [one.believable for one in (found, few, apart, none)]
    assert told == [True, True, False, False]
    for one, says in ((few, "too few to guard"), (apart, "prove nothing"), (none, "No statement")):
        assert says in verdict(one)


def test_every_radius_says_its_dimension_and_no_u_of_a_point_is_told_by_k_alone():
    for make in (real, sound):
        shown = " ".join(read(html(make)).text)
        assert "k = 2)" not in shown
        assert "agree" not in shown
        for word in ("R95 (3-D radius, 95 %)", "95.4 %", "Guard:", "Misfit:", "Transfer g:"):
            assert word in shown, word
        table = statements_of(make())
        assert [one.key for one in table[:3]] == ["region_mean", "region_move", "parameters"]
        assert {one.use.partition(" (")[0] for one in table} <= {
            "believed",
            "not needed",
            "refuted by a test",
        }


def test_the_radii_hold_what_they_promise_of_normal_points():
    """The believed radius and that of the parameters alone, by drawing."""
    found = sound()
    radius = {one.key: one.radius for one in statements_of(found)}
    q = found.stated_q
    rng = np.random.default_rng(5)
    belief, result = found.proof.belief, found.fit.identification
    region = belief.regions(q)
    plain = tool_statement(result.model, q, result.full_covariance)
    for key, stated in (("region_mean", region), ("parameters", plain)):
        root = np.linalg.cholesky(stated.covariance)
        drawn = root @ rng.standard_normal((len(q), 3, 4000))
        size = np.linalg.norm(drawn, axis=1) * stated.factor / coverage_factor(3)
        # 108,000 draws leave 0.07 %
        assert (size < radius[key]).mean() == pytest.approx(0.95, abs=0.003)
    assert radius["parameters"] < radius["region_mean"] < radius["region_move"]


def test_rows_left_out_while_reading_are_said_on_the_first_screen():
    found = sound()
    masked = replace(found, source=replace(found.source, masked=("poses.csv:7: left out",)))
    assert not any("left out while reading" in text for text in reasons(found))
    assert any("left out while reading" in text for text in reasons(masked))


@pytest.mark.parametrize(
    ("old", "said"),
    [
        (0.32602, "0.3260"),  # fitted: the zero is known
        (290.0, "290"),  # stated so
        (1 / 3, "0.3333"),
        (np.degrees(np.radians(-90.5)), "−90.5"),  # stated, and back from radians
        (0.0, "0"),
    ],
)
def test_an_old_value_that_was_fitted_has_the_digits_of_the_new_one(old, said):
    new = old - 0.02392
    for expanded in (0.0024, None):
        row = DhRow("tool.x", "mm", old, new, new - old, expanded)
        cells = _cells(HandedNumber(row, None, ""))
        assert cells[2] == said
        assert len(cells[3].partition(".")[2]) == len(cells[4].partition(".")[2]) == 4


def lines_of(monkeypatch, draw, found):
    """Axes of the figure that a function draws."""
    made = []
    monkeypatch.setattr(plots, "svg_of", made.append)
    draw(found)
    return made[0].axes


@pytest.mark.parametrize("make", [real, sound])
def test_errors_over_time_have_an_axis_that_can_be_read(monkeypatch, make):
    (ax,) = lines_of(monkeypatch, plots.by_order, make())
    low, high = ax.get_ylim()
    assert len([tick for tick in ax.get_yticks() if low <= tick <= high]) >= 3
    errors = make().fit.misses.position * 1e3
    assert low < np.quantile(errors, 0.05)
    assert high > errors.max()


@pytest.mark.parametrize("ratio", [1.2, 3, 20, 300])
def test_errors_before_and_after_stand_in_bars_enough_to_be_read(ratio):
    rng = np.random.default_rng(3)
    after = np.linalg.norm(rng.normal(scale=0.01, size=(200, 3)), axis=1)
    before = np.linalg.norm(rng.normal(scale=0.01 * ratio, size=(200, 3)), axis=1)
    edges = plots.bars(before, after)
    counts = [np.histogram(np.clip(some, *edges[[0, -1]]), edges)[0] for some in (before, after)]
    assert [count.sum() for count in counts] == [200, 200]  # none is left out
    # a size of three numbers spreads over 2.5 times its middle: some five bars hold it
    assert all((count > 2).sum() >= 5 for count in counts)
    assert (edges[0] > 0) == (ratio >= 20)  # logarithmic only where even bars would not do


@pytest.mark.parametrize(("rows", "bars"), [(5, 12), (20, 13), (100, 30), (1000, 40)])
def test_few_rows_have_few_bars(rows, bars):
    errors = np.random.default_rng(5).uniform(1.0, 2.0, rows)
    assert len(plots.bars(1.5 * errors, errors)) - 1 == bars


def test_errors_of_nothing_have_bars_from_zero():
    nothing = np.zeros(5)
    assert plots.bars(nothing, nothing)[[0, -1]].tolist() == [0.0, 1.0]


def test_a_figure_writes_the_radius_as_the_sentence_does(monkeypatch):
    found = sound()
    whole = replace(found.proof.point, radius_mean=2.5e-5)
    found = replace(found, proof=replace(found.proof, point=whole))
    axes = lines_of(monkeypatch, plots.histogram, found)
    said = [text.get_text() for ax in axes for text in ax.texts]
    assert "R95 25.0 µm" in said
    assert "within 25.0 um of" in whole.sentence


def test_the_means_of_the_first_picture_are_those_of_the_table(monkeypatch):
    found = sound()
    m = len(found.measurements)
    again = replace(found.measurements, pose_id=np.arange(m) // 3, repeat=np.arange(m) % 3)
    rows, errors = found.is_judged, (found.before_misses, found.fit.misses)
    for table, said in ((found.measurements, False), (again, True)):
        one = replace(found, measurements=table)
        axes = lines_of(monkeypatch, plots.histogram, one)
        means = [
            line.get_xdata()[0] for line in axes[0].get_lines() if line.get_linestyle() == "--"
        ]
        figures = [figures_of(each, table, rows).position.mean for each in errors]
        np.testing.assert_allclose(means, np.array(figures) * 1e3, rtol=1e-12)
        assert axes[0].get_ylabel() == "poses"
        (figure,) = accuracy_section(one).blocks
        assert ("root mean square" in figure.caption) == said


def test_running_medians_are_named_where_they_are_drawn_and_nowhere_else(monkeypatch):
    def captions(found):
        return " ".join(block.caption for block in residual_section(found).blocks)

    def lines(found):
        axes = lines_of(monkeypatch, plots.by_joint, found)
        return sum(line.get_marker() == "None" for ax in axes for line in ax.get_lines())

    found = real()
    assert "lines: running medians" in captions(found)
    assert lines(found) == 2 * found.measurements.q.shape[1]
    monkeypatch.setattr(plots, "LEAST", int(found.is_judged.sum()) + 1)
    assert "median" not in captions(found).replace("medians are of all", "")
    assert lines(found) == 0


def test_rotations_have_three_decimals_or_two_digits():
    assert [deg(np.radians(x)) for x in (0.1019, 0.01744, 0.00042)] == ["0.102", "0.017", "0.00042"]


def test_a_number_without_u_is_rounded_as_its_change():
    table = next(one for one in page(sound).sections if one.anchor == "parameters").blocks[1]
    alone = [row for row in table.rows if row[5] == "–" and row[4] != "0"]
    assert alone
    for _, _, _, new, delta, _, _ in alone:
        assert len(new.partition(".")[2]) == len(delta.partition(".")[2])


def test_readings_and_different_poses_are_counted_apart():
    rows = dict(next(one for one in page(sound).sections if one.anchor == "data").blocks[0].rows)
    table = sound().measurements
    assert rows["readings"] == f"{len(table)} of position and orientation"
    assert rows["different poses"].split()[0] == str(table.n_poses)
    assert ("several times" in rows["different poses"]) == (table.n_poses < len(table))
