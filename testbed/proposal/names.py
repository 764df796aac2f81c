"""Names of columns in other programs: their meaning in our names, and what stays ambiguous."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from testbed.bounds import FACTORS
from testbed.files.columns import WRITTEN, is_known
from testbed.proposal.naming.plain import without_unit
from testbed.proposal.naming.positions import counted_vectors, shift_names, stems_of_letters
from testbed.proposal.naming.targets import measured_of, without_label
from testbed.proposal.polar.names import polar_names
from testbed.proposal.transforms import axis_names, entry_of
from testbed.proposal.words import (
    ANGLE,
    COUNTED,
    DIFFERENCES,
    DISTANCE,
    DRIVES,
    EXPANDED,
    FROM_ZERO,
    JOINT,
    JOINTS,
    LETTERS,
    LOADS,
    MEASURED,
    MOVING,
    OF_JOINTS,
    OF_TURNS,
    PLACE,
    PLAIN,
    QUATERNION,
    READ,
    ROTATIONS,
    SPREAD,
    STANDARD,
    TARGETS,
    TURN,
    TURNS,
    WISHED,
)


@dataclass(frozen=True, slots=True)
class Meaning:
    """Possible meaning of a column."""

    theirs: str
    stem: str
    """Our name without its unit: q1, x, rx, ux, U95x, pose_id; unchanged if it is ours already."""
    unit: str
    """Unit in the name; empty if it has none."""
    known: bool = False
    """Whether it is already one of our names."""

    @property
    def plain(self) -> str:
        """The stem of a name of ours as well: q1 of q1_deg."""
        stem, _, unit = self.stem.rpartition("_")
        return stem if self.known and unit in FACTORS and stem else self.stem


def meanings(head: Sequence[str], units: Sequence[str] = ()) -> tuple[Meaning, ...]:
    """Meanings of the columns of a table, each of our names at most once; others are left out.

    A stem that fits several columns equally is given to none. `units` are those of a line below the
    names, "" for columns without one.
    """
    found, shifted, turns = [], _from_zero(head), _of_this_head(head)
    texts = {without_unit(name)[0] for name in head}
    if _has_scalar(head):
        turns = turns | {"q0": QUATERNION[0]}
    elif "q0" in {name.strip().lower() for name in head if name not in shifted}:
        # beside q0, which is no joint, q1 is no joint either
        turns = turns | {f"q{k}": stem for k, stem in enumerate(QUATERNION)}
    for name, unit in zip(head, units or [""] * len(head), strict=True):
        bare = not (is_known(name) or without_unit(name)[1])
        said = f"{shifted.get(name, name)} [{unit}]" if unit and bare else shifted.get(name, name)
        if (meaning := _meaning(said, texts, turns)) is not None:
            if name in shifted and meaning.known:
                stem, _, unit = meaning.stem.rpartition("_")
                meaning = Meaning(name, stem, unit)
            found.append(replace(meaning, theirs=name))
    best: dict[str, list[Meaning]] = {}
    for meaning in found:
        best.setdefault(meaning.plain, []).append(meaning)
    chosen, others = list[Meaning](), 0
    for several in best.values():
        names = measured_of([one.theirs for one in several])
        left = [one for one in several if one.known][:1]
        left = left or [one for one in several if one.theirs in names]
        chosen += left if len(left) == 1 else []
        if len(left) == 1 and left[0].plain in ("x", "y", "z"):
            others += len(several) - 1
    if not {"x", "y", "z"} & {one.plain for one in chosen}:
        taken = {one.theirs for one in chosen}
        below = dict(zip(head, units or [""] * len(head), strict=True))
        alone = without_label([name for name in head if name not in taken])
        for name, text in alone.items():
            if (one := _coordinate(name, text, "", [])) is not None and one.stem[0] != "u":
                unit = without_unit(name)[1] or WRITTEN.get(below[name].lower(), "")
                chosen.append(replace(one, unit=unit))
    # turns beside places that do not count may be those of these places
    place = next((one.theirs for one in chosen if one.plain == "x"), "")
    return tuple(
        one for one in chosen
        if not (others and one.plain in OF_TURNS) or _of_one(place, one.theirs)
    )  # fmt: skip


def _of_this_head(head: Sequence[str]) -> dict[str, str]:
    """Stems of names that have a meaning only together with others of the table."""
    texts = {without_unit(name)[0] for name in head}
    found = turns_of_letters(head) | stems_of_letters(texts)
    for names in JOINTS:
        if texts.issuperset(names):
            found = found | {name: f"q{k}" for k, name in enumerate(names, start=1)}
    found = found | shift_names(texts) | counted_vectors(texts)
    for fours in _counted_fours(texts):
        others = {joint[1] for text in texts - set(fours)
                  if (joint := JOINT.fullmatch(_joint_alone(text))) is not None}  # fmt: skip
        # four joints beside others that are counted alike are those of a smaller arm
        if others >= set("123456" if any(text.startswith("q ") for text in fours) else "1234"):
            found = found | fours
    found = found | axis_names(texts - set(found))
    return found | polar_names(texts - set(found))


def _counted_fours(texts: Collection[str]) -> Iterator[dict[str, str]]:
    """Four numbers that are counted from 0 or 1, as stems of a quaternion whose scalar is first."""
    families: dict[str, dict[int, str]] = {}
    for text in sorted(texts):
        if (one := COUNTED.fullmatch(text)) is not None:
            families.setdefault(one[1], {})[int(one[2])] = text
    for word, own in families.items():
        if (
            len(own) == len(QUATERNION)
            and max(own) - min(own) == 3
            and not (word == "q" and {"q5", "q 5"} & set(texts))
        ):
            yield {own[k]: stem for k, stem in zip(sorted(own), QUATERNION, strict=True)}


def _joint_alone(text: str) -> str:
    """A name without the words that do not identify the joint."""
    return " ".join(word for word in text.split() if word not in OF_JOINTS)


def _of_one(place: str, turn: str) -> bool:
    """Whether the names of a position and a rotation agree on being measured."""
    said = [[bool(words & set(without_unit(name)[0].split())) for words in MEASURED]
            for name in (place, turn)]  # fmt: skip
    return said[0] == said[1] and any(said[0])


def _from_zero(head: Sequence[str]) -> dict[str, str]:
    """Joints counted from 0, with their names when counted from 1."""
    families: dict[str, dict[int, str]] = {}
    scalar = _has_scalar(head)
    for name in [name for name in head if not (scalar and _small(name) == "q0")]:
        if (joint := FROM_ZERO.fullmatch(_joint_alone(without_unit(name)[0]))) is not None:
            families.setdefault(joint[1], {})[int(joint[2])] = name
    shifted = {}
    for word, columns in families.items():
        count = len(columns)
        # q0 to q3 are a quaternion, and two are too few to decide
        is_turn = word[-1] == "q" and count == 4
        if count > 2 and set(columns) == set(range(count)) and not is_turn:
            for number, name in columns.items():
                before, _, after = name.rpartition(str(number))
                shifted[name] = f"{before}{number + 1}{after}"
    return shifted


def _has_scalar(head: Sequence[str]) -> bool:
    """Whether q0 is the scalar of a quaternion, beside qx, qy and qz."""
    names = {_small(name) for name in head}
    return names >= {"q0", *QUATERNION[1:]} and QUATERNION[0] not in names


def _small(name: str) -> str:
    return name.strip().lower()


def is_wished(name: str) -> bool:
    """Whether a column is a commanded coordinate, or a difference."""
    words = without_unit(name)[0].split()
    return bool(words) and bool({"x", "y", "z"} & set(words)) and bool(WISHED & set(words))


def turns_of_letters(head: Sequence[str]) -> dict[str, str]:
    """Rotations meant by the letters A B C, or W P R, beside X Y Z with the same other words."""
    texts, found = {without_unit(name)[0] for name in head}, dict[str, str]()
    for text in texts:
        before, x, after = f" {text} ".partition(" x ")
        if not x or WISHED & set(text.split()):
            continue
        for turns in LETTERS:
            named = {one: f"{before} {one} {after}".strip() for one in (*turns, "y", "z")}
            if texts.issuperset(named.values()):
                found |= {named[one]: stem for one, stem in turns.items()}
                break
    return found


def _meaning(name: str, texts: Collection[str], turns: Mapping[str, str]) -> Meaning | None:
    """Meaning of one column; None if its name is unknown.

    `texts` are the names of the table in small words without units, `turns` those that are
    rotations in this table only.
    """
    text, unit = without_unit(name)
    entry = entry_of(text, texts)
    if is_known(name) and entry in ("", name):
        return Meaning(name, name, "", known=True)
    if entry:
        return Meaning(name, entry, unit)
    words = set(text.split())
    if text in turns:
        return Meaning(name, turns[text], "" if turns[text] in QUATERNION else unit)
    for own, known in PLAIN.items():
        if text in known:
            return Meaning(name, own, unit if own == "time" else "")
    if words & SPREAD:
        return None
    drive = next((DRIVES[word] for word in DRIVES if word in words), "")
    if unit in ("A", "mA") or {"motor", "current"} <= words:
        drive = "current"
    if drive:
        number = re.search(r"([1-9])$", text)
        return Meaning(name, f"{drive}{number[1]}", unit) if number else None
    if words & LOADS:
        axis = text.split()[-1]
        return Meaning(name, f"payload_{axis}", unit) if axis in ("x", "y", "z") else None
    joint = JOINT.fullmatch(
        " ".join(word for word in _joint_alone(text).split() if word not in READ | WISHED)
    )
    if joint and not words & (DIFFERENCES | MOVING):
        return Meaning(name, f"q{joint[1]}{'_read' if words & READ else ''}", unit)
    far = words & DISTANCE and not words & {"x", "y", "z"}
    if far and not any(ANGLE & set(other.split()) for other in texts):
        mark = "U95" if words & EXPANDED else "u" if words & STANDARD else ""
        return Meaning(name, f"{mark}_distance" if mark else "distance", unit)
    if words & WISHED or text in ("dx", "dy", "dz"):
        return _wished(name, text, unit)
    return _coordinate(name, text, unit, texts)


def _wished(name: str, text: str, unit: str) -> Meaning | None:
    """A coordinate of a target, or a difference from it; None for their rotations."""
    if text in ("dx", "dy", "dz"):
        return Meaning(name, f"difference_{text[1]}", unit)
    words = set(text.split())
    axes = words & {"x", "y", "z"}
    if len(axes) != 1 or not words <= TARGETS | DIFFERENCES | axes | {"position", "pos"}:
        return None
    kind = "difference" if words & DIFFERENCES else "command"
    return Meaning(name, f"{kind}_{axes.pop()}", unit)


def _of_quaternion(text: str, texts: Collection[str]) -> bool:
    """Whether a name ends with x, y, z or w, and all four exist with the same words before."""
    before, _, last = text.rpartition(" ")
    return last in tuple("xyzw") and all(f"{before} {axis}" in texts for axis in "xyzw")


def _coordinate(name: str, text: str, unit: str, texts: Collection[str]) -> Meaning | None:
    """A coordinate, a rotation, or the uncertainty of one."""
    words = text.split()
    for mark, prefix in ((EXPANDED, "U95"), (STANDARD, "u")):
        glued = re.fullmatch(rf"({'|'.join(sorted(map(re.escape, mark), reverse=True))})(r?[xyz])",
                             text)  # fmt: skip
        if glued:
            return Meaning(name, f"{prefix}{glued[2]}", unit)
        if set(words) & mark and words[-1] in ("x", "y", "z", "rx", "ry", "rz"):
            return Meaning(name, f"{prefix}{words[-1]}", unit)
        if set(words) & mark and words[0] in ("x", "y", "z", "rx", "ry", "rz"):
            return Meaning(name, f"{prefix}{words[0]}", unit)
    if _of_quaternion(text, texts):
        return Meaning(name, f"q{words[-1]}", "")
    for word in (words[-1], words[0]) if words else ():
        if word in ("x", "y", "z"):
            return Meaning(name, f"r{word}" if ROTATIONS & set(words) else word, unit)
        if turn := TURN.fullmatch(word):
            return Meaning(name, f"r{turn[1]}", unit)
        if place := PLACE.fullmatch(word):
            return Meaning(name, place[1], unit)
        if word in TURNS:
            return Meaning(name, TURNS[word], unit)
    return None
