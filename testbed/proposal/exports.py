"""Possible tables of session.toml for an export of Spatial Analyzer."""

from collections.abc import Iterator

from testbed.files.dialects.spatial_lines import sa_lines
from testbed.files.tried.other_rotations import BY_AXIS
from testbed.proposal.data import Document, Found, Part


def exported_parts(look: Found) -> Iterator[Part]:
    """[points] or [frames] of an export."""
    lengths: list[Document] = [{}] if look.length else [{"length": "mm"}, {"length": "m"}]
    for length in lengths:
        told = f"positions: the export states no unit; assumed: {length.get('length')}"
        note = (told,) if length else ()
        if look.kind == "points":
            for count in look.named:
                keys = {"section": "points", "format": "sa", "names": count, **length}
                said = (f"names: {count} fields before the coordinates",)
                yield look, keys, (*note, *said[: len(look.named) - 1]), ""
                if _has_targets_again(look, count):
                    again = "poses: each target is one, and each group has them again"
                    yield look, {**keys, "pose": "target"}, (*note, again), ""
            continue
        form = {6: "euler", 7: "quaternion", 12: "matrix", 16: "matrix", 19: "matrix"}[look.width]
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
            words = f"rotations: the export does not state how they turn; assumed: {taken}"
            yield look, {"section": "frames", "format": "sa", **keys, **length}, (*note, words), ""


def _has_targets_again(look: Found, count: int) -> bool:
    """Whether groups, the last but one of `count` names of each line, have the same targets."""
    if count < 2:
        return False
    lines = (line for line in sa_lines(look.text).fields if len(line) >= count)
    pairs = [(line[count - 2], line[count - 1]) for line in lines]
    groups, targets = ({pair[k] for pair in pairs} for k in (0, 1))
    return len(groups) > 1 and len(targets) < len(pairs) == len(set(pairs))
