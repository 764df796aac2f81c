"""Possible interpretations of the files, each as the tables of a session.toml."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from testbed.files.columns import covariance_names
from testbed.files.dialects.pose_names import counted_alike, stay_apart, written_alike
from testbed.files.refusal import refusal
from testbed.proposal.data import Document, Found, Part
from testbed.proposal.naming.targets import targets_in_a_row
from testbed.proposal.parts import joint_parts, seen_parts
from testbed.proposal.rows.clocks import by_clocks, have_clocks
from testbed.proposal.rows.nests import nests_of
from testbed.proposal.rows.visits import counted_anew

PARTS = (1, 3)
"""Numbers of parts into which rows are divided; the best part counts."""
ASSUMED = {"position_um": 30, "distance_um": 30, "rotation_mdeg": 10}
"""Standard uncertainties if no file has any: those of a laser tracker at some meters."""
SCATTER = re.compile(r"(?<![a-z])(std|stdev|stddev|sd|sigma|rms)(?![a-z])", re.IGNORECASE)
"""Words in names of columns that state the scatter of readings."""
EACH_A_STATION = "stations: each file is one, and the frame of the first is the world"
"""What is taken as said of files that may be stations."""


@dataclass(frozen=True, slots=True)
class Draft:
    """A possible session."""

    document: Document
    notes: tuple[str, ...]
    """Assumptions that no file states, in words."""
    jointless: bool = False
    """Whether no file has joints."""

    @property
    def counts_targets(self) -> bool:
        """Whether a column without a name is taken as that of targets."""
        columns = [self.document.get(name, {}).get("columns", {}) for name in ("joints", "points")]
        return any(one.get("target", "").isdigit() for one in columns)

    @property
    def guesses_distance(self) -> bool:
        """Whether a column without a name is taken as distances: only a fit can tell."""
        named = self.document.get("dialect", {}).get("header", True)
        return "ranges" in self.document and not named


def drafts_of(
    looks: tuple[Found, ...], own: tuple[int, ...], slides: frozenset[int] = frozenset()
) -> Iterator[Draft]:
    """Possible sessions, the likely ones first; `own` joints (from 1) have columns.

    `slides` are those that slide.
    """
    bare = [look for look in looks if look.kind == "bare"]
    heads = [look for look in looks if look.kind == "table"]
    if alone := [look for look in bare if look.rows < 2]:
        raise refusal(
            str(alone[0].path), "file", "is one line of numbers: nothing states what they are",
            code="M27", fix="give the file with all its rows, the columns named in the first line",
        )  # fmt: skip
    # names and numbers may be an export of points, or rows that begin with a name
    every = looks if heads else (*looks, *(one.also for one in looks if one.also is not None))
    groups = _stations(every)
    for k, group in enumerate(groups):
        if counted_anew(group):  # visits: one is tried for all, since names do not tell the poses
            groups[k] = group[:1]
            every = tuple(look for look in every if not any(look is one for one in group[1:]))
    joints: list[Part | None] = [part for look in every for part in joint_parts(look, own, slides)]
    seen = [part for group in groups for part in seen_parts(group[0], own)]
    files = {id(group[0]): group for group in groups}
    taken: set[str] = set()
    for one, two in product(joints or [None], seen):
        # in one file without a header both must be of one layout, in two files of none
        if (
            one is not None
            and (one[0] is two[0]) != (one[3] == two[3])
            and "both" in one[3] + two[3]
        ):
            continue
        if one is not None and one[0].kind != two[0].kind and "both" in one[3] + two[3]:
            continue  # a row of joints and a place has no other joints
        if (
            one is not None
            and _where(one[0]) == _where(two[0])
            and (one[0] is not two[0] or one[3] != two[3])
        ):
            continue
        stations = files[id(two[0])]
        for draft in (*_of_each(one, two, own, stations), *_matched(one, two, own, stations)):
            if (key := repr(draft.document)) not in taken:
                taken.add(key)
                yield draft


def _stations(looks: tuple[Found, ...]) -> list[tuple[Found, ...]]:
    """Tables of one kind in several files, with names or joints, as stations of one robot."""
    alike: dict[object, list[Found]] = {}
    for look in looks:
        jointed = look.has("q1") or look.has("q1_read")
        seen = look.has("x") or bool(targets_in_a_row(look.head))
        named = look.has("pose_id") or (jointed and seen)
        many = look.kind == "table" and look.sheet is None and named
        alike.setdefault(look.head if many else id(look), []).append(look)
    return [tuple(group) for group in alike.values()]


def _matched(
    joints: Part | None, seen: Part, own: tuple[int, ...], stations: tuple[Found, ...]
) -> Iterator[Draft]:
    """Sessions of joints and readings, for each way that may match them."""
    look, keys, notes, _ = seen
    keys = dict(keys)
    section = keys.pop("section")
    document: Document = {"joints": {"file": "joints.csv"}, section: {**_where(look), **keys}}
    said = [f"joints: no file has q1 to q{own[-1]}; name it under [joints]", *notes]
    ways: tuple[str, ...] = ("",)
    if joints is not None:
        document["joints"] = {**_where(joints[0]), **joints[1]}
        said = [*joints[2], *notes]
        if nests := nests_of(look, joints[0]):
            document["drift"] = {"nests": list(nests)}
            said.append(
                f"drift: no joints belong to {', '.join(nests)}: taken as nests on the floor"
            )
        ways = ("",) if joints[0] is look else _ways(joints[0], look, nests)
    if len(stations) > 1:
        document[section] = {
            "files": [one.name for one in stations], **_without_station(keys, stations)
        }  # fmt: skip
        said.append(EACH_A_STATION)
        ways = ("pose_id",)
    bare = {name for name, one in (("joints", joints and joints[0]), (section, look))
            if one is not None and one.kind == "bare"}  # fmt: skip
    if bare == {"joints", section}:
        document["dialect"] = {"header": False}
    else:
        for name in bare:
            document[name] = {**document[name], "header": False}
    stated, more = _uncertainty(look, section)
    document["uncertainty"] = stated
    for way in ways:
        note = ("order: the k-th reading belongs to the k-th joints",) if way == "order" else ()
        match: Document = {"match": way} if way else {}
        named: Document = {}
        if way == "time" and joints is not None:
            match, ahead, clocks = by_clocks(joints[0], look)
            note = (clocks,) if clocks else ()
            named = {"joints": document["joints"] | ahead}
        if way == "pose_id" and joints is not None and joints[0] is not look:
            files = (("joints", joints[0]), (section, look))
            named = {key: _named(document[key], one) for key, one in files}
        yield Draft({**match, **document, **named}, (*said, *note, *more), joints is None)


def _named(keys: Document, look: Found) -> Document:
    """Keys of a table with its column of poses, though names in it come again."""
    one = look.stems.get("pose_id")
    if one is None or one.known:
        return keys
    return keys | {"columns": {"pose_id": one.theirs} | keys.get("columns", {})}


def _without_station(keys: Document, stations: tuple[Found, ...]) -> Document:
    """Keys of a section without a column of stations whose value is constant in each file."""
    columns = dict(keys.get("columns", {}))
    if "station" not in columns or any(
        len(set(k.column(columns["station"]))) > 1 for k in stations
    ):
        return keys
    del columns["station"]
    others = {key: each for key, each in keys.items() if key != "columns"}
    return others | ({"columns": columns} if columns else {})


def _of_each(
    joints: Part | None, seen: Part, own: tuple[int, ...], stations: tuple[Found, ...]
) -> Iterator[Draft]:
    """The session of several stations whose files have the joints in the rows of the readings."""
    if joints is None or joints[0] is not seen[0] or len(stations) < 2:
        return
    for draft in _matched(joints, seen, own, stations):
        document = {key: value for key, value in draft.document.items() if key != "match"}
        each = {key: value for key, value in document["joints"].items() if key != "file"}
        yield replace(draft, document=document | {"joints": each})


def _uncertainty(look: Found, section: str) -> tuple[Document, tuple[str, ...]]:
    """[uncertainty] if no columns state it."""
    axes = {"points": 3, "frames": 6}.get(section, 0)
    if axes and set(covariance_names(axes)) <= set(look.head):
        return {}, ()
    missing: dict[str, tuple[str, ...]] = {"position_um": ("x", "y", "z")}
    if section == "frames":
        missing["rotation_mdeg"] = ("rx", "ry", "rz")
    elif section == "ranges":
        missing = {"distance_um": ("_distance",)}
    stated = {
        key: ASSUMED[key]
        for key, axes in missing.items()
        if not any(look.has(*(f"{u}{axis}" for axis in axes)) for u in ("u", "U95"))
    }
    read = {one.theirs for one in look.meanings}  # SD may be a slope distance
    notes = _coverage(look)
    scatter = [name for name in look.head if SCATTER.search(name) and name not in read]
    found = "is named so" if scatter else "has it"
    notes += [
        f"uncertainty: no column {found}; {key} = {value} is assumed; see your "
        "instrument's certificate"
        for key, value in stated.items()
    ]
    guessed: Document = {"assumed": True} if stated else {}
    if stated and scatter:
        more = f" and {len(scatter) - 1} more are" if scatter[1:] else " is"
        own = "u_distance_mm" if section == "ranges" else "ux_mm"
        notes.append(
            f"uncertainty: {scatter[0]}{more} not used: scatter within a reading is less than its "
            f'uncertainty; where it is that, write [{section}.columns] {own} = "{scatter[0]}"'
        )
    return stated | guessed, tuple(notes)


def _coverage(look: Found) -> list[str]:
    """What is taken for granted of columns of uncertainties whose names do not tell k."""
    stems = ("ux", "uy", "uz", "urx", "ury", "urz", "u_distance")
    means = look.stems
    names = [means[stem].theirs for stem in stems if stem in means and not means[stem].known]
    if not names:
        return []
    return [
        f"uncertainty: {', '.join(names)} are taken as standard uncertainties (k = 1); where they "
        "are expanded ones (k = 2), write U95 for the u of their names under columns"
    ]


def _where(look: Found) -> Document:
    """File and sheet of a table."""
    return {"file": look.name} | ({"sheet": look.sheet} if look.sheet is not None else {})


def _ways(one: Found, two: Found, nests: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Ways to match: pose_id if the joints have all names of the readings but nests, else order.

    An export gets both, and so do readings with more names than joints. If both files have clocks,
    time replaces order for different numbers of rows, and comes after it otherwise.
    """
    if two.kind in ("points", "frames"):
        return ("pose_id", "order") if one.has("pose_id") else ("order",)
    sides = []
    for look in (one, two):
        found = look.stems.get("pose_id")
        sides.append(set(look.column(found.theirs)) if found else None)
    named, seen = sides
    if seen is not None and nests:
        targets = two.column(two.stems["target"].theirs)
        rows = zip(two.column(two.stems["pose_id"].theirs), targets, strict=True)
        seen = {name for name, target in rows if target not in nests}
    clocked = have_clocks(one, two)
    others = ("time",) if clocked and one.rows != two.rows else ("order", "time")[: 1 + clocked]
    if named is None or seen is None:
        return others
    if not seen <= named and stay_apart(seen) and stay_apart(named):
        named, seen = ({written_alike(name) for name in names} for names in (named, seen))
    if not seen <= named and counted_alike(named, seen) is not None:
        return ("pose_id", *others)
    # readings of another kind may be those of the other poses
    if seen <= named:
        return ("pose_id",)
    return ("pose_id", *others) if named <= seen else others  # the error names those without joints
