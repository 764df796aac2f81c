"""Pages of the scenes that ship: made from their files, scenes/README.md and tests/golden.

``<!-- scenes: -->`` becomes the table of them all.
"""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

from testbed.assets import scene_names
from testbed.report.plots import TICKS, log_ticks
from testbed.studies import load_scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
README = (ROOT / "scenes" / "README.md").read_text(encoding="utf-8")
SPREAD: dict[str, dict[str, list[float]]] = json.loads(
    (ROOT / "tests" / "golden" / "spread.json").read_text(encoding="utf-8")
)
"""Figures of the scenes at seeds 1 to 5."""
ALL = "<!-- scenes: -->"
QUESTIONS = {
    "quick": "How much better does a calibration make a robot, and does it know how good it is?",
    "iiwa": "Does it work on an arm with seven axes?",
    "wen2022": "What did the campaign of Wen et al. 2022 show, and what could it not see?",
    "wen2022_moving": "And if the arm bends, rubs and vibrates, as real arms do?",
    "position_only": "What can be found with a single reflector, without any angle?",
    "stations": "What do further stations, reflectors and distances add, and what must they find?",
    "pose_sets": "Which way of choosing poses is best on robots that sag and wobble?",
    "pose_sets_rigid": "Which way of choosing poses is best if the model is right?",
    "coverage": "Which of the uncertainties that one could state really contains the truth?",
    "million": "Which stated uncertainty contains the truth, counted to a tenth of a percent?",
    "wen2022_reexamined": "Do the paper's claims hold for more than one robot?",
    "compensate": "Do corrected targets make a robot more accurate in a test after ISO 9283?",
    "plan_tx60": "Which poses, how many, from which station, for a tool point known to U = 32 µm?",
}
"""What each scene answers."""
PICTURES = {
    "coverage": (r"believed region$|parameters alone$", "true points inside [%]", 95.0),
    "compensate": (r"before$|after, ", "AP [µm]", None),
    "pose_sets": (r"poses$", "true error against random sets [%]", 0.0),
    "pose_sets_rigid": (r"poses$", "true error against random sets [%]", 0.0),
    "wen2022_reexamined": (r"points inside type A$", "true points inside type A [%]", 95.0),
}
"""Figures that a picture shows, what they are, and where a line helps."""
OF_ONE_CAMPAIGN = (r"^mean held-out error before|^after, |^believed radius", "µm", None)


def played(name: str) -> tuple[str, str]:
    """What a scene plays, and what comes out at the seed in its file, from scenes/README.md."""
    (row,) = re.findall(rf"^\| `{name}` \| (.*) \| (.*) \|$", README, flags=re.MULTILINE)
    return row


def at_five_seeds(name: str) -> str:
    """What scenes/README.md has of it at five seeds; empty where there is nothing."""
    found = re.search(rf"^### `{name}`\n(.*?)(?=^##|\Z)", README, flags=re.MULTILINE | re.DOTALL)
    return "" if found is None else found[1].strip()


def page(name: str) -> str:
    """The page of one scene."""
    plays, result = played(name)
    verb = "plan" if name.startswith("plan") else "run"
    parts = [
        f"# `{name}`", f"**{QUESTIONS[name]}**",
        f"{plays[:1].upper()}{plays[1:]}. At the seed in its file: {result}.",
        f"```sh\ntruebed {verb} {name}\n```",
    ]  # fmt: skip
    if name in SPREAD:
        seen = PICTURES.get(name, OF_ONE_CAMPAIGN)[1]
        parts += [
            f"::::{{container}} drawn\n```{{image}} /_pictures/scene-{name}.png\n:class: figure\n"
            f":alt: {seen} of {name} at five seeds, one dot each\n```\n::::",
            "One dot for each of the seeds 1 to 5.",
        ]
    if text := at_five_seeds(name):
        parts += ["## At five seeds", text]
    parts += [
        "## The file",
        f"Keys: {{doc}}`/formats/scenario`. `truebed scenes {name}` prints all of them.",
        f"```{{literalinclude}} ../../scenes/{name}.toml\n:language: toml\n```",
    ]
    return "\n\n".join(parts) + "\n"


def overview() -> str:
    """All scenes, one line each."""
    lines = ["| scene | question | robot |", "|---|---|---|"]
    lines += [
        f"| {{doc}}`{name}` | {question} | {load_scenario(name).robot} |"
        for name, question in QUESTIONS.items()
    ]
    hidden = ["", "```{toctree}", ":hidden:", "", *QUESTIONS, "```"]
    return "\n".join(lines + hidden)


def draw(name: str, into: Path) -> None:
    """Figures of a scene at five seeds, one dot each."""
    from matplotlib.figure import Figure

    pattern, label, line = PICTURES.get(name, OF_ONE_CAMPAIGN)
    rows = {
        row.partition(": five")[0].replace("`", ""): values
        for row, values in SPREAD[name].items()
        if re.search(pattern, row.partition(": five")[0])
    }
    figure = Figure(figsize=(7.0, 0.9 + 0.26 * len(rows)), layout="constrained")
    axes = figure.add_subplot()
    for place, (row, values) in enumerate(sorted(rows.items(), key=_order)):
        factor = 1e3 if label == "µm" and "radius" not in row else 1.0  # errors are in mm there
        axes.plot([factor * value for value in values], [place] * len(values), "o", color="#0072b2",
                  alpha=0.7, markersize=5, markeredgecolor="none")  # fmt: skip
    _finish(axes, [row for row, _ in sorted(rows.items(), key=_order)], label, line)
    figure.savefig(into, dpi=100)


def _order(item: tuple[str, list[float]]) -> tuple[int, str]:
    """What was before comes first, a radius last."""
    row = item[0]
    return (0 if "before" in row else 2 if "radius" in row else 1), row


def _finish(axes: "Axes", names: list[str], label: str, line: float | None) -> None:
    """Names, axis and line."""
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel(f"{label}, logarithmic" if line is None else label, fontsize=9)
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    if line is None:
        axes.set_xscale("log")
        low, high = axes.get_xlim()
        low = 0.95 * max(tick for tick in TICKS if tick <= low)
        high = 1.05 * min(tick for tick in TICKS if tick >= high)
        axes.set_xlim(low, high)
        log_ticks(axes.xaxis, low, high)
    else:
        axes.axvline(line, color="#444444", linewidth=1)


def _write(app: "Sphinx") -> None:
    """Pages and pictures, where they are not yet or have changed."""
    for name in scene_names():
        there, text = Path(app.srcdir, "scenes", f"{name}.md"), page(name)
        if not there.is_file() or there.read_text(encoding="utf-8") != text:
            there.write_text(text, encoding="utf-8")
        picture = Path(app.srcdir, "_pictures", f"scene-{name}.png")
        if name in SPREAD and not picture.is_file():
            picture.parent.mkdir(exist_ok=True)
            draw(name, picture)


def _filled(_app: "Sphinx", _page: str, source: list[str]) -> None:
    """The table of all scenes where a page asks for it."""
    if ALL in source[0]:
        source[0] = source[0].replace(ALL, overview())


def setup(app: "Sphinx") -> dict[str, bool]:
    """Write before pages are looked for, and listen to their reading."""
    app.connect("builder-inited", _write)
    app.connect("source-read", _filled)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
