"""Solids are closed, files say what was drawn, bad mesh files are refused."""

import io
import struct

import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from calib.geometry.frames import rot_x, slide
from testbed import assets
from testbed.robots.meshes.files import load_mesh
from testbed.robots.meshes.plain_obj import plain_obj
from testbed.robots.meshes.solids import (
    CREASE,
    GRID,
    ball,
    corner_normals,
    cut,
    groove,
    hull,
    is_closed,
    moved,
    on_grid,
    puck,
    union,
    write_obj,
)
from testbed.robots.write.generate import model_names

FILES = sorted(assets.models().glob("*/meshes/*.obj"))
NORMAL_DIGITS = 2e-3
"""Normals are written to 0.001 per component."""


def volume(vertices, faces):
    """Volume of a closed mesh by the divergence theorem [m^3]."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("fx,fx->", a, np.cross(b, c)) / 6)


def test_a_puck_has_the_volume_of_its_prism():
    n, r, h = 36, 0.05, 0.02
    solid = puck(r, 0.01, 0.01 + h, 1e-7, sections=n)
    polygon = n / 2 * r**2 * np.sin(2 * np.pi / n)
    # rounded rims of 0.1 um take 1e-5 of it away at most
    assert solid.volume == pytest.approx(polygon * h, rel=2e-5)


@pytest.mark.parametrize(("axis", "along"), [("x", 0), ("y", 1), ("z", 2)])
def test_a_puck_lies_along_its_axis_and_its_ends_may_be_swapped(axis, along):
    at = np.array([0.1, 0.2, 0.3])
    for low, high in ((-0.01, 0.04), (0.04, -0.01)):
        bounds = puck(0.02, low, high, 0.002, axis, tuple(at)).bounds - at
        np.testing.assert_allclose(bounds[:, along], [-0.01, 0.04], atol=1e-12)
        across = np.delete(bounds, along, axis=1)
        assert np.abs(across).max() <= 0.02 + 1e-12


def test_what_is_cut_off_and_what_is_left_add_up():
    block = hull(puck(0.05, 0, 0.1), puck(0.03, 0, 0.1, at=(0.1, 0, 0)))
    tool = moved(puck(0.02, -0.2, 0.2, axis="z"), rot_x(0.3) @ slide(0.03, 0, 0))
    left, both = cut(block, tool), union(block, tool)
    # the Boolean kernel works in single precision, 6e-8 of each coordinate
    assert left.volume + tool.volume == pytest.approx(both.volume, rel=1e-6)
    ringed = cut(puck(0.05, 0, 0.1, 1e-4, "z"), groove(0.05, 0.05, 0.004, 0.002))
    missing = puck(0.05, 0, 0.1, 1e-4, "z").volume - ringed.volume
    # a ring of 2 mm by 4 mm; 36 sections make it 1 % smaller
    assert missing == pytest.approx(np.pi * (0.05**2 - 0.048**2) * 0.004, rel=0.02)


def test_what_cuts_solids_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setattr("trimesh.boolean.engines_available", {None})
    with pytest.raises(InputError, match=r"needs the package manifold3d.*truebed\[dev\]"):
        union(puck(0.05, 0, 0.1), puck(0.05, 0, 0.2))


def test_normals_of_a_ball_point_outward_and_edges_of_a_disc_stay_crisp():
    vertices, faces = on_grid(ball(0.1, (0, 0, 0), 3))
    normals = corner_normals(vertices, faces)
    radial = vertices[faces] / np.linalg.norm(vertices[faces], axis=-1, keepdims=True)
    # facets of 8 degrees, averaged over five or six of them
    assert np.einsum("fkx,fkx->fk", normals, radial).min() > np.cos(np.radians(2))
    vertices, faces = on_grid(puck(0.1, 0, 0.05, 1e-5, "z"))
    normals = corner_normals(vertices, faces)
    cap = (vertices[faces][..., 2] > 0.05 - 1e-9).all(axis=1)
    assert cap.sum() >= 36
    np.testing.assert_allclose(normals[cap][..., 2], 1, atol=1e-9)


def test_shading_does_not_depend_on_how_a_surface_is_cut_into_triangles():
    vertices, faces = on_grid(puck(0.1, 0, 0.05, 0.004, "z"))
    centers = vertices[faces].mean(axis=1)
    finer = np.vstack([vertices, centers])
    extra = len(vertices) + np.arange(len(faces))
    split = np.concatenate(
        [np.stack([faces[:, k], faces[:, (k + 1) % 3], extra], 1) for k in range(3)]
    )
    a = corner_normals(vertices, faces)
    b = corner_normals(finer, split)[:, 0].reshape(3, -1, 3).swapaxes(0, 1)
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_closedness_sees_a_missing_and_a_turned_face():
    _, faces = on_grid(ball(0.1, (0, 0, 0), 1))
    assert is_closed(faces)
    assert not is_closed(faces[1:])
    turned = faces.copy()
    turned[3] = turned[3, ::-1]
    assert not is_closed(turned)


def test_a_written_solid_is_read_back_on_the_grid(tmp_path):
    solid = cut(puck(0.05, 0, 0.1), puck(0.02, -1, 1, at=(0.01, 0, 0)))
    write_obj(solid, tmp_path / "part.obj")
    mesh = load_mesh(tmp_path / "part.obj")
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(solid.volume, rel=1e-3)
    np.testing.assert_allclose(
        [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)], solid.bounds, atol=GRID
    )
    assert not mesh.vertices.flags.writeable
    on = mesh.vertices / GRID
    np.testing.assert_allclose(on, np.round(on), atol=1e-6)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_shipped_part_is_closed_outward_and_smoothly_shaded(file):
    mesh = load_mesh(file)
    # normals split vertices; the solid itself is closed
    _, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    assert is_closed(faces)
    assert volume(mesh.vertices, mesh.faces) > 0  # outside is outside
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=NORMAL_DIGITS)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    area = np.linalg.norm(flat, axis=1)
    big = area > 1e-7  # on smaller ones the grid turns the normal
    cosine = np.einsum("fx,fkx->fk", flat[big] / area[big, None], mesh.normals[mesh.faces[big]])
    assert cosine.min() > np.cos(CREASE) - NORMAL_DIGITS


def test_the_drawings_stay_small():
    models = {file.parent.parent for file in FILES}
    assert {folder.name for folder in models} == set(model_names())
    for folder in models:
        drawn = [file for file in FILES if file.parent.parent == folder]
        # smooth enough to look at, small enough to be kept in the repository
        assert sum(file.stat().st_size for file in drawn) < 1.5e6, folder.name
        faces = sum(file.read_text().count("\nf ") for file in drawn)
        assert 8_000 < faces < 30_000, folder.name


def test_a_mesh_without_normals_gets_crisp_ones(tmp_path):
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "box.stl")
    mesh = load_mesh(tmp_path / "box.stl")
    assert len(mesh.vertices) == 24  # eight corners, three normals each
    np.testing.assert_allclose(np.sort(np.abs(mesh.normals), axis=1), [[0, 0, 1]] * 24, atol=1e-9)


def test_a_mesh_is_the_same_in_every_format_and_size(tmp_path):
    """STL as text, DAE in millimeters, and a file too large to be kept."""
    box = trimesh.creation.box((1, 2, 3))
    box.export(tmp_path / "box.stl")
    (tmp_path / "text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(box))
    box.apply_scale(1e3)
    unit = b"<asset><unit meter='0.001'/>"
    data = trimesh.exchange.dae.export_collada(box).replace(b"<asset>", unit)
    (tmp_path / "mm.dae").write_bytes(data)
    (tmp_path / "large.obj").write_text(
        "# nothing\n" * 500_000 + trimesh.exchange.obj.export_obj(box, header=None)
    )
    for name, unit in (("box.stl", 1), ("text.stl", 1), ("mm.dae", 1), ("large.obj", 1e-3)):
        found = load_mesh(tmp_path / name)
        assert len(found.faces) == 12
        # eight digits are written as text
        assert volume(unit * found.vertices, found.faces) == pytest.approx(6.0, rel=1e-7)
        np.testing.assert_allclose(unit * np.ptp(found.vertices, axis=0), [1, 2, 3], rtol=1e-7)


def test_bad_mesh_files_are_refused(tmp_path):
    def refused(name, data):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError) as caught:
            load_mesh(tmp_path / name)
        return caught.value

    facet = struct.pack("<12fH", *range(12), 0)
    nan = struct.pack("<12fH", *[np.nan] * 12, 0)
    claims = refused("a.stl", bytes(80) + struct.pack("<I", 4_000_000_000) + facet)
    assert claims.code == "R9"
    assert "4000000000" in str(claims)
    assert "hold 1" in str(claims)
    bad = refused("b.stl", bytes(80) + struct.pack("<I", 2) + facet + nan)
    assert bad.code == "R10"
    assert "facet 1" in str(bad)
    assert refused("short.stl", b"abc").code == "R9"
    assert refused("x.unknown", b"abc").code == "R9"
    assert refused("empty.obj", b"").code in ("R9", "R10")
    assert refused("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").code in ("R9", "R10")
    with pytest.raises(InputError, match="no such mesh") as caught:
        load_mesh(tmp_path / "none.obj")
    assert caught.value.code == "R7"


def test_an_open_solid_is_not_written(tmp_path):
    solid = ball(0.1, (0, 0, 0), 1)
    solid.update_faces(np.arange(len(solid.faces)) > 0)
    with pytest.raises(ValueError, match="not closed"):
        write_obj(solid, tmp_path / "open.obj")
    assert not (tmp_path / "open.obj").exists()


@pytest.mark.parametrize("robot", ["staubli_tx60", "universal_ur10"])
def test_what_ships_is_read_as_trimesh_reads_it(robot):
    files = sorted((assets.models() / robot / "meshes").glob("*.obj"))
    for file in files[::3]:
        data = file.read_bytes()
        loaded = trimesh.load(io.BytesIO(data), file_type="obj", force="mesh", process=False)
        vertices, faces, normals = plain_obj(data)
        assert np.array_equal(vertices[faces], loaded.vertices[loaded.faces])
        assert len(vertices) == len(loaded.vertices)
        # of a triangle's corners: written to NORMAL_DIGITS, of smooth surfaces as of flat ones
        assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 2 * NORMAL_DIGITS
        assert (np.einsum("fkx,fx->fk", normals[faces], loaded.face_normals) > 0.5).all()


@pytest.mark.parametrize(
    "change",
    [
        ("f ", "f 1//1 "), ("f ", "f 9999999//1 2//1 3//1\nf "), ("f ", "f 0//1 2//1 3//1\nf "),
        ("vn ", "vn 1 2\nvn "), ("v ", "v 1 2 x\nv "), ("v ", "v 1_0 2 3\nv "),
        ("v ", "vt 0 0\nv "), ("//", "/1/"),
        ("o ", "usemtl steel\no "), ("f ", "f -1//1 -2//1 -3//1\nf "),
    ],
    ids=["four corners", "no such place", "from zero", "two numbers", "no number", "underscore",
         "textures", "texture corners", "material", "from the end"],
)  # fmt: skip
def test_any_other_obj_file_is_left_to_trimesh(change):
    text = (assets.models() / "staubli_tx60" / "meshes" / "probe.obj").read_text(encoding="utf-8")
    assert plain_obj(text.encode()) is not None
    assert plain_obj(text.replace(*change, 1).encode()) is None
