"""Possible tables of session.toml for one file, the likely ones first."""

from collections.abc import Iterator, Mapping
from itertools import product

from testbed.bounds import FACTORS
from testbed.files.columns import PLAIN
from testbed.files.reflectors.one_tool import apart_or_alike
from testbed.files.rows.planned import foretold
from testbed.proposal.data import Document, Found, Part
from testbed.proposal.distances import distances, from_one
from testbed.proposal.exports import exported_parts
from testbed.proposal.layouts import Layout, layouts
from testbed.proposal.names import Meaning
from testbed.proposal.naming.plain import EITHER, says_either, without_unit
from testbed.proposal.naming.targets import targets_in_a_row
from testbed.proposal.polar.parts import is_polar, polar_ways
from testbed.proposal.rows.markers import beside_joints, marker_parts
from testbed.proposal.sizes import REACH, by_size, signed
from testbed.proposal.turns import turn_columns, turnings

TARGET = ("command_x", "command_y", "command_z")
DIFFERENCE = ("difference_x", "difference_y", "difference_z")
TURN = 6.4
"""Size of joint values above which they cannot be in radians [rad]."""
BESIDE_JOINTS = ("pose_id", "temperature_degC", "payload_kg", "order", "time", "time_s")
"""Other columns that a file of joints may have."""
BOTH_JOINTS = (
    "joints: no file says which ones count; the commanded ones are used, not those that were read "
    "back"
)


def joint_parts(
    look: Found, own: tuple[int, ...], slides: frozenset[int] = frozenset()
) -> Iterator[Part]:
    """[joints] of a file, for each possible unit; `own` joints (from 1) have columns.

    `slides` are the joints that slide: their columns are lengths.
    """
    if look.kind == "program":
        yield look, {"format": look.language}, look.notes, ""
    elif look.kind == "bare":
        marked = beside_joints(look, len(own))
        jointed = [Layout("both markers", joints=marked[0])] if marked else None
        for layout in jointed or layouts(look, len(own)):
            if not (names := layout.joints):
                continue
            for units, said in _each_unit(look, dict(zip(own, names, strict=True)), slides):
                mapped = {f"q{k}_{units[k]}": name for k, name in zip(own, names, strict=True)}
                mapped |= _target_of(layout) if not layout.position else {}
                note = f"joints: columns {names[0]} to {names[-1]}, taken as {said}"
                coded = _coded_said(layout) if not layout.position else ()
                yield look, {"columns": _more(look) | mapped}, (note, *coded), layout.name
    elif look.has(*(f"q{k}" for k in own)) or look.has(*(f"q{k}_read" for k in own)):
        stems = [f"q{k}{tail}" for tail in ("", "_read") for k in own]
        found = [look.stems[stem] for stem in stems if stem in look.stems]
        foreign = [one for one in found if not one.known]
        open_ = {_number(one): one.theirs for one in foreign if not one.unit}
        both = {"", "_read"} <= {one.plain[2:] for one in found}
        source = {"source": "commanded"} if both else {}
        notes = (*((BOTH_JOINTS,) if both else ()), *look.notes)
        either = {one.theirs for one in foreign if one.unit and says_either(one.theirs)}
        both_units = ("deg", "gon") if either else ("",)
        for (units, assumed), grad in product(_each_unit(look, open_, slides), both_units):
            mapped = {
                f"{one.stem}_{grad if one.theirs in either else one.unit or units[_number(one)]}":
                    one.theirs for one in foreign
            }  # fmt: skip
            unit = (f"joints: no column states its unit; assumed: {assumed}",) if open_ else ()
            unit = (f"joints: {EITHER} is taken as {grad}",) if grad else unit
            beside = BESIDE_JOINTS if look.has(*"xyz") else (*BESIDE_JOINTS, "target")
            named = {key: name for key, name in _more(look).items() if key in beside}
            named |= _drives(look, own[-1])
            keys = {**source, **({"columns": named | mapped} if named or mapped else {})}
            yield look, keys, (*unit, *notes), ""


def _target_of(layout: Layout) -> dict[str, str]:
    """The column of targets of a layout, by our name."""
    return {"target": layout.target} if layout.target else {}


def _coded_said(layout: Layout) -> tuple[str, ...]:
    """The assumption on the column of targets of a layout."""
    said = f"targets: column {layout.target}, taken as the number of the one that was measured"
    return (said,) if layout.target else ()


def _number(one: Meaning) -> int:
    """Number of the joint that a column has, from 1."""
    return int(one.plain[1:].removesuffix("_read"))


def _each_unit(
    look: Found, names: Mapping[int, str], slides: frozenset[int]
) -> Iterator[tuple[dict[int, str], str]]:
    """Units of joints by their numbers, the likely ones first, and what is assumed in words.

    `names` are the columns of these joints.
    """
    turned = [name for k, name in names.items() if k not in slides]
    slid = [name for k, name in names.items() if k in slides]
    angles = by_size(look, turned, TURN, ("deg", "rad")) if turned else ("",)
    lengths = by_size(look, slid, REACH, ("mm", "m")) if slid else ("",)
    for angle, length in product(angles, lengths):
        said = " and ".join(filter(None, (angle, f"{length} where it slides" * bool(length))))
        yield {k: length if k in slides else angle for k in names}, said


def seen_parts(look: Found, own: tuple[int, ...]) -> Iterator[Part]:
    """[points] or [frames] of a file, for each possible unit and convention.

    `own` are the numbers of joints with columns, from 1.
    """
    n = own[-1]
    if look.kind in ("points", "frames"):
        yield from exported_parts(look)
    elif look.kind == "bare" and (certain := list(marker_parts(look, len(own)))):
        yield from certain
    elif look.kind == "bare":
        for layout in layouts(look, len(own)):
            if layout.position:
                place = dict(zip("xyz", layout.position, strict=True))
                more = _more(look) | _target_of(layout)
                for keys, notes in _readings(look, place, layout.rotation, more):
                    said = (*layout.said, *_coded_said(layout))
                    yield look, keys, (*said, *notes), layout.name
            if layout.distance:
                for keys, said in from_one(look, layout.distance, _more(look)):
                    yield look, keys, said, layout.name
    elif look.kind == "table":
        stems = look.stems
        polar = is_polar(look)
        measured, parted = look.has(*"xyz"), look.has(*TARGET, *DIFFERENCE)
        names = tuple("xyz") if measured else (*TARGET, *DIFFERENCE) if parted and not polar else ()
        place = {stem: stems[stem].theirs for stem in names}
        if parted and not measured and not polar:
            for keys, notes in _readings(look, place, (), _more(look) | _drives(look, n)):
                yield look, keys, (_sum_said(place), *notes), ""
        elif place or polar:
            turns = turn_columns(look)
            more = _more(look) | _drives(look, n)
            for columns, extra, said in [({}, {}, ())] if place else polar_ways(look):
                for keys, notes in _readings(look, place, turns, more | columns):
                    if not (turns and extra):  # a frame of clockwise angles is none
                        yield look, keys | extra, (*said, *notes), ""
        if not place and not polar:
            yield from _targets(look, n)
        if look.has("distance") and not polar and (not place or look.has("anchor")):
            yield from distances(look, _more(look) | _drives(look, n))


def _targets(look: Found, n: int) -> Iterator[Part]:
    """[points] of a file with several targets in each row, for each possible unit.

    Two targets that cannot be on one tool are read separately.
    """
    ahead = foretold(look.head)
    found, again = _once(look, targets_in_a_row([name for name in look.head if name not in ahead]))
    names = [name for columns in found.values() for name in columns.values()]
    units = {without_unit(name)[1] for name in names}
    told = units - {""} if len(units) == 1 else set()
    columns = _more(look) | _drives(look, n)
    for unit in told or (by_size(look, names, REACH, ("mm", "m")) if names else ()):
        sized = f"positions: no column states its unit; assumed: {unit}"
        said = again if told else (sized, *again)
        if len(found) == 2 and (why := _not_both(look, found, unit)):
            for label, own in found.items():
                other = next(one for one in found if one != label)
                note = f"positions: {label}; those of {other} {why}, and are not used"
                place = {f"{axis}_{unit}": own[axis] for axis in "xyz"}
                yield look, {"section": "points", "columns": columns | place}, (*said, note), ""
            continue
        keys: Document = {
            "section": "points",
            "length": unit,
            "targets": {label: [own[axis] for axis in "xyz"] for label, own in found.items()},
        }
        yield look, keys | ({"columns": columns} if columns else {}), said, ""


def _once(
    look: Found, found: dict[str, dict[str, str]]
) -> tuple[dict[str, dict[str, str]], tuple[str, ...]]:
    """Targets without those that repeat the numbers of another, and a sentence on each of these."""
    kept: dict[tuple[tuple[str, ...], ...], str] = {}
    said = []
    for label, own in found.items():
        cells = tuple(look.column(own[axis]) for axis in "xyz")
        if (first := kept.setdefault(cells, label)) != label:
            said.append(f"positions: {label} repeats the numbers of {first}, and is not used")
    return {label: found[label] for label in kept.values()}, tuple(said)


def _not_both(look: Found, found: Mapping[str, Mapping[str, str]], unit: str) -> str:
    """Why two targets in each row cannot be on one tool; empty if they can."""
    one, other = (
        FACTORS[unit] * signed(look, [own[axis] for axis in "xyz"]).T for own in found.values()
    )
    why = apart_or_alike(one, other)
    return "" if why is None else why.words


def _sum_said(place: dict[str, str]) -> str:
    """The assumption for a table with targets and differences from them."""
    target, away = (", ".join(place[stem] for stem in stems) for stems in (TARGET, DIFFERENCE))
    return (
        f"positions: none was measured as such; taken as the targets {target} plus the differences "
        f"{away}, as measured - target; no fit tells the sign, for targets lie where a nominal "
        'robot goes: if it is the other, write differences = "target - measured" under [points]'
    )


def _more(look: Found) -> dict[str, str]:
    """Columns other than joints and positions, by our names."""
    own = (
        "pose_id", "target", "station", "anchor", "time", "temperature_degC", "payload_kg", "order"
    )  # fmt: skip
    there = [one for one in look.meanings if one.stem in own and not one.known]
    found = {one.stem + "_s" * (one.unit == "s"): one.theirs for one in there}
    found = {key: name for key, name in found.items() if key in PLAIN}
    if "payload_kg" in found or look.has("payload_kg"):
        centers = [look.stems[s] for s in ("payload_x", "payload_y", "payload_z") if look.has(s)]
        if len(centers) == 3:
            found |= {f"{one.stem}_{one.unit or 'mm'}": one.theirs for one in centers
                      if not one.known}  # fmt: skip
    name = found.get("pose_id")
    if name is not None and look.has("target") == (len(set(look.column(name))) == look.rows):
        # a name that repeats is a reflector; numbers that do not repeat beside it count rows
        del found["pose_id"]
    return found


def _drives(look: Found, n: int) -> dict[str, str]:
    """Columns of reported torques or currents of all joints, by our names."""
    for kind, unit in (("torque", "Nm"), ("current", "A")):
        there = [look.stems[s] for s in (f"{kind}{k + 1}" for k in range(n)) if s in look.stems]
        if len(there) == n:
            return {f"{one.stem}_{one.unit or unit}": one.theirs for one in there if not one.known}
    return {}


def _readings(
    look: Found, place: dict[str, str], turns: tuple[str, ...], more: dict[str, str]
) -> Iterator[tuple[Document, tuple[str, ...]]]:
    """Keys and notes of [points] or [frames] with columns of these names, by their stems."""
    means = {one.theirs: one for one in look.meanings}
    stated = {means[name].unit or (means[name].stem.rpartition("_")[2] if means[name].known else "")
              for name in place.values() if name in means}  # fmt: skip
    told = not place or (stated and "" not in stated)
    lengths = ("",) if told else by_size(look, tuple(place.values()), REACH, ("mm", "m"))
    for unit, (form, extra, said) in product(lengths, turnings(look, turns, means)):
        columns = dict(more)
        for stem, name in place.items():
            one = means.get(name)
            if one is None or not one.known:
                columns[f"{stem}_{(one.unit if one else '') or unit}"] = name
        for one in look.meanings:
            if one.plain.startswith(("u", "U95")) and not one.known and one.plain[-1] in "xyz":
                turning = one.plain[-2] == "r"
                columns[f"{one.stem}_{one.unit or ('deg' if turning else unit or 'mm')}"] = (
                    one.theirs
                )
        columns |= form
        note = () if told else (f"positions: no column states its unit; assumed: {unit}",)
        yield {"section": "frames" if turns else "points", **extra,
               **({"columns": columns} if columns else {})}, (*note, *said)  # fmt: skip
