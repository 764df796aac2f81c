"""The report's section on coverage: which stated uncertainty can be believed on which robot."""

from testbed.report.page import Block, Figure, Points, Section, Text, Verdict
from testbed.report.svg import on_phone
from testbed.studies.coverage.plots import attained, sharpness
from testbed.studies.coverage.settings import CoverageSettings
from testbed.studies.coverage.study import BELIEVED, MODELS, STATEMENTS, STUDY, CoverageStudy
from testbed.studies.coverage.summary import (
    Cell,
    NumbersCheck,
    advised,
    cells,
    followed,
    numbers_check,
)
from testbed.studies.coverage.tables import (
    advice_table,
    attained_share,
    coverage_table,
    numbers_table,
    share_of,
    summary_table,
)
from testbed.studies.protocol import Answer
from testbed.studies.trial.records import Campaign
from testbed.units import NARROW, counted, listed, micrometres, percent, plain

NAMES = {
    "region": "the believed region",
    "model": "the region from the parameters alone",
    "discrepancy": "the region with discrepancy",
    "conformal": "the conformal ball",
}


def section(campaign: Campaign) -> Section:
    """The verdict, the procedure, table and figures, and the parameters."""
    studies = STUDY.of(campaign)
    found = cells(studies)
    robots = counted(studies[0].before.size, "robot")
    level = percent(studies[0].level)
    blocks: list[Block] = [
        Text(believable_sentence(found)),
        Points(consequences(studies, found)),
        Text(procedure(campaign)),
        coverage_table(studies, found),
        Figure(
            f"Share of held-out points inside what is stated, mean over {robots} of each kind; the "
            f"line is the promise, {level}. Thick: 95 % band of each; thin: bands that hold all "
            f"{len(found)} at once. Open: falls short. Each panel has its own scale.",
            attained(found),
            phone=on_phone(attained, found),
        ),
        Figure(
            "How large a statement is: radius of the ball with the volume of the region, mean over "
            "robots and poses. Open: falls short, so its small radius is worth nothing.",
            sharpness(studies, found),
        ),
    ]
    checks = [check for study in studies if (check := numbers_check(study)) is not None]
    if checks:
        blocks += [Text(" ".join(numbers_sentence(check) for check in checks))]
        blocks += [numbers_table(checks, studies[0])]
    blocks.append(advice_table(studies))
    return Section(
        "coverage", "Which stated uncertainty can be believed?", tuple(blocks), part="answer"
    )


def believable_sentence(found: tuple[Cell, ...]) -> str:
    """The robots on which each statement keeps its promise, the most believable first."""
    phrases, refused = [], [cell.truth for cell in found if cell.refused]
    for statement in ("region", "conformal", "model", "discrepancy"):
        made = [c for c in found if c.statement == statement and not c.refused]
        if made and all(c.outcome == "undecided" for c in made):
            phrases.append(f"{NAMES[statement]} cannot be judged by so few robots")
            continue
        kept = [(c.model, c.truth) for c in made if c.kept]
        truths = list(dict.fromkeys(c.truth for c in made))
        where = [on([truth for m, truth in kept if m == model], truths) for model in MODELS]
        if where[0] == where[1]:
            phrases.append(f"{NAMES[statement]} {where[0]} with either model")
        else:
            each = [f"{w} with the {m} model" for w, m in zip(where, MODELS, strict=True)]
            phrases.append(f"{NAMES[statement]} {' and '.join(each)}")
        if left := list(dict.fromkeys(c.truth for c in made if c.outcome == "undecided")):
            phrases[-1] += f" (too few robots to decide on {listed(left)} robots)"
    if refused:
        other = phrases[0].replace("every robot", "every other robot")
        phrases[0] = f"{other} (nothing is stated on {listed(list(dict.fromkeys(refused)))} robots)"
    first = phrases[0].replace(" on ", " keeps its promise on ", 1)
    return f"At {percent(found[0].level)}, {first}. Of the others: {'; '.join(phrases[1:])}."


def on(kept: list[str], truths: list[str]) -> str:
    """The robots of a list, in words."""
    if not kept:
        return "on no robot"
    if kept == truths:
        return "on every robot" if len(truths) > 1 else f"on {truths[0]} robots"
    return f"on {listed(kept)} robots" + (" only" if len(kept) == 1 else "")


def consequences(studies: tuple[CoverageStudy, ...], found: tuple[Cell, ...]) -> tuple[str, ...]:
    """The conclusions in sentences."""
    warned = {
        (study.truth, model): float(flagged.mean())
        for study in studies
        for model, flagged in zip(MODELS, study.flagged, strict=True)
    }
    regions, said = [c for c in found if c.statement == "model"], [width(found)]
    for model in MODELS:
        rows = [c for c in regions if c.model == model and not c.believable]
        if rows:
            said.append(
                f"The parameters alone of the {model} model fall short on "
                f"{listed([c.truth for c in rows])} robots: their region contains "
                f"{span([c.share.value for c in rows])} of the true points. truebed itself "
                "detects this, from residuals and validation poses, on "
                f"{span([warned[c.truth, model] for c in rows])} of these robots."
            )
    sound = [warned[c.truth, c.model] for c in regions if c.kept]
    if sound:
        said.append(
            f"Where the parameters alone keep their promise, a test contradicts them on "
            f"{span(sound)} of the robots."
        )
    balls = [c for c in found if c.statement == "conformal"]
    radii = span_of([c.radius for c in balls])
    said.append(
        f"The conformal ball contains {span([c.share.value for c in balls])} without any "
        f"assumption about the errors; its price is a radius of {radii}{NARROW}µm, and measured "
        "poses that the calibration may not use."
    )
    said += [climbing(studies), obeyed(studies)]
    said += [text for study in studies for text in unnoticed(study, found)]
    lost = sum(int((~study.converged).sum()) for study in studies)
    fits = sum(study.converged.size for study in studies)
    said.append(
        f"All {fits} fits converged."
        if not lost
        else f"{lost} of {fits} fits did not converge; they are counted like all others."
    )
    return tuple(said)


def width(found: tuple[Cell, ...]) -> str:
    """Coverage of the believed region, and its size relative to a ball that needs no model."""
    radii = {(c.truth, c.model, c.statement): c.radius for c in found}
    made = [c for c in found if c.statement == BELIEVED and not c.refused]
    if not made:
        return "Nothing is believed on any of these robots."
    part = [c.radius / radii[c.truth, c.model, "conformal"] for c in made]
    low, high = (percent(value) for value in (min(part), max(part)))
    of = low if low == high else f"{low.removesuffix(f'{NARROW}%')} to {high}"
    return (
        f"The believed region contains {span([c.share.value for c in made])} of the true points, "
        f"depending on kind and model; its radius is {of} of that of the ball, which includes the "
        "measuring noise."
    )


def climbing(studies: tuple[CoverageStudy, ...]) -> str:
    """Share of robots on which the evidence supports the extended model."""
    kinds: dict[str, list[str]] = {}
    for study in studies:
        kinds.setdefault(percent(float(study.extended.mean())), []).append(study.truth)
    each = " and on ".join(f"{share} of {listed(truths)}" for share, truths in kinds.items())
    return f"The evidence asks for the extended model on {each} robots."


def obeyed(studies: tuple[CoverageStudy, ...]) -> str:
    """Coverage for users who follow the program's advice."""
    each = []
    for study in studies:
        mean, (_, without) = advised(study), followed(study)
        nothing = f", no region on {counted(without, 'robot')}" if without else ""
        if mean is not None:
            each.append(f"{attained_share(mean)} ({study.truth}{nothing})")
        else:
            each.append(f"no region ({study.truth})")
    return (
        "If you use the chosen model and believe its region wherever one is stated, it contains "
        f"{listed(each)} of the points."
    )


def unnoticed(study: CoverageStudy, found: tuple[Cell, ...]) -> tuple[str, ...]:
    """Robots on which the chosen model's parameters fall short without any test showing it."""
    chosen = int(study.extended.mean() > 0.5)
    short = any(
        (cell.truth, cell.model, cell.statement) == (study.truth, MODELS[chosen], "model")
        and not cell.believable
        for cell in found
    )
    quiet = ~study.flagged[chosen]
    if not (short and quiet.any()):
        return ()
    alone, region = (
        float(study.inside[chosen, STATEMENTS.index(name), quiet].mean())
        for name in ("model", BELIEVED)
    )
    return (
        f"No test can detect everything: on {percent(float(quiet.mean()))} of {study.truth} robots "
        "no test contradicts the parameters alone of the chosen model, and these contain "
        f"{share_of(alone)} there; the believed region contains {share_of(region)}.",
    )


def procedure(campaign: Campaign) -> str:
    """How the study was made."""
    study, trial = STUDY.of(campaign)[0], campaign.trials[0]
    validation = campaign.scenario.table(CoverageSettings).validation_poses
    return (
        f"{counted(study.before.size, 'robot')} of each kind were drawn and calibrated with the "
        f"{counted(len(trial.selection), 'pose')} of {trial.name}, one visit each. On each robot "
        f"{validation} validation poses were measured, and its noise-free tool point was compared "
        f"with what is stated at {study.judged} further poses. Both were drawn anew for each "
        "robot, as is the pool, and none is in the pool. Robots of all kinds come from the same "
        "random numbers and meet the same noise and poses, except for those that are measured and "
        "used in parts. The geometric model has every free number that can be told apart, without "
        "a prior; the extended model adds sag and harmonics, all under the weak prior. All poses "
        "of a robot share its parameter error, so a robot counts once: bands are Student's t over "
        "robots, and no narrower than independent poses would make them."
    )


def numbers_sentence(check: NumbersCheck) -> str:
    """Whether the intervals of the numbers contain their true values as stated."""
    f = len(check.names)
    verdict = "as stated" if check.passed else "NOT as stated"
    return (
        f"On {check.truth} robots the geometric model can hold the truth, and its {f} numbers are "
        f"{verdict}: intervals, their joint error (NEES) and the ranks of the true values were "
        "tested."
    )


def span(shares: list[float]) -> str:
    """Smallest and largest of some shares in words."""
    low, high = share_of(min(shares)), share_of(max(shares))
    return low if low == high else f"{low.removesuffix(f'{NARROW}%')} to {high}"


def span_of(radii: list[float]) -> str:
    """Smallest and largest of some lengths [m], in um, the unit left to the sentence."""
    low, high = (micrometres(value, 2) for value in (min(radii), max(radii)))
    return low if low == high else f"{low} to {high}"


def answer(campaign: Campaign) -> Answer:
    """The first screen: whether the believed region keeps its promise, and which others do not."""
    studies = STUDY.of(campaign)
    found = cells(studies)
    made = [cell for cell in found if cell.statement == BELIEVED and not cell.refused]
    short = {cell.truth for cell in made if not cell.believable}
    alone = {cell.truth for cell in found if cell.statement == "model" and not cell.believable}
    judged, told = {cell.truth for cell in made}, all(cell.kept for cell in made)
    kinds = f"{len(judged)} kind{'s' if len(judged) > 1 else ''} of robots"
    if short:
        mark = f"✗ The believed region falls short on {len(short)} of {kinds}"
    elif not made:
        mark = "? Nothing is believed on any of these robots, so no promise was judged"
    elif not told:
        mark = "? Too few robots to tell whether the believed region keeps its promise"
    else:
        mark = f"✓ The believed region falls short on none of {kinds}"
        mark += f"; parameters alone on {len(alone)}"
    reasons = tuple(map(plain, consequences(studies, found)))
    sentence = plain(believable_sentence(found))
    return Answer(
        Verdict(bool(made) and told, bool(short), sentence, reasons, mark),
        summary_table(studies),
        "In a run of your own let the evidence choose the model ([identification] model = "
        '"choose"), measure 19 held-out poses or more, drawn from where the robot is used, and '
        "believe the region.",
    )
