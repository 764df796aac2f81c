"""Tables of session.toml that one file may be meant as, the likely ones first."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.files.alternatives import BY_AXIS
from testbed.files.columns import PLAIN
from testbed.files.table import number_of
from testbed.proposal.data import Found
from testbed.proposal.names import Meaning

FEW = 300
"""Rows whose numbers are looked at."""
TURN = 6.4
"""Joints never turn so far where they are in radians [rad]."""
REACH = 20.0
"""Positions never lie so far where they are in meters [m]."""
BESIDE_JOINTS = ("pose_id", "temperature_degC", "payload_kg", "order", "time")
"""What a file of joints may say besides."""
Document = dict[str, Any]
Part = tuple[Found, Document, tuple[str, ...], str]
"""File, keys of its table, what was taken without being said, and the layout of a bare file."""


def joint_parts(look: Found, n: int) -> Iterator[Part]:
    """[joints] of a file, in each unit that is left open."""
    if look.kind == "rapid":
        yield (
            look,
            {"format": "rapid"},
            ("joints: RAPID writes them in deg, and commands them",),
            "",
        )
    elif look.kind == "bare":
        for layout, columns in _layouts(look, n):
            names = columns.get("joints")
            if names:
                for unit in _by_size(look, names, TURN, ("deg", "rad")):
                    mapped = {f"q{k + 1}_{unit}": own for k, own in enumerate(names)}
                    note = f"joints: columns {names[0]} to {names[-1]}, taken as {unit}"
                    yield look, {"columns": mapped}, (note,), layout
    elif look.has(*(f"q{k + 1}" for k in range(n))) or look.has(
        *(f"q{k + 1}_read" for k in range(n))
    ):
        stems = [f"q{k + 1}{tail}" for tail in ("", "_read") for k in range(n)]
        found = [look.stems[stem] for stem in stems if stem in look.stems]
        foreign = [one for one in found if not one.known]
        open_ = [one.theirs for one in foreign if not one.unit]
        units = _by_size(look, open_, TURN, ("deg", "rad")) if open_ else ("",)
        both = {"", "_read"} <= {one.plain[2:] for one in found}
        source = {"source": "commanded"} if both else {}
        notes = ("joints: commanded ones are used, not those that were read back",) if both else ()
        for unit in units:
            mapped = {f"{one.stem}_{one.unit or unit}": one.theirs for one in foreign}
            said = (f"joints: no column says its unit; taken as {unit}",) if unit else ()
            named = {own: name for own, name in _more(look).items() if own in BESIDE_JOINTS}
            named |= _drives(look, n)
            keys = {**source, **({"columns": named | mapped} if named or mapped else {})}
            yield look, keys, (*said, *notes), ""


def seen_parts(look: Found, n: int) -> Iterator[Part]:
    """[points] or [frames] of a file, in each unit and convention that is left open."""
    if look.kind in ("points", "frames"):
        yield from _exported(look)
    elif look.kind == "bare":
        for layout, columns in _layouts(look, n):
            if "position" in columns:
                for keys, notes in _readings(look, columns["position"], columns["rotation"], {}):
                    yield look, keys, notes, layout
    elif look.kind == "table":
        stems = look.stems
        place = [stems[s].theirs for s in ("x", "y", "z") if s in stems]
        polar = look.has("range", "azimuth") and (look.has("elevation") or look.has("zenith"))
        if len(place) == 3 or polar:
            turns = next(
                (
                    tuple(stems[s].theirs for s in form)
                    for form in (("qw", "qx", "qy", "qz"), ("rx", "ry", "rz"))
                    if look.has(*form)
                ),
                (),
            )
            more = _more(look) | _drives(look, n)
            for keys, notes in _readings(look, tuple(place), turns, more):
                yield look, keys, notes, ""


def _more(look: Found) -> dict[str, str]:
    """Columns besides joints and places, by our names."""
    own = ("pose_id", "target", "time", "temperature_degC", "payload_kg", "order")
    found = {one.stem: one.theirs for one in look.meanings if one.stem in own and not one.known}
    found = {key: name for key, name in found.items() if key in PLAIN}
    if "payload_kg" in found or look.has("payload_kg"):
        centers = [look.stems[s] for s in ("payload_x", "payload_y", "payload_z") if look.has(s)]
        if len(centers) == 3:
            found |= {f"{one.stem}_{one.unit or 'mm'}": one.theirs for one in centers
                      if not one.known}  # fmt: skip
    name = found.get("pose_id")
    if name is not None and (look.has("target") or len(set(look.column(name))) < look.rows):
        # a name that comes again is that of a reflector
        del found["pose_id"]
    return found


def _drives(look: Found, n: int) -> dict[str, str]:
    """Columns of what the drives of all joints report, by our names."""
    for kind, unit in (("torque", "Nm"), ("current", "A")):
        there = [look.stems[s] for s in (f"{kind}{k + 1}" for k in range(n)) if s in look.stems]
        if len(there) == n:
            return {f"{one.stem}_{one.unit or unit}": one.theirs for one in there if not one.known}
    return {}


def _readings(
    look: Found, place: tuple[str, ...], turns: tuple[str, ...], more: dict[str, str]
) -> Iterator[tuple[Document, tuple[str, ...]]]:
    """Keys and notes of [points] or [frames] with columns of these names."""
    means = {one.theirs: one for one in look.meanings}
    stated = {means[name].unit or (means[name].stem.rpartition("_")[2] if means[name].known else "")
              for name in place if name in means}  # fmt: skip
    told = not place or (stated and "" not in stated)
    lengths = ("",) if told else _by_size(look, place, REACH, ("mm", "m"))
    for unit, (form, extra, said) in product(lengths, _turnings(look, turns, means)):
        columns = dict(more)
        for stem, name in zip("xyz", place, strict=False):
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
        note = () if told else (f"positions: no column says its unit; taken as {unit}",)
        yield {"section": "frames" if turns else "points", **extra,
               **({"columns": columns} if columns else {})}, (*note, *said)  # fmt: skip


def _turnings(
    look: Found, turns: tuple[str, ...], means: dict[str, Meaning]
) -> Iterator[tuple[dict[str, str], Document, tuple[str, ...]]]:
    """Columns, keys and notes of rotations in these columns."""
    if not turns:
        yield {}, {}, ()
        return
    known = all(name in means and means[name].known for name in turns)
    directions: tuple[Document, ...] = ({}, {"gives": "T_tool_tracker"})
    if len(turns) == 4:
        orders = ("wxyz", "xyzw") if turns[0] not in means else ("wxyz",)
        for order, gives in product(orders, directions):
            note = _direction(gives)
            columns = {} if known else {f"q{a}": name for a, name in zip(order, turns, strict=True)}
            yield columns, gives, (note, f"rotations: quaternions, {' '.join(order)}")
        return
    if len(turns) == 9:
        names = [f"r{i}{j}" for i in "123" for j in "123"]
        for gives in directions:
            yield dict(zip(names, turns, strict=True)), gives, (_direction(gives),)
        return
    if "euler" in look.head:
        for gives in directions:
            yield {}, gives, (_direction(gives),)
        return
    unit = next((means[name].unit for name in turns if name in means), "")
    units = (unit,) if known or unit else _by_size(look, turns, TURN, ("deg", "rad"))
    forms = ("XYZ", "ZYX", *(a for a in BY_AXIS if a not in ("XYZ", "ZYX")), "rotation_vector")
    for gives, one, form in product(directions, units, forms):
        columns = (
            {} if known else {f"r{a}_{one}": name for a, name in zip("xyz", turns, strict=True)}
        )
        said = f"rotations: no file says how the three angles turn; taken as {form}"
        said += "" if unit or known else f", in {one}"
        yield columns, {"euler": form, **gives}, (said, _direction(gives))


def _direction(gives: Document) -> str:
    """What transform was taken."""
    what = "the tracker in the tool" if gives else "the tool in the tracker"
    return f"transforms: taken as those of {what}"


def _exported(look: Found) -> Iterator[Part]:
    """[points] or [frames] of an export."""
    lengths: list[Document] = [{}] if look.length else [{"length": "mm"}, {"length": "m"}]
    for length in lengths:
        told = f"positions: the export names no unit; taken as {length.get('length')}"
        note = (told,) if length else ()
        if look.kind == "points":
            for count in look.named:
                keys = {"section": "points", "format": "sa", "names": count, **length}
                said = (f"names: {count} fields before the coordinates",)
                yield look, keys, (*note, *said[: len(look.named) - 1]), ""
            continue
        form = {6: "euler", 7: "quaternion", 16: "matrix", 19: "matrix"}[look.width]
        conventions: list[Document] = [{"rotation": "matrix"}]
        if form == "quaternion":
            conventions = [{"rotation": f"quaternion_scalar_{end}"} for end in ("first", "last")]
        elif form == "euler":
            forms = [*("".join(each) for each in BY_AXIS)]
            forms.sort(key=lambda one: one != "XYZ")
            # six sequences about moving axes, and the same backwards about fixed ones
            fixed = [one.lower() for one in forms]
            conventions = [{"rotation": "euler", "euler": one, "angle": unit}
                           for unit in ("deg", "rad") for one in (*fixed, *forms)]  # fmt: skip
        for keys in conventions:
            taken = ", ".join(f"{key} {value}" for key, value in keys.items())
            words = f"rotations: the export does not say how they turn; taken as {taken}"
            yield look, {"section": "frames", "format": "sa", **keys, **length}, (*note, words), ""


def _layouts(look: Found, n: int) -> Iterator[tuple[str, dict[str, tuple[str, ...]]]]:
    """Where joints, position and rotation may stand in rows without a head, by column number."""
    begin = look.names
    for skip in (0, 1):
        left = look.width - skip
        at = begin + skip

        def columns(start: int, count: int) -> tuple[str, ...]:
            return tuple(str(start + k + 1) for k in range(count))

        if left == n:
            yield "joints", {"joints": columns(at, n)}
        for turns in (0, 3, 4, 9):
            if left == 3 + turns:
                both = {"position": columns(at, 3), "rotation": columns(at + 3, turns)}
                yield "readings", both
            if left in (n + 3 + turns, n + 6 + turns) and left >= n + 3 + turns:
                q, p, r = columns(at, n), columns(at + n, 3), columns(at + n + 3, turns)
                yield (
                    f"both {skip} {turns} joints first",
                    {"joints": q, "position": p, "rotation": r},
                )
                p, r, q = columns(at, 3), columns(at + 3, turns), columns(at + 3 + turns, n)
                yield (
                    f"both {skip} {turns} joints last",
                    {"joints": q, "position": p, "rotation": r},
                )


def _by_size(
    look: Found, names: Sequence[str], most: float, units: tuple[str, str]
) -> tuple[str, ...]:
    """Both units, the one that the size of the numbers speaks for first."""
    sizes = _numbers(look, names)
    large = bool(np.nan_to_num(sizes).max(initial=0.0) > most)
    return units if large else units[::-1]


def _numbers(look: Found, names: Sequence[str]) -> Array:
    """Sizes of all numbers in some columns; nan where a cell is none."""
    cells = [cell.replace(",", ".") for name in names for cell in look.column(name)[:FEW]]
    values: Array = np.array([number_of(cell) for cell in cells] or [np.nan])
    return np.abs(values)
