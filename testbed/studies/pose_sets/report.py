"""The report's section on many pose sets: which is best, by how much, and how certain that is."""

from typing import get_args

from testbed.report.page import Block, Figure, Points, Section, Table, Text, Verdict, table_of
from testbed.report.svg import on_phone
from testbed.studies.over_robots import CONFIDENCE, Outcome, percent_of
from testbed.studies.pose_sets.compare import Contest, Entry, contest_of, population_of
from testbed.studies.pose_sets.plots import forest, kinds
from testbed.studies.protocol import Answer
from testbed.studies.trial.plots import MOST_VIEWS, only
from testbed.studies.trial.records import Campaign, Trial
from testbed.studies.trial.report_accuracy import NONE
from testbed.studies.trial.verdict import trial_verdict
from testbed.units import counted, fixed, micrometres, millimetres, percent, plain


def pose_sets_section(campaign: Campaign) -> Section:
    """Procedure, results, a table for each size, and the forest plot."""
    contest = contest_of(campaign)
    blocks: list[Block] = [
        Text(procedure(campaign, contest)),
        Points(in_short(contest)),
        Figure(
            "Mean held-out error of each set against random sets of the same size, over "
            f"{counted(contest.robots, 'robot')}. Thick: 95 % interval of this comparison; thin: "
            f"interval for all {contest.comparisons} comparisons at once. Blue dots: better; "
            "vermilion triangles: worse; open squares: cannot be told apart"
            f"{only(contest.sizes, MOST_VIEWS)}.",
            forest(contest),
            phone=on_phone(forest, contest),
        ),
    ]
    blocks += [size_table(contest, poses) for poses in contest.sizes]
    return Section("pose-sets", "Which pose set is best?", tuple(blocks), part="answer")


def procedure(campaign: Campaign, contest: Contest) -> str:
    """How the comparison was made."""
    held_out = counted(len(campaign.setting.test_q), "held-out pose")
    return (
        f"Every pose set was measured once on {counted(contest.robots, 'further robot')}, drawn "
        "like the true one, and judged by its mean tool error against the truth on "
        f"{held_out}. All sets were used on the same robots, so they are compared in pairs. A "
        "random set was drawn anew for each robot. A designed set is one set, chosen on the "
        "nominal robot: results apply to this set from this pool. Intervals are confidence "
        "intervals over robots (Student's t on the logarithm of the ratio). The tables give each "
        "95 % interval by itself; better and worse are decided by joint intervals, which all hold "
        f"at once with 95 % probability (Bonferroni, {counted(contest.comparisons, 'comparison')})."
    )


def in_short(contest: Contest) -> tuple[str, ...]:
    """The results in words, the most general first."""
    rivals = [entry for entry in contest.entries if entry.ratio is not None]
    number = {o: sum(entry.outcome == o for entry in rivals) for o in get_args(Outcome)}
    said = [
        f"Of {counted(len(rivals), 'chosen set')} {number['better']} are better than random ones "
        f"of their size, {number['worse']} are worse and {number['undecided']} undecided."
    ]
    said += [sentence(entry, contest) for entry in rivals if entry.trial.rows == "paper"]
    said += [leader(contest, poses) for poses in contest.sizes]
    return (*said, source(contest))


def leader(contest: Contest, poses: int) -> str:
    """The best set of one size, in words."""
    shown = [entry for entry in contest.of_size(poses) if entry.outcome == "better"]
    if not shown:
        return f"With {poses} poses no set is shown to be better than random ones."
    best = sentence(shown[0], contest)
    return f"With {poses} poses the best of those shown to be better: {best[:1].lower()}{best[1:]}"


def advice(contest: Contest) -> str:
    """Which set to take, size by size."""
    best = {n: [e for e in contest.of_size(n) if e.outcome == "better"] for n in contest.sizes}
    named = [
        f"{set_name(found[0].trial)} at {poses} poses ({signed(percent_of(found[0].ratio)[0])})"
        for poses, found in best.items()
        if found and found[0].ratio is not None
    ]
    if not named:
        return (
            "No set is shown to be better than random poses: take random ones, and put the effort "
            "into the model."
        )
    sets = "; ".join(f"{name[:1].lower()}{name[1:]}" for name in named)
    text = f"Take the set shown best at your number of poses: {sets}."
    missing = [str(poses) for poses, found in best.items() if not found]
    return text + (f" At {', '.join(missing)} poses random ones are as good." if missing else "")


def source(contest: Contest) -> str:
    """Whether noise or model error dominates the remaining error."""
    largest = contest.reference(contest.sizes[-1])
    noise, model = (millimetres(value, 2) for value in (largest.noise, largest.model))
    after = f"after {largest.poses} random poses"
    if not largest.model:
        return (
            f"Noise explains the whole error ({after}: rms {noise} mm), so a set with a smaller "
            "promised u is more accurate."
        )
    if largest.model <= largest.noise:
        return f"Noise contributes {noise} mm rms {after}, errors outside the model {model} mm."
    return (
        f"Errors outside the model contribute {model} mm rms {after}, noise only {noise} mm. The "
        "promised u counts noise alone: here it does not show which set is better, and another set "
        "of the same kind, as good by its criterion, may differ by several percent."
    )


def sentence(entry: Entry, contest: Contest) -> str:
    """One comparison in words, with its joint interval."""
    assert entry.joint is not None, "the random set has nothing to be compared with"
    middle, low, high = percent_of(entry.joint)
    who, rivals = f"{set_name(entry.trial)} of {entry.poses}", f"random sets of {entry.poses}"
    tail = f"smaller error on {percent(entry.wins)} of {counted(contest.robots, 'robot')}"
    if entry.outcome == "undecided":
        return (
            f"{who} and {rivals} cannot be told apart ({signed(middle)}, joint 95 % CI "
            f"{signed(low)} to {signed(high)}; {tail})."
        )
    if entry.outcome == "better":
        middle, low, high = -middle, -high, -low
    return (
        f"{who} is {fixed(middle, 1)} % {entry.outcome} than {rivals} (joint 95 % CI "
        f"{fixed(low, 1)} to {fixed(high, 1)} %; {tail})."
    )


def set_name(trial: Trial) -> str:
    """A designed set in words, at the start of a sentence."""
    criterion = trial.selection.criterion
    if trial.method == "detmax" and trial.rows == "paper":
        return f"The paper's {criterion} set"
    if trial.method == "best_of_random":
        return f"The best of {len(trial.selection.trace)} random sets by {criterion}"
    return f"The {criterion} set by {trial.method}"


def signed(change: float) -> str:
    """A change in percent with its sign."""
    text = fixed(change, 1)
    return f"{text if text.startswith('−') else '+' + text} %"


def size_table(contest: Contest, poses: int) -> Table:
    """Every set of one size, best first."""
    rows, strong = [], []
    for k, entry in enumerate(contest.of_size(poses)):
        error = f"{millimetres(entry.error.value)} ± {millimetres(entry.error.half_width, 2)}"
        against, word, wins = "the reference", NONE, NONE
        if entry.ratio is None:
            strong = [k]
        else:
            middle, low, high = percent_of(entry.ratio)
            against = f"{signed(middle)} ({fixed(low, 1)} to {fixed(high, 1)})"
            word, wins = entry.outcome, percent(entry.wins)
        method, criterion = chosen_by(entry.trial)
        rows.append(
            {
                "set": entry.trial.name,
                "chosen by": method,
                "criterion": criterion,
                "promised u µm": micrometres(entry.goal_u),
                "efficiency": NONE if entry.efficiency is None else floored(entry.efficiency),
                "mean error mm": error,
                "against random": against,
                "result": word,
                "wins": wins,
                "noise mm": millimetres(entry.noise, 2),
                "model mm": millimetres(entry.model, 2) if entry.model else "0",
            }
        )
    return table_of(
        rows,
        f"Sets of {counted(poses, 'pose')}, best first",
        align="lllrrrrlrrr",
        size="small",
        strong=tuple(strong),
        note=""
        if poses != contest.sizes[-1]
        else "promised u: RMS over the goal poses of the predicted 3-D standard uncertainty of the "
        "tool point (k = 1), from the nominal robot and the stated noise. criterion: in whitened "
        "rows unless it says paper rows (12 unweighted ones, mm and rad). efficiency: certified "
        "part of the best possible figure of its own criterion; no bound for O2, O4, O5. mean "
        f"error: over robots, {percent(CONFIDENCE)} interval. against random: geometric mean over "
        "robots of the ratio of errors, minus one, with its paired 95 % interval. wins: share of "
        "robots with a smaller error than with the random set. noise, model: rms error split into "
        "the part that the stated u explains and the rest; 0 if no rest is significant.",
    )


def chosen_by(trial: Trial) -> tuple[str, str]:
    """Method and criterion of a set, for a table."""
    if trial.method == "random":
        return "random", NONE
    rows = ", paper rows" if trial.rows == "paper" else ""
    return trial.method.replace("_", " "), f"{trial.selection.criterion}{rows}"


def floored(efficiency: float) -> str:
    """A certified efficiency, rounded down so that the statement remains true."""
    return f"{int(efficiency * 1000) / 1000:.3f}"


def summary_table(campaign: Campaign) -> Table:
    """The table of the first screen: each kind of set against random ones, a column per size."""
    contest, study = contest_of(campaign), population_of(campaign)
    assert study is not None, "a contest has a population"
    return Table(
        caption="Mean tool error on held-out poses against random sets of the same size, over "
        f"{counted(contest.robots, 'robot')}",
        head=("pose set", *(f"{poses} poses" for poses in contest.sizes)),
        rows=tuple(
            (name, *(cell(row.get(poses)) for poses in contest.sizes))
            for name, row in kinds(contest).items()
        ),
        note="better, worse: by intervals that all hold at once with 95 % probability "
        f"({counted(contest.comparisons, 'comparison')}); neither word: cannot be told apart. "
        "random: its mean error, before calibration "
        f"{millimetres(float(study.before.mean()))} mm.",
    )


def cell(entry: Entry | None) -> str:
    """One comparison in a table."""
    if entry is None:
        return NONE
    if entry.ratio is None:
        return f"{millimetres(entry.error.value)} mm"
    word = "" if entry.outcome == "undecided" else f"{entry.outcome} "
    return f"{word}{signed(percent_of(entry.ratio)[0])}"


def answer(campaign: Campaign) -> Answer:
    """How many chosen pose sets beat random ones; the stated uncertainty comes last."""
    contest, own = contest_of(campaign), trial_verdict(campaign)
    first, *rest = in_short(contest)
    rivals = [entry.outcome for entry in contest.entries if entry.ratio is not None]
    better, worse = rivals.count("better"), rivals.count("worse")
    mark = f"{'✓' if better > worse else '✗'} {better} of {len(rivals)} chosen pose sets beat "
    mark += f"random ones of their size, {worse} are worse"
    said = tuple(plain(text) for text in (*rest, own.sentence))
    verdict = Verdict(own.believable, own.contradicted, plain(first), said, mark)
    return Answer(verdict, summary_table(campaign), advice(contest))
