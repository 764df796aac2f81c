"""The session.toml of an exported campaign."""

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from calib.measurement.observations import DISTANCE, POSE, Measurements
from testbed.laboratory.tracker.of_scenario import bias_size
from testbed.laboratory.tracker.rounds import world_mm
from testbed.laboratory.truth.laboratory import Laboratory
from testbed.scenario.fixtures import RANGES, targets_mm
from testbed.scenario.laboratory import At960Tracker
from testbed.studies.trial.estimator import gear_orders
from testbed.studies.trial.records import Trial
from testbed.units import MDEG, MM, UM


def session_toml(bench: Laboratory, trial: Trial, table: Measurements) -> str:
    """What the CSV does not say."""
    scenario = bench.scenario
    wanted = scenario.identification
    free = wanted.free if isinstance(wanted.free, str) else list(wanted.free)
    kind = "frames" if table.kind[0] == POSE else "points"
    file = _text(f"{trial.name}.csv")
    visits = scenario.uncertainty.repeats
    several = bool(bench.rounds)
    return "\n".join(
        [
            "# SIMULATED - measurements of a virtual robot by a virtual tracker",
            "format = 1",
            f"name = {_text(f'{scenario.name} {trial.name}')}",
            f"robot = {_text(bench.robot.name)}",
            "simulated = true",
            "",
            "[joints]",
            *([] if several else [f"file = {file}"]),
            'source = "commanded"',
            "",
            f"[{kind}]",
            f"file = {file}",
            *(_fixture_lines(bench, trial, table, kind) if several else []),
            "",
            "[uncertainty]",
            "# the 21 columns cov_... hold what the joints scatter, too",
            'joint_repeatability = "included"',
            *_systematic_lines(bench, kind),
            *gear_lines(bench),
            "",
            "[identification]",
            'model = "geometric"',
            f"free = {_text(free)}",
            f'base = "{wanted.base}"',
            f'tool = "{wanted.tool}"',
            f'visits = "first"  # of {visits}; the others show the repeatability',
            "",
        ]
    )


def gear_lines(bench: Laboratory) -> list[str]:
    """Turns of the motors for one of the joints, where the scene states them."""
    turning = bench.robot.model.chain.prismatic == 0
    ratios = {
        f"joint{i + 1}": orders[0] for i, orders in enumerate(gear_orders(bench)) if turning[i]
    }
    return ["", "[gear]", f"ratio = {_inline(ratios)}"] if ratios else []


def _systematic_lines(bench: Laboratory, kind: str) -> list[str]:
    """What the tracker states to get wrong all campaign long, as far as readings show it."""
    settings, T = bench.scenario.tracker, bench.tracker.T_world_tracker
    if not isinstance(settings, At960Tracker) or not settings.systematic:
        return []
    size = bias_size(settings)
    turn = size.target_turn if kind == "frames" else 0.0
    parts: dict[str, ArrayLike] = {
        "range_offset_um": size.range_offset * UM,
        "scale_um_per_m": size.scale * UM,
        "encoder_amplitude_um": [part * UM for part in size.encoder] if any(size.encoder) else 0,
        "target_offset_um": size.target_offset * UM,
        "target_turn_mdeg": turn * MDEG,
        "level_mdeg": size.level * MDEG,
        "station_mm": T[:3, 3] * MM,
        "station_up": T[:3, 2],
    }
    head = "# k = 1: half widths of the scene divided by the root of 3"

    def written(value: ArrayLike) -> str:
        numbers = [float(f"{x:.15g}") for x in np.ravel(value)]  # so that 0.2 stays 0.2
        return _text(numbers if np.ndim(value) else numbers[0])

    lines = [f"{key} = {written(value)}" for key, value in parts.items() if np.any(value)]
    return ["", "[uncertainty.systematic]", head, *lines]


def _fixture_lines(bench: Laboratory, trial: Trial, table: Measurements, kind: str) -> list[str]:
    """Where reflectors and anchors are or start from, as far as rows speak of them."""
    settings, chain = bench.scenario.fixtures, bench.robot.model.chain
    assert settings is not None  # there are rounds
    seen = [one for one in bench.rounds if len(one.rows_in(table))]
    targets = {name: list(xyz) for name, xyz in targets_mm(bench.scenario).items()}
    targets = {one.target: targets[one.target] for one in seen if one.kind != POSE}
    world = world_mm(settings.anchors_mm.values(), chain).tolist()
    anchors = dict(zip(settings.anchors_mm, world, strict=True))
    anchors = {one.place: anchors[one.place] for one in seen if one.kind == DISTANCE}
    # a station is placed as the laboratory has it, not as the base frame has it
    stations = {str(one.station + 1): one.station - 1 for one in seen if one.station}
    places = world_mm(settings.stations_mm, chain).tolist()

    def places_of(known: dict[str, list[float]]) -> str:
        return _inline({n: "free" if n in settings.free else xyz for n, xyz in known.items()})

    def start_of(known: dict[str, list[float]]) -> str:
        return _inline({n: xyz for n, xyz in known.items() if n in settings.free})

    reflectors = [f"reflectors_mm = {places_of(targets)}"]
    lines = reflectors if kind == "points" else []
    if anchors:
        file = f"file = {_text(f'{trial.name}{RANGES}.csv')}"
        lines += ["", "[ranges]", file, *reflectors, f"anchors_mm = {places_of(anchors)}"]
    return [
        *lines,
        "",
        "[start]",
        "# about where those are that have to be found",
        f"reflectors_mm = {start_of(targets)}",
        f"anchors_mm = {start_of(anchors)}",
        f"stations_mm = {_inline({name: places[k] for name, k in stations.items()})}",
    ]


def _inline(table: Mapping[str, object]) -> str:
    """An inline table of TOML."""
    return f"{{ {', '.join(f'{_text(key)} = {_text(value)}' for key, value in table.items())} }}"


def _text(value: object) -> str:
    """A text, number or list as TOML writes it."""
    return json.dumps(value, ensure_ascii=False)
