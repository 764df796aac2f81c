"""Numbers that no measurement tells from others, in few words."""

from collections.abc import Iterable

from testbed.units import sentence

TOLD, WHY = " cannot be told from ", ": "


def left_nominal(sentences: Iterable[str]) -> tuple[str, ...]:
    """What stands for each number in one sentence; sentences that say something else as they are.

    Examples
    --------
    >>> left_nominal(["d2 cannot be told from d3: any change of d2 looks like", "more poses help"])
    ('Left nominal: d2 (as d3).', 'More poses help.')
    """
    pairs, others = [], []
    for text in sentences:
        name, told, rest = text.partition(TOLD)
        if told:
            pairs.append(f"{name} (as {rest.partition(WHY)[0]})")
        else:
            others.append(sentence(text, keep_name=True))
    return (*([f"Left nominal: {', '.join(pairs)}."] if pairs else []), *others)
