"""Figures of the shipped scenes at full size and five seeds, as scenes/README.md states them.

``python -m tests.golden.spread [SCENE...] [--runs DIR]`` plays each scene at every seed, an hour in
all, and writes them down in spread.json and in scenes/README.md; a run folder that lies in DIR
already is read instead. The seeds are 1 to 5 for every scene, so that none is chosen.
"""

import argparse
import json
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
FILE = HERE / "spread.json"
README = HERE.parents[1] / "scenes" / "README.md"
SEEDS = (1, 2, 3, 4, 5)
FEWER: dict[str, dict[str, Any]] = {"coverage": {"coverage.robots": 40}}
"""What is played less often than the scene plays it: five seeds make up for it."""
WHITENED = "trials/{}/estimates/whitened"
PERCENT, UM = 100.0, 1000.0


@dataclass(frozen=True)
class Figure:
    """One published number: its place in the table and in result.json, and how it is printed."""

    row: str
    path: str
    digits: int
    unit: str = ""
    factor: float = 1.0
    shift: float = 0.0
    column: str = "five seeds: mean (smallest to largest)"

    @property
    def words(self) -> str:
        """Name of the figure among those of its scene."""
        return f"{self.row}: {self.column}"

    def of(self, result: dict[str, Any]) -> float:
        """The number of one campaign, in its unit; True counts as 1."""
        value: Any = result
        for name in self.path.split("/"):
            value = value[name]
        return self.factor * float(value) + self.shift

    def printed(self, values: list[float]) -> str:
        """Mean, and smallest to largest unless all are alike."""
        mean, low, high = (
            f"{round(value, self.digits) + 0.0:.{self.digits}f}"  # no minus before a zero
            for value in (float(np.mean(values)), min(values), max(values))
        )
        return f"{mean}{self.unit}" if low == high else f"{mean} ({low} to {high}){self.unit}"


def errors(*trials: str, digits: int = 4) -> Iterator[Figure]:
    """Mean held-out errors of the default estimator, before once and after for each trial."""
    before = f"{WHITENED.format(trials[0])}/held_out_before/mean_mm"
    yield Figure("mean held-out error before", before, 3, " mm")
    for trial in trials:
        after = f"{WHITENED.format(trial)}/held_out_after/mean_mm"
        yield Figure(f"after, `{trial}`", after, digits, " mm")


def believed(*trials: str, mode: str = "whitened") -> Iterator[Figure]:
    """Share of the seeds at which a trial's statement is believable."""
    whose = "default" if mode == "whitened" else "paper's"
    for trial in trials:
        path = f"trials/{trial}/estimates/{mode}/believable"
        yield Figure(f"{whose} statement believable, `{trial}`", path, 0, " %", PERCENT)
        if mode == "whitened":
            path = f"trials/{trial}/estimates/{mode}/statement"
            yield Figure(f"believed radius R95, `{trial}`", f"{path}/R95_mean_um", 0, " µm")
            inside = f"{path}/statements/region/attained"
            row = f"true points inside the believed region, `{trial}`"
            yield Figure(row, inside, 1, " %", PERCENT)


def covered() -> Iterator[Figure]:
    """Attained coverage of 95 % statements, by kind of robot and model."""
    for model in ("geometric", "extended"):
        for kind in ("rigid", "wen2022", "soft", "elastic", "unmodelled"):
            row, place = f"{kind}, {model} model", f"coverage/truths/{kind}/{model}"
            for column, name, digits in (
                ("believed region", "region/inside", 1),
                ("parameters alone", "model/inside", 1),
                ("with discrepancy", "discrepancy/inside", 1),
                ("within the conformal radius", "conformal/inside", 1),
            ):
                path = f"{place}/{name}"
                yield Figure(row, path, digits, " %", PERCENT, column=column)


def compensated() -> Iterator[Figure]:
    """Pose accuracy of ISO 9283 before and after, by kind of robot."""
    for kind in ("rigid", "wen2022", "elastic"):
        place = f"compensation/truths/{kind}"
        for column, state in (
            ("median AP before", "before"),
            ("after, geometric model", "geometric"),
            ("after, chosen model", "chosen"),
        ):
            path = f"{place}/{state}/AP/median_mm"
            yield Figure(kind, path, 1, " µm", UM, column=column)
        yield Figure(
            kind, f"{place}/chosen/robots_better", 0, column="robots of 40 that are better"
        )


def contests() -> Iterator[Figure]:
    """Error of each kind of designed set against random sets of its size."""
    for kind in ("paper-o1", "paper-o2", "d", "a", "v", "e", "greedy", "best-of-random"):
        for poses in (15, 29, 61):
            path = f"population/trials/{kind}-{poses}/against_random/error_ratio"
            yield Figure(f"`{kind}`", path, 1, " %", PERCENT, -PERCENT, f"{poses} poses")


def campaign_of_the_paper() -> Iterator[Figure]:
    """The paper's figures on one robot."""
    yield from errors("best-61", "random-61", "best-29", "random-29", digits=3)
    for trial, poses in (("best-61", 61), ("best-29", 29)):
        place = f"random_calibrations/{trial}/paper"
        yield Figure(f"paper's estimator, `{trial}`", f"{place}/held_out_mm", 3, " mm")
        row = f"paper's estimator, mean of 100 random sets of {poses}"
        yield Figure(row, f"{place}/random_held_out_mean_mm", 3, " mm")
        yield Figure(f"random sets of 100 that `{trial}` beats", f"{place}/better_than", 0)
    for trial in ("best-29", "best-61"):
        place = f"paper_budget/trials/{trial}"
        ratio, repeats = (f"{place}/mean_{u}_ratio_best_to_random" for u in ("u", "u_r"))
        yield Figure(f"Table 3's ratio, printed 0.11, `{trial}`", ratio, 2)
        yield Figure(f"repeats against repeats, `{trial}`", repeats, 2)
        inside = f"{place}/inside_95/type_a_point"
        yield Figure(f"held-out points inside type A, `{trial}`", inside, 0, " %", PERCENT)
    for trial in ("best-61", "best-29"):
        place = WHITENED.format(trial)
        region = f"{place}/held_out_inside_parameters_alone"
        row = f"held-out points inside the region of the parameters alone, `{trial}`"
        yield Figure(row, region, 0, " %", PERCENT)
        radius = f"{place}/statement/R95_mean_um"
        yield Figure(f"believed radius R95, `{trial}`", radius, 0, " µm")
        for row, name in (
            ("true points inside the believed region", "region"),
            ("true points within the conformal radius", "conformal"),
        ):
            path = f"{place}/statement/statements/{name}/attained"
            yield Figure(f"{row}, `{trial}`", path, 1, " %", PERCENT)
        yield Figure(f"chi-square per dof, `{trial}`", f"{place}/chi_square_per_dof", 1)
    for index in ("O1", "O2"):
        yield Figure(f"number of poses by {index}", f"pose_count/{index}_poses", 0)


def reexamined() -> Iterator[Figure]:
    """The paper's protocol on many robots, by kind of robot and set."""
    for kind in ("wen2022", "rigid"):
        for trial in ("best-29", "best-61"):
            row, place = f"{kind}, `{trial}`", f"reexamined/truths/{kind}"
            protocol = f"{place}/protocol/{trial}"
            yield Figure(row, f"{protocol}/ratio/value", 2, column="Table 3's ratio, printed 0.11")
            yield Figure(row, f"{protocol}/repeats/value", 2, column="repeats against repeats")
            inside = f"{place}/inside_95/{trial}/point/value"
            yield Figure(row, inside, 0, " %", PERCENT, column="points inside type A")
            error = f"{place}/error/{trial}, paper/ratio"
            column = "true error against random"
            yield Figure(row, error, 0, " %", PERCENT, -PERCENT, column)


FIGURES: dict[str, tuple[Figure, ...]] = {
    "quick": (
        *errors("designed-29", "random-29"),
        *believed("designed-29", "random-29"),
        *believed("designed-29", "random-29", mode="paper"),
    ),
    "iiwa": (*errors("designed-29", "random-29"), *believed("designed-29", "random-29")),
    "position_only": (*errors("designed-40", "random-40"), *believed("designed-40", "random-40")),
    "stations": (*errors("designed-16", "random-16"), *believed("designed-16", "random-16")),
    "wen2022": tuple(campaign_of_the_paper()),
    "wen2022_moving": (
        *errors("best-61", "random-61", "best-29", "random-29", digits=3),
        *believed("best-61", "best-29"),
    ),
    "compensate": tuple(compensated()),
    "coverage": tuple(covered()),
    "wen2022_reexamined": tuple(reexamined()),
    "pose_sets": tuple(contests()),
    "pose_sets_rigid": tuple(contests()),
}


def figures_of(scene: str, result: dict[str, Any]) -> dict[str, float]:
    """Every figure of a scene's result.json, by its words."""
    return {figure.words: figure.of(result) for figure in FIGURES[scene]}


def played(scene: str, seed: int, runs: Path) -> dict[str, Any]:
    """result.json of a scene at a seed; played into `runs` unless it lies there."""
    from testbed.run.play import play_run
    from testbed.scenario.read import changed
    from testbed.studies import load_scenario

    folder = runs / f"{scene}-{seed}"
    if not (folder / "result.json").exists():
        settings = {"seed": seed} | FEWER.get(scene, {})
        play_run(changed(load_scenario(scene), settings), folder, resume=folder.exists())
    result: dict[str, Any] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return result


def spread(scene: str, runs: Path) -> dict[str, list[float]]:
    """Every figure of a scene at every seed."""
    found = [figures_of(scene, played(scene, seed, runs)) for seed in SEEDS]
    return {words: [one[words] for one in found] for words in found[0]}


def kept() -> dict[str, dict[str, list[float]]]:
    """What was written down."""
    found: dict[str, dict[str, list[float]]] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def table(scene: str) -> str:
    """Markdown table of a scene for scenes/README.md: one row and column for each figure."""
    known, figures = kept()[scene], FIGURES[scene]
    cells = {(f.row, f.column): f.printed(known[f.words]) for f in figures}
    rows, columns = (list(dict.fromkeys(key[k] for key in cells)) for k in (0, 1))
    head = ["figure" if len(columns) == 1 else "", *columns]
    lines = [head, ["---"] * len(head)]
    lines += [[row, *(cells[row, column] for column in columns)] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def main() -> None:
    """Play, or read, and write down."""
    asked = argparse.ArgumentParser()
    asked.add_argument("scenes", nargs="*", default=list(FIGURES))
    asked.add_argument("--runs", type=Path)
    words = asked.parse_args()
    with tempfile.TemporaryDirectory() as away:
        for scene in words.scenes:
            known = kept() if FILE.exists() else {}
            known[scene] = spread(scene, words.runs or Path(away))
            text = json.dumps(known, indent=1, sort_keys=True, ensure_ascii=False)
            FILE.write_text(text + "\n", encoding="utf-8")
            readme = README.read_text(encoding="utf-8")
            before, heading, after = readme.partition(f"### `{scene}`\n")
            old = re.search(r"(\|.*\n)+", after)
            assert old is not None, f"scenes/README.md has no table of {scene}"
            after = after[: old.start()] + table(scene) + after[old.end() :]
            README.write_text(before + heading + after, encoding="utf-8")


if __name__ == "__main__":
    main()
