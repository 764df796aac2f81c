"""Columns of targets: several in one row, or one whose name has a number behind its axes."""

from collections.abc import Sequence

from testbed.proposal.naming.plain import without_unit
from testbed.proposal.words import (
    BEHIND,
    CONTROLLED,
    EXPANDED,
    MEASURED,
    OF_TARGET,
    ROTATIONS,
    SPREAD,
    STANDARD,
    WISHED,
)

OTHERS = ROTATIONS | WISHED | SPREAD | STANDARD | EXPANDED
"""Words of columns that belong to a target, but are no coordinates of it."""


def targets_in_a_row(head: Sequence[str], least: int = 2) -> dict[str, dict[str, str]]:
    """Columns by axis of several targets in one row, by their labels: x1 y1 z1, x2 y2 z2.

    There are none if there are fewer than `least`.
    """
    found: dict[str, dict[str, str]] = {}
    for name in head:
        text = without_unit(name)[0]
        label = axis = ""
        if (entry := OF_TARGET.fullmatch(text)) is not None:
            label, axis = " ".join(filter(None, (entry[1], entry[3]))).strip(), entry[2]
        elif (entry := BEHIND.fullmatch(text)) is not None:
            axis, label = entry[1], entry[2]
        if label and not set(f"{text} {label}".split()) & OTHERS:
            at = name.lower().find(label)
            label = name[at : at + len(label)] if at >= 0 else label  # in its own letters
            found.setdefault(label, {}).setdefault(axis, name)
    whole = [label for label, columns in found.items() if len(columns) == 3]
    measured = measured_of(whole)
    return {label: found[label] for label in measured} if len(measured) >= least else {}


def measured_of(labels: Sequence[str]) -> list[str]:
    """Those labels that mean measured values, if some do and others do not; else all."""
    for words in MEASURED:
        said = [one for one in labels if words & set(without_unit(one)[0].split())]
        if 0 < len(said) < len(labels):
            return said
    left = [one for one in labels if not CONTROLLED & set(without_unit(one)[0].split())]
    return left or list(labels)


def without_label(head: Sequence[str]) -> dict[str, str]:
    """Names without the label of the only target that is there: x of x1, rx of rx1; else none."""
    found = targets_in_a_row(head, least=1)
    if len(found) != 1:
        return {}
    (label,) = found
    words = label.lower()
    texts = {name: without_unit(name)[0] for name in head}
    plain = {name: text.removeprefix(words).removesuffix(words).strip()
             for name, text in texts.items()}  # fmt: skip
    return {name: text for name, text in plain.items() if text != texts[name]}
