"""What scenes/README.md says of the believed region with the model that the readings choose."""

import re

import numpy as np
import pytest

from testbed.assets import scenes
from testbed.store.kept import each_row
from testbed.studies.coverage.settings import DEFAULT, KINDS
from testbed.studies.coverage.study import BELIEVED, STATEMENTS, STUDY
from testbed.studies.coverage.summary import advised
from tests.reported import played

README = (scenes() / "README.md").read_text(encoding="utf-8")
SECTION = README.partition("### `coverage`\n")[2].partition("\n### ")[0]
ROWS = {
    kind: [cell.strip() for cell in cells.split("|")]
    for kind, cells in re.findall(r"^\| (\w+) \|(.*)\|$", SECTION, flags=re.MULTILINE)
}
"""Region, parameters alone, conformal radius, ratio of the radii, places; of each kind."""
SEEDS = (1, 2, 3)


def ends(cell):
    """Smallest and largest number of a cell, which has one where both are alike."""
    found = [float(number) for number in re.findall(r"[\d.]+", cell)]
    return [found[0], found[-1]] if found else []


def figures(kind, seed):
    """The five figures of a kind at a seed; the first and the fourth are None where refused."""
    few = {"coverage.robots": 40 if kind in DEFAULT else 24}
    tracker = {"tracker.preset": "at960"} if kind == "hidden" else {}
    made = played("coverage", {"seed": seed, "coverage.truths": [kind]} | few | tracker)
    (study,) = STUDY.of(made)
    robots = np.arange(study.before.size)
    model = study.extended.astype(np.int64)
    inside, radius = (
        dict(
            zip(STATEMENTS, np.stack(list(each_row(study, name)))[model, :, robots].T, strict=True)
        )
        for name in ("inside", "radius")
    )
    told = study.believed[model, robots]
    region = advised(study)
    return (
        None if region is None else 100 * region.value,
        100 * inside["model"].mean(),
        100 * inside["conformal"].mean(),
        radius[BELIEVED][told > 0].mean() / radius["conformal"][told > 0].mean()
        if told.any()
        else None,
        100 * told.mean(),
    )


def test_the_rows_are_those_of_kinds_that_can_be_played():
    assert set(DEFAULT) < set(ROWS) < set(KINDS)
    assert all(len(cells) == 5 for cells in ROWS.values())


def test_what_the_first_page_says_of_six_kinds_is_what_the_rows_say():
    first = (scenes().parent / "README.md").read_text(encoding="utf-8")
    (said,) = re.findall(
        r"the\s+region contained the true point(.*?)\(means", first, flags=re.DOTALL
    )
    region, alone = ([number for kind in DEFAULT for number in ends(ROWS[kind][k])] for k in (0, 1))
    numbers = [float(number) for number in re.findall(r"[\d.]+", said)]
    assert numbers[:2] == [min(region), max(region)]
    assert numbers[2:] == [round(min(alone)), round(max(alone))]


@pytest.mark.study
@pytest.mark.parametrize("kind", ROWS)
def test_the_row_of_a_kind_comes_out_again(kind):
    found = [figures(kind, seed) for seed in SEEDS]
    for k, cell in enumerate(ROWS[kind]):
        values = [one[k] for one in found]
        if not ends(cell):
            assert values == [None] * len(SEEDS), cell
            continue
        step = 0.01 if k == 3 else 1.0 if k == 4 else 0.1  # the last digit printed
        assert ends(cell) == pytest.approx([min(values), max(values)], abs=0.51 * step), cell
