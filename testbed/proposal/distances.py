"""Distances of a file: from points that a column names, or from one that none names."""

from collections.abc import Iterator

from testbed.proposal.data import Document, Found, Part
from testbed.proposal.sizes import REACH, by_size

ANCHOR = "A"
"""What the one fixed point is called where no column names any."""
ONE_ANCHOR = (
    "anchors: no column anchor names any; all distances are taken as those from one, "
    f"{ANCHOR}; if there are several, name that of each row in such a column"
)


def distances(look: Found, more: dict[str, str]) -> Iterator[Part]:
    """[ranges] of a file, for each possible unit; `more` are its other columns, by our names."""
    one, named = look.stems["distance"], look.has("anchor")
    anchors = look.column(look.stems["anchor"].theirs) if named else [ANCHOR]
    names = list(dict.fromkeys(filter(None, anchors)))
    places = (
        f"anchors: no file says where {', '.join(names)} {'stand' if len(names) > 1 else 'stands'};"
        ' "free" finds the places, [x, y, z] in mm states one'
    )
    if not named:
        places = ONE_ANCHOR
    told = one.known or one.unit
    for unit in ("",) if told else by_size(look, [one.theirs], REACH, ("mm", "m")):
        columns = dict(more)
        for stem in ("distance", "u_distance", "U95_distance"):
            if look.has(stem) and not (own := look.stems[stem]).known:
                columns[f"{stem}_{own.unit or unit or 'mm'}"] = own.theirs
        note = (f"distances: no column states its unit; assumed: {unit}",) if unit else ()
        keys: Document = {"section": "ranges", "anchors_mm": dict.fromkeys(names, "free")}
        yield look, keys | ({"columns": columns} if columns else {}), (places, *note), ""


def from_one(
    look: Found, column: str, more: dict[str, str]
) -> Iterator[tuple[Document, tuple[str, ...]]]:
    """[ranges] of rows without a header, one column of which may be distances, for each unit.

    Keys and notes; `more` are other columns, by our names.
    """
    for unit in by_size(look, [column], REACH, ("mm", "m")):
        columns = more | {f"distance_{unit}": column}
        said = (f"distances: column {column}, taken as {unit}", ONE_ANCHOR)
        keys: Document = {"section": "ranges", "anchors_mm": {ANCHOR: "free"}, "columns": columns}
        yield keys, said
