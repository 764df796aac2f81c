"""The report's section on the secret: what makes the robot wrong."""

from testbed.report.page import Section, Table, Text
from testbed.studies.trial.records import Campaign
from testbed.units import millimetres

MEANINGS = {
    "geometry": "link lengths, offsets and angles",
    "frames": "base and tool placement",
    "gravity": "joints that sag under the arm's own weight",
    "harmonics": "gear errors, once and twice a turn",
    "high_harmonics": "gear errors, three and seven times a turn",
    "transmission": "gear errors of many waves a turn",
    "encoder": "errors between two lines of the encoders",
    "gear": "gear errors, once and twice a turn of the motor",
    "backlash": "play of the gears",
    "thermal": "links that grow warm",
    "elastic": "drives and links that give way under load",
    "motion": "friction, and swinging after a move, beyond the arm at rest",
    "repeatability": "scatter from approach to approach",
}
"""What each term of the truth stands for."""


MOST_IN_WORDS = 4
"""Terms and their sum that are not tabulated but told."""


def secret_section(campaign: Campaign) -> Section:
    """How far each term of the truth alone moves the tool."""
    validation = campaign.validation
    sizes = zip(validation.terms, validation.term_rms, strict=True)
    rows = [
        (term, MEANINGS.get(term, ""), millimetres(float(rms)))
        for term, rms in sorted(sizes, key=lambda pair: -pair[1])
    ]
    rows.append(("all together", "", millimetres(validation.together_rms)))
    table = Table(
        caption="Tool displacement by each term of the truth alone",
        head=("term", "what it is", "rms mm"),
        rows=tuple(rows),
        align="llr",
        strong=(len(rows) - 1,),
        note="True minus nominal tool position, root mean square over the held-out poses. The "
        "terms add as vectors; all together differ from their sum by "
        f"{millimetres(validation.interaction_rms, 2)} mm.",
    )
    return Section(
        "secret",
        "The secret: what makes this robot wrong",
        (Text(secret_words(rows)), *((table,) if len(rows) > MOST_IN_WORDS else ())),
        part="campaign",
    )


def secret_words(rows: list[tuple[str, str, str]]) -> str:
    """The largest term in words; what a model without it cannot follow."""
    if len(rows) == 1:
        return "Nothing: the true robot is the nominal one."
    name, meaning, size = rows[0]
    whole, how = rows[-1][2], "All" if size == rows[-1][2] else "Most"
    # terms add as vectors: one alone may be larger than all together
    of = f"{size} mm" if size == whole else f"alone {size} mm, all terms together {whole} mm"
    text = (
        f"{how} of this robot's error is {name.replace('_', ' ')} ({meaning}): {of} (rms at the "
        "held-out poses)."
    )
    unmodelled = [row for row in rows[:-1] if row[0] not in ("geometry", "frames", "repeatability")]
    if not unmodelled:
        return f"{text} A geometric model can describe all of it."
    texts = ", ".join(f"{row[0].replace('_', ' ')} {row[2]} mm" for row in unmodelled)
    return f"{text} A geometric model cannot describe these: {texts}."
