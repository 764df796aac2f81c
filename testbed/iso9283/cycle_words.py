"""What the figures take for granted of cycles and runs, and where these speak against it."""

import numpy as np

from calib.measurement.iso_bends import corners
from calib.measurement.iso_straying import long_tails, straying_cycle
from testbed.iso9283.records import CycleResult, PathRuns
from testbed.units import millimetres, p_equals


def cycle_words(result: CycleResult) -> list[str]:
    """That cycles follow their neighbors, one strays, tails are long; each where it is so."""
    texts, visits = list[str](), result.test.visits
    if result.memory is not None and result.memory.sentence:
        texts.append(result.memory.sentence)
    if visits is None:
        return texts
    far = straying_cycle(visits.position)
    if far.strays:
        texts.append(
            f"cycle {visits.called(far.pose, far.cycle)} of pose {visits.names[far.pose]} strays "
            f"further than normal scatter does (p = {far.p_value:.2g}): the limits of RP and RD "
            "assume normal scatter and are too narrow if single cycles stray; find out what "
            "happened there, or measure more cycles"
        )
    tails = long_tails(visits.position)
    if tails.long:
        texts.append(
            f"the cycles scatter with longer tails than normal scatter (kurtosis "
            f"{tails.kurtosis:.2g} times the normal one, p {p_equals(tails.p_value)} for all poses "
            "together): the limits of RP and RD assume normal scatter and do not hold with 95 % "
            "here; find out what makes some cycles scatter more than others"
        )
    return texts


def corner_words(paths: tuple[PathRuns, ...]) -> list[str]:
    """Which rounding of corners nothing shows, of each path with corners that was read anywhere."""
    texts = list[str]()
    for path in paths:
        if path.matched or not corners(path.command).any():
            continue
        steps = np.concatenate([np.linalg.norm(np.diff(run, axis=0), axis=1) for run in path.runs])
        texts.append(
            f"the readings of path {path.name} are {millimetres(float(np.median(steps)))} mm "
            "apart (median): a corner that is rounded within that distance is read as sharp, so "
            "that AT may be larger"
        )
    return texts
