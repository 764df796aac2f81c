"""OBJ files as ours are: one part of places, normals and triangles; trimesh need not be loaded."""

import numpy as np

from calib.arrays import Array, Index

SAID = (b"# ", b"o ")
"""Beginnings of lines that hold no numbers."""


def plain_obj(data: bytes) -> tuple[Array, Index, Array] | None:
    """Vertices (v, 3), faces (f, 3) and normals (v, 3), ordered by places.

    Each corner of a triangle is place//normal; a place with two normals is two vertices. None of a
    file that holds anything else.
    """
    places, turns, corners = [], [], []
    for line in data.splitlines():
        if line.startswith(b"v "):
            places.append(line[2:])
        elif line.startswith(b"vn "):
            turns.append(line[3:])
        elif line.startswith(b"f ") and line.count(b"//") == 3 and line.count(b"/") == 6:
            corners.append(line[2:].replace(b"//", b" "))
        elif not line.startswith(SAID):
            return None
    texts = [b" ".join(rows) for rows in (places, turns, corners)]
    if any(b"_" in text for text in texts):
        return None  # Python reads such numbers, nobody else does
    try:
        v, vn = (
            np.array(list(map(float, text.split()))).reshape(len(rows), 3)
            for text, rows in zip(texts, (places, turns), strict=False)
        )
        pairs = np.array(list(map(int, texts[2].split()))).reshape(3 * len(corners), 2)
    except ValueError:
        return None
    if not len(pairs) or pairs.min() < 1 or (pairs.max(axis=0) > (len(v), len(vn))).any():
        return None
    place, turn = (pairs - 1).T
    one, faces = np.unique(place * len(vn) + turn, return_inverse=True)
    return v[one // len(vn)], faces.reshape(-1, 3), vn[one % len(vn)]
