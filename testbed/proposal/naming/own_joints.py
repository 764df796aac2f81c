"""Columns of joints called as in the file of the robot, or by anything and their number."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

from testbed.proposal.data import Found
from testbed.proposal.names import Meaning
from testbed.proposal.naming.named_in_cells import families_by_names
from testbed.proposal.naming.plain import COUNT, MOST, Family, small_words, without_unit
from testbed.proposal.words import JOINTS, OF_JOINTS, RATES
from testbed.units import listed

CALLED_JOINTS = {"joint", "joints", "q"}
"""Words that no other numbered columns have."""
AXES = {"x", "y", "z", "rx", "ry", "rz"}
"""Words of coordinates, whose numbers are those of targets."""


def with_joints(look: Found, own: Sequence[int], names: Sequence[str]) -> tuple[Found, ...]:
    """The same table with its columns of joints known, for each choice of them, the likely first.

    Where several families of columns may be those of the joints, a fit decides.

    Parameters
    ----------
    look : Found
        A table with a header; others come back as they are.
    own : sequence of int
        Numbers of the joints with columns, from 1.
    names : sequence of str
        Names of these joints in the file of the robot; empty if it has none.
    """
    if look.kind != "table":
        return (look,)
    plain = {name: small_words(name) for name in look.head}
    told = look.has(*(f"q{k}" for k in own)) or look.has(*(f"q{k}_read" for k in own))
    known = [dict(zip(own, words, strict=True)) for words in (names, *JOINTS)
             if len(words) == len(own)]  # fmt: skip
    by_cells = [family for words in known for family in families_by_names(look, plain, words)]
    if by_cells:
        how = "by the names of joints beside them"
        return tuple(_with(look, one, by_cells, own, how) for one in by_cells[:MOST])
    families = [family for words in known for family in _called(plain, words)]
    families = [one for k, one in enumerate(families) if one not in families[:k]]
    if not families and not told:
        # names alone tell joints of one digit: of more, the first nine are none yet
        again = {f"q{k}" for k in own} if len(own) > 9 else set[str]()
        taken = {one.theirs for one in look.meanings if one.plain not in again}
        free = {name: text for name, text in plain.items() if name not in taken}
        families = _numbered(free, own)
    families.sort(key=lambda one: not _is_of_joints(plain[one[own[0]]]))
    chosen = [_with(look, one, families, own) for one in families[:MOST]]
    return (*chosen, look) if told or not chosen else tuple(chosen)


def _with(
    look: Found, chosen: Family, families: Sequence[Family], own: Sequence[int],
    how: str = "in this order",
) -> Found:  # fmt: skip
    """The same table with one family of columns as its joints, and the others not."""
    said = f"joints: columns {_ends(chosen, own)} are taken as those of the joints, {how}"
    others = [_ends(one, own) for one in families if one is not chosen]
    if others:
        said += f"; {listed(others[:MOST])} are not used"
    taken = set(chosen.values())
    found = [Meaning(name, f"q{k}", without_unit(name)[1]) for k, name in chosen.items()]
    joints = {one.plain for one in found}
    left = [one for one in look.meanings if one.theirs not in taken and one.plain not in joints]
    return replace(look, meanings=(*found, *left), notes=(*look.notes, said))


def _ends(family: Mapping[int, str], own: Sequence[int]) -> str:
    """First and last name of a family."""
    return f"{family[own[0]]} to {family[own[-1]]}"


def _is_of_joints(text: str) -> bool:
    """Whether a name says that it is a position of a joint."""
    return bool(OF_JOINTS & set(text.split()))


def _called(plain: Mapping[str, str], names: Mapping[int, str]) -> list[Family]:
    """Families of columns with the name of each joint, and the same words around all of them."""
    families: dict[tuple[str, str], Family] = {}
    for k, own in names.items():
        for name, text in plain.items():
            if (hit := _is_called(text, own)) is not None:
                families.setdefault((hit[1] or "", hit[2] or ""), {}).setdefault(k, name)
    return [one for one in families.values() if len(one) == len(names) == len(set(one.values()))]


def _is_called(text: str, own: str) -> re.Match[str] | None:
    """The words around the name of a joint in that of a column of its positions, if it is one."""
    hit = re.fullmatch(rf"(?:(.*) )?{re.escape(small_words(own))}(?: (.*))?", text)
    return None if RATES & set(text.split()) else hit


def called_in(look: Found, names: Sequence[str]) -> list[str]:
    """Which of some names of joints a table with a header has columns of."""
    if look.kind != "table":
        return []
    plain = [small_words(name) for name in look.head]
    return [own for own in names if any(_is_called(text, own) for text in plain)]


def counted_joints(look: Found) -> list[str]:
    """The longest row of columns that are called joints and numbered from 0 or 1, of any number."""
    if look.kind != "table":
        return []
    families = _by_number({name: small_words(name) for name in look.head})
    called = [
        [family[k] for k in sorted(family)]
        for around, family in families.items()
        if CALLED_JOINTS & set(" ".join(around).split())
        and sorted(family) in ([*range(len(family))], [*range(1, len(family) + 1)])
    ]
    return max(called, key=len, default=[])


def _numbered(plain: Mapping[str, str], own: Sequence[int]) -> list[Family]:
    """Families of columns that differ by the number of a joint alone, from 1 or from 0."""
    return [
        {k: family[k - 1 + start] for k in own}
        for family in _by_number(plain).values()
        for start in (0, 1)
        if set(family) == {k - 1 + start for k in own} and len(own) > 2
    ]


def _by_number(plain: Mapping[str, str]) -> dict[tuple[str, str], Family]:
    """Columns that differ by a number alone, by the words around it, without rates and targets."""
    families: dict[tuple[str, str], Family] = {}
    for name, text in plain.items():
        if (RATES | AXES) & set(re.sub(r"\d+", " ", text).split()):
            continue
        for hit in islice(COUNT.finditer(text), MOST):
            around = (text[: hit.start()], text[hit.end() :])
            families.setdefault(around, {}).setdefault(int(hit[0]), name)
    return families
