"""The report's section on many robots: which pose set is better, with confidence intervals."""

from testbed.report.page import Points, Section, Table, Text, table_of
from testbed.studies.over_robots import log_ratio_over_robots, mean_over_robots, percent_of
from testbed.studies.pose_sets.compare import (
    Contest,
    PopulationStudy,
    contest_of,
    population_of,
    random_partner,
    rms,
)
from testbed.studies.trial.records import Campaign
from testbed.studies.trial.report_accuracy import set_in_words
from testbed.units import Mean, counted, millimetres, percent


def population_section(campaign: Campaign) -> Section | None:
    """Every trial on many robots, compared in pairs with the random set of the same size."""
    study = population_of(campaign)
    if study is None or study.before.size < 2:
        return None
    count = study.before.size
    text = (
        f"Every pose set was measured once on {count} further robots, drawn like the true one. All "
        "sets were used on the same robots, and a random set was drawn anew for each. Intervals "
        "are 95 % confidence intervals over robots; those in sentences hold all at once "
        "(Bonferroni). Poses of one robot share its parameter error, so a robot counts once."
    )
    return Section(
        "robots",
        "Many robots",
        (Text(text), error_table(campaign, study), Points(sentences(contest_of(campaign)))),
        part="detail",
    )


def error_table(campaign: Campaign, study: PopulationStudy) -> Table:
    """Mean held-out error over robots, per trial and estimator."""
    modes = campaign.scenario.identification.estimators
    rows = []
    for i, trial in enumerate(campaign.trials):
        partner = random_partner(campaign, trial)
        for j, mode in enumerate(modes):
            errors, ratio = study.mean_error[i, j], "–"
            if partner is not None and partner is not trial:
                other = study.mean_error[study.trials.index(partner.name), j]
                ratio = ratio_in_words(log_ratio_over_robots(errors, other))
            mean = mean_over_robots(errors)
            error, u = rms(study.rms_error[i, j]), rms(study.stated_u[i, j])
            rows.append(
                {
                    "trial": trial.name if j == 0 else "",
                    "pose set": set_in_words(trial) if j == 0 else "",
                    "estimator": "default" if mode == "whitened" else mode,
                    "mean error mm": f"{millimetres(mean.value)} ± "
                    f"{millimetres(mean.half_width, 2)}",
                    "against random": ratio,
                    "rms mm": millimetres(error),
                    "stated u mm": millimetres(u),
                    "rms / u": f"{error / u:.2f}",
                    "inside 95 %": percent(float(study.inside[i, j].mean())),
                }
            )
    return table_of(
        rows,
        f"Held-out error of each pose set over {counted(study.before.size, 'robot')}",
        align="lllrrrrrr",
        size="small",
        note="against random: geometric mean over robots of the ratio to the random set of the "
        "same size, minus one. stated u: root mean square of the stated 3-D standard uncertainty; "
        "a correct statement has rms / u = 1.",
    )


def sentences(contest: Contest) -> tuple[str, ...]:
    """Result for each designed set by the default estimator, also where it is worse."""
    said = []
    for entry in contest.entries:
        if entry.joint is None:
            continue
        name, partner = entry.trial.name, contest.reference(entry.poses).trial.name
        wins = f"{round(entry.wins * contest.robots)} of {contest.robots} robots"
        tail = f"({ratio_in_words(entry.joint)}; smaller error on {wins})"
        if entry.outcome == "undecided":
            said.append(f"{name} and {partner} cannot be told apart {tail}.")
        else:
            said.append(f"{name} is {entry.outcome} than {partner} {tail}.")
    return tuple(said) or ("No random set of the same size to compare with.",)


def ratio_in_words(ratio: Mean) -> str:
    """A ratio from its logarithm, as a change in percent with its interval."""
    middle, low, high = percent_of(ratio)
    return f"{middle:+.0f} % ({low:+.0f} to {high:+.0f} %)"
