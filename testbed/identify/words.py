"""What a calibration says, sentence by sentence: verdict, reasons, and all that is printed."""

from collections.abc import Sequence

from testbed.files.session_toml import FRAMES_ALONE
from testbed.files.tried.runs import IN_A_ROW
from testbed.identify.applies.beyond import beyond_words, drawn_out, simpler_words
from testbed.identify.applies.rows import edge_words
from testbed.identify.applies.unsaid import unsaid_words
from testbed.identify.calibration import FRAMES, Calibration
from testbed.identify.conditions import conditions_words, held_out_departs
from testbed.identify.decisions import decision_words
from testbed.identify.handback.delivered import Delivered
from testbed.identify.handback.states import hand_back_warnings, tool_words
from testbed.identify.headline import deg, headline_cells, kind, mm, r95
from testbed.identify.moved import happened, moved_words
from testbed.identify.shared import states_instrument
from testbed.identify.to_do.causes import description_step
from testbed.identify.to_do.change import NOTHING_LEFT, changes, nothing_left
from testbed.identify.to_do.next_step import next_step
from testbed.identify.to_do.program import program_step
from testbed.identify.visits.report import judges_called, visit_words
from testbed.identify.visits.wide import wide_because, wide_words
from testbed.lengths import with_unit
from testbed.report.page import SIMULATED
from testbed.units import counted, sentences, significant

MEASURED = "MEASURED - a calibration report, not a certificate; no traceability is claimed"
GUARDED = "✓ The stated radius can be believed"
GUESSED = "? The stated radius can be believed, though the noise is only assumed"
UNGUARDED = "? The stated radius was tested by too few held-out poses"
RANGED = "? The stated radius was tested by distances alone"
UNTESTED = "? No held-out pose has tested the stated radius"
ELSEWHERE = "✗ The held-out poses are off as a whole: they prove nothing until the cause is found"
UNSHOWN = "? Nothing shows in which frame the held-out positions stand: they prove nothing yet"
MOVED = "? Something moved or changed while this was measured: first find out what"
COMPUTED = "✗ These seem to be poses that a controller computed, not measurements"
UNSETTLED = "? The readings contradict the description: first settle what the next step names"
NOTHING = "✗ No statement about the tool point can be believed"
BESIDE_A_STEP = (
    "Whether the readings drift cannot be asked beside what moved, which looks like a drift: ask "
    "again once its rows are apart; until then the region includes one"
)
LARGER = 1.2
"""Residuals so many times the stated noise are said to be larger."""
MOST_NAMED = 5
"""Rows that do not fit, named on the terminal."""


def notice(calibration: Calibration) -> str:
    """Whether the numbers come from a real robot; neither kind is a certificate."""
    return SIMULATED if calibration.source.simulated else MEASURED


def mark(calibration: Calibration) -> str:
    """The verdict in a few words."""
    belief = calibration.proof.belief
    if belief is None:
        return NOTHING
    if calibration.source.exact:
        return COMPUTED
    if calibration.elsewhere:
        return UNSHOWN if calibration.unshown else ELSEWHERE
    if calibration.moved is not None:
        return MOVED
    if description_step(calibration):
        return UNSETTLED
    if belief.n_guards:
        return GUESSED if calibration.source.noise_assumed else GUARDED
    if belief.n_ranged:
        return RANGED
    return UNGUARDED if calibration.proof.held_out is not None else UNTESTED


def verdict(calibration: Calibration) -> str:
    """How good the calibration is, on poses that it never saw, and what may be believed of it."""
    after = calibration.fit.test or calibration.fit.train
    if calibration.fit.test is None:
        poses = counted(calibration.measurements.rows(calibration.is_used).n_poses, "pose")
        where = f"at the {poses} it was fitted to (none is held out)"
    else:
        where = f"on {counted(held_out_poses(calibration), 'held-out pose')}"
    if calibration.elsewhere and calibration.proof.frame is not None:
        said = calibration.proof.frame.said_of(judges_called(calibration))
        else_said = () if calibration.unshown else _or_conditions(calibration)
        said = ". ".join((f"{said[0].upper()}{said[1:]}", *else_said))
        return f"{said}. {believed_words(calibration)}"
    if calibration.choice.asked == FRAMES_ALONE:
        text = f"With only the frames fitted, the {kind(calibration)} {where} is "
        text += f"{mm(after.position.mean)} mm"
        if after.rotation is not None:
            text += f"; the orientation error is {deg(after.rotation.mean)} deg"
        return f"{text}. {believed_words(calibration)}"
    position, *rotation = changes(calibration)
    text = f"The {kind(calibration)} {where} {position}"
    if rotation:
        text += f"; the orientation error {rotation[0]}"
    if nothing_left(calibration):
        text += f". {NOTHING_LEFT[:-1]}"
    return f"{text}. {believed_words(calibration)}"


def _or_conditions(calibration: Calibration) -> tuple[str, ...]:
    """What may have moved held-out rows as a whole beside another frame: their own conditions."""
    used, judges = calibration.is_used, calibration.split.is_test
    differ = held_out_departs(calibration.conditions, calibration.set_up, used, judges)
    return (f"It may be their conditions instead: {'; '.join(differ)}",) if differ else ()


def believed_words(calibration: Calibration) -> str:
    """Whether a statement about the tool point can be believed, and its radius."""
    said = _believed_words(calibration)
    return f"{said} {wide}" if (wide := wide_because(calibration)) else said


def _believed_words(calibration: Calibration) -> str:
    """The same without what makes the radius wide."""
    point, belief = calibration.proof.point, calibration.proof.belief
    if point is None or belief is None:
        return "No statement about the true tool point can be believed."
    radius = f"{r95(point)} of the mean tool point is {with_unit(point.radius_mean)}"
    if point.relative:
        radius += " relative to the others (the readings do not show where the robot stands)"
    if not states_instrument(calibration.shared):
        # whoever quotes the verdict alone must not claim them
        radius += ", without systematic errors of the instrument"
    if calibration.source.exact:
        return f"{radius}; poses that a controller computed prove nothing of it."
    if calibration.elsewhere:
        return f"{radius}; the held-out poses should have tested it, and could not."
    if calibration.moved is not None:
        return f"{radius}, and covers what {happened(calibration.moved)}: first find out what."
    if description_step(calibration):
        return f"{radius}; first settle what the readings contradict (see the next step)."
    if belief.n_guards:
        noise = ""
        if belief.noise_counts:
            why = "only assumed" if calibration.source.noise_assumed else "less than stated"
            noise = f" Their noise counts as error, since it is {why}."
        return (
            f"{radius}; it can be believed: {belief.n_guards} held-out poses guard it.{noise}"
            f"{_drift_words(calibration)}{_drawn_out_words(calibration)}"
        )
    if belief.n_ranged:
        return (
            f"{radius}; distances at {belief.n_ranged} held-out poses have tested it, in one "
            f"direction each: they guard no other.{_drawn_out_words(calibration)}"
        )
    if calibration.proof.held_out is None:
        alone = f"{radius}; it rests on the fit alone: "
        if held_out_poses(calibration) and calibration.measurements.is_distance.all():
            return f"{alone}few held-out distances, of one direction each, guard no radius."
        return f"{alone}no held-out pose has tested it."
    few = counted(len(calibration.proof.held_out), "held-out pose")
    return f"{radius}; it allows for a larger misfit, because {few} tested it: too few to guard it."


def _drift_words(calibration: Calibration) -> str:
    """That no held-out pose shows a drift which the order of the poses hides; else empty."""
    slow, point = calibration.proof.drifting, calibration.proof.point
    if slow is None or not slow.void or slow.steady is None or point is None:
        return ""
    return (
        " They cannot show a steady drift, which the order of the poses hides: one of up to "
        f"{with_unit(slow.steady.way, point.radius_mean)} per axis is in R95."
    )


def _drawn_out_words(calibration: Calibration) -> str:
    """That the radius is so wide because of held-out rows that stand out; empty where it is not."""
    less, shots = drawn_out(calibration), len(calibration.gross.held_out_names)
    point = calibration.proof.point
    if less is None or point is None:
        return ""
    stand, them = ("stands", "it") if shots == 1 else ("stand", "them")
    return (
        f" It is so wide because of {counted(shots, 'held-out row')} that {stand} out: without "
        f"{them}, R95 would be {with_unit(less, point.radius_mean)}."
    )


def reasons(calibration: Calibration) -> tuple[str, ...]:
    """Why the verdict is what it is: what is believed and what is in it comes first."""
    said = [*moved_words(calibration), *trust_words(calibration, calibration.proof.trust.sentences)]
    if out := int(calibration.gross.left_out.sum()):
        said.append(f"{counted(out, 'row')} did not fit and took no part: see Outliers")
    return sentences([*said, *_remarks(calibration)])


def trust_words(calibration: Calibration, texts: Sequence[str]) -> list[str]:
    """What a proof says, without a drift that is claimed beside what moved: a step looks like one.

    Of readings with a step, those on one side of it follow each other.
    """
    slow = calibration.proof.drifting
    if calibration.moved is None or slow is None or not slow.seen:
        return list(texts)
    return [BESIDE_A_STEP if text[1:] == slow.sentence[1:] else text for text in texts]


def _remarks(calibration: Calibration) -> list[str]:
    """What else a person should know: the model, rows not read, what is in no figure."""
    texts = list(unsaid_words(calibration))
    if calibration.source.noise_assumed:
        rests = (
            ": R95 allows for less of it, as held-out errors count in full, and may be smaller "
            "where it is stated"
            if calibration.proof.belief is not None and calibration.proof.belief.noise_counts
            else ", and R95 with it"
        )
        texts.append(
            f"The noise of the readings is assumed{rests}; write the standard "
            "uncertainty of a reading (k = 1) that follows from the instrument's certificate, and "
            "take assumed = true out ([uncertainty])"
        )
    factor = calibration.fit.noise_factor
    if calibration.refuted and factor > LARGER:
        texts.append(
            f"The residuals are {significant(factor, 2)} times as large as the stated noise "
            "explains: U of the numbers is computed from their scatter between poses instead"
        )
    texts.append(f"Model: {calibration.choice.sentence}")
    texts += [
        *edge_words(calibration),
        *wide_words(calibration),
        *simpler_words(calibration),
        *beyond_words(calibration),
    ]
    if calibration.source.masked:
        masked = counted(len(calibration.source.masked), "note")
        texts.append(
            "Rows were left out while reading, before poses were held out, so no figure contains "
            f"them: see {masked} under The data"
        )
        texts += [text for text in calibration.source.masked if IN_A_ROW in text]
    if not states_instrument(calibration.shared):
        texts.append(
            "No figure includes systematic errors of the instrument (a wrong scale, eccentric "
            "encoders, a target off its place), because the session states none "
            "([uncertainty.systematic]); held-out poses of the same instrument cannot show them"
        )
    if FRAMES not in calibration.doubted:  # else links make up for a frame, and none of it holds
        texts += hand_back_warnings(calibration)
    texts += tool_words(calibration)
    texts += calibration.warnings
    texts += calibration.source.warnings
    return texts


def held_out_poses(calibration: Calibration) -> int:
    """Number of held-out poses."""
    return calibration.measurements.rows(calibration.split.is_test).n_poses


def terminal_text(calibration: Calibration, delivered: Delivered) -> str:
    """What the command prints: notice, errors, verdict, what to do, what to know beside it."""
    from testbed.report.text import table, verdict_lines

    names, cells = headline_cells(calibration)
    head = tuple(name.replace("χ²", "chi2") for name in names)
    rows = [[cell.replace("−", "-").replace("–", "-") for cell in row] for row in cells]
    held = calibration.split.is_test.any()
    rows_named = "held-out rows" if held else "the rows used"
    title = f"{calibration.source.name}: errors at {rows_named}, measuring noise included"
    parts = [notice(calibration), table(title, head, rows), ""]
    parts += verdict_lines(verdict(calibration))
    said = [*decision_words(calibration, delivered), *moved_words(calibration)]
    believed = calibration.proof.belief is not None and not calibration.elsewhere
    if not believed:
        said += trust_words(calibration, calibration.proof.trust.sentences)
    parts += [f"  {text}" for text in sentences(said)]
    parts.append(f"To do: {next_step(calibration)} {program_step(calibration, delivered)}".rstrip())
    if delivered.program:
        parts += ["Program:", *(f"  {text}" for text in sentences(delivered.program))]
    parts.append("Of note:")
    said = trust_words(calibration, calibration.proof.trust.found) if believed else []
    said += calibration.gross.sentences[:MOST_NAMED]
    more = len(calibration.gross.sentences) - MOST_NAMED
    if more > 0:
        said.append(f"The report lists {counted(more, 'more row')} that did not fit")
    said += [*_remarks(calibration), *visit_words(calibration), conditions_words(calibration)]
    if believed:
        said.append("The report explains what the radius rests on and what each test found")
    parts += [f"  {text}" for text in sentences(said)]
    return "\n".join(parts)
