"""What the limits take for granted of the cycles, and where these speak against it."""

from calib.measurement.iso_straying import straying_cycle
from testbed.iso9283.records import CycleResult


def cycle_words(result: CycleResult) -> list[str]:
    """That cycles follow their neighbors, and that one strays; each where it is so."""
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
    return texts
