"""Words on a plane of a recording: which of them lie on each other."""

from itertools import combinations


def overlaps(words):
    """Pairs of words that lie on each other."""
    return [
        (one.text, two.text)
        for one, two in combinations(words, 2)
        if one.box[0] < two.box[2] - 1 and two.box[0] < one.box[2] - 1
        and one.box[1] < two.box[3] - 1 and two.box[1] < one.box[3] - 1
    ]  # fmt: skip
