"""Neighbours, orientation, smooth groups and names on bodies whose patches are known."""

import numpy as np
import trimesh

from iriftrace.core.mesh.topology import cells_to_flip, find_neighbours, weld
from iriftrace.core.mesh.triangles import area_vectors, unit_vectors
from iriftrace.part.regions import Regions, find_smooth_groups, name_regions


def regions_of(mesh: trimesh.Trimesh, angle_deg: float = 30.0) -> Regions:
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    areas = area_vectors(vertices, faces)
    normals = unit_vectors(areas)
    neighbours = find_neighbours(weld(vertices)[faces])
    groups = find_smooth_groups(neighbours, normals, angle_deg)
    return name_regions(groups, normals, np.linalg.norm(areas, axis=1), vertices, faces)


def test_box_has_six_planes_named_by_direction() -> None:
    mesh = trimesh.creation.box(extents=(1, 2, 3))
    regions = regions_of(mesh)
    # The largest first: the faces across x measure 2 x 3.
    assert {regions.names[0], regions.names[1]} == {"plane -x", "plane +x"}
    assert {regions.names[4], regions.names[5]} == {"plane -z", "plane +z"}
    for face, region in enumerate(regions.of_face):
        sign, axis = regions.names[region][-2:]
        expected = np.zeros(3)
        expected["xyz".index(axis)] = 1.0 if sign == "+" else -1.0
        np.testing.assert_allclose(mesh.face_normals[face], expected, atol=1e-12)


def test_triangle_soup_gives_the_same_regions() -> None:
    """STL stores each triangle on its own; welding must find the neighbours again."""
    mesh = trimesh.creation.cylinder(radius=5, height=20)
    soup = trimesh.Trimesh(
        mesh.vertices[mesh.faces].reshape(-1, 3),
        np.arange(3 * len(mesh.faces)).reshape(-1, 3),
        process=False,
    )
    whole, loose = regions_of(mesh), regions_of(soup)
    assert loose.names == whole.names
    np.testing.assert_array_equal(loose.of_face, whole.of_face)


def test_oblique_cylinder_has_numbered_heads() -> None:
    mesh = trimesh.creation.cylinder(radius=5, height=20)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.5, (1, 1, 0)))
    assert set(regions_of(mesh).names) == {"lateral", "head 1", "head 2"}


def tube(outer: float, inner: float, place: tuple[float, float]) -> trimesh.Trimesh:
    mesh = trimesh.creation.annulus(r_min=inner, r_max=outer, height=18.0, sections=64)
    mesh.apply_translation((*place, 0.0))
    return mesh


def test_round_patches_are_named_by_their_radius() -> None:
    """A tube beside two equal ones; then turned so that its axis is x, and askew."""
    mesh = trimesh.util.concatenate(
        [
            tube(60.0, 25.0, (0.0, 0.0)),
            tube(9.0, 7.0, (100.0, -20.5)),
            tube(9.0, 7.0, (-100.0, 4.0)),
        ]
    )
    names = set(regions_of(mesh).names)
    assert {"cylinder r 60", "hole 1 (x 0, y 0, r 25)", "cylinder r 9 1", "cylinder r 9 2"} < names
    assert {name.partition("(")[2] for name in names if name.startswith("hole")} == {
        "x 0, y 0, r 25)",
        "x 100, y -20.5, r 7)",
        "x -100, y 4, r 7)",
    }
    one = trimesh.util.concatenate(
        [tube(60.0, 25.0, (3.0, 4.0)), trimesh.creation.box((1, 1, 300))]
    )
    one.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    assert "hole 1 (y 4, z -3, r 25)" in regions_of(one).names
    one.apply_transform(trimesh.transformations.rotation_matrix(0.5, (1, 2, 3)))
    assert "hole 1 (r 25)" in regions_of(one).names


def test_cones_are_named_by_angle_and_radii_and_spheres_by_radius() -> None:
    """A countersunk plug of radius 20, turned about z and moved; a half of it; and askew."""
    profile = np.array(((0, 0), (20, 0), (20, 16), (18, 20), (10, 20), (5, 15), (0, 15)), float)
    plug = trimesh.creation.revolve(profile, sections=64)
    assert {"cone (53.13 deg, r 18 to 20)", "hollow cone (x 0, y 0, 90 deg, r 5 to 10)"} <= set(
        regions_of(plug, angle_deg=20.0).names
    )
    half = trimesh.Trimesh(plug.vertices, plug.faces[plug.triangles_center[:, 0] > 0.0])
    assert "hollow cone (90 deg, r 5 to 10)" in regions_of(half, angle_deg=20.0).names
    plug.apply_transform(trimesh.transformations.rotation_matrix(0.5, (1, 2, 3)))
    assert "hollow cone (90 deg, r 5 to 10)" in regions_of(plug, angle_deg=20.0).names
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    assert regions_of(ball).names == ("sphere r 4",)
    ball.invert()
    assert regions_of(ball).names == ("hollow sphere r 4",)
    for other in (trimesh.creation.torus(20.0, 5.0), trimesh.creation.capsule(20.0, 5.0)):
        assert regions_of(other).names == ("surface 1",)


def test_half_a_bore_is_hollow_and_a_cone_is_no_cylinder() -> None:
    ring = tube(60.0, 25.0, (0.0, 0.0))
    half = trimesh.Trimesh(ring.vertices, ring.faces[ring.triangles_center[:, 0] > 0.0])
    assert {"hollow r 25", "cylinder r 60"} <= set(regions_of(half).names)
    cone = trimesh.creation.cone(radius=10.0, height=60.0, sections=64)
    assert "cylinder" not in " ".join(regions_of(cone).names)
    wavy = trimesh.creation.cylinder(radius=5.0, height=20.0, sections=64)
    wavy.vertices[:, 0] *= 1.1
    named = trimesh.util.concatenate([wavy, trimesh.creation.box((20, 20, 1))])
    assert "surface 1" in regions_of(named).names


def test_equal_directions_are_numbered_by_size() -> None:
    """Two boxes show two planes to every side; the larger box's come first."""
    large, small = trimesh.creation.box(extents=(4, 4, 4)), trimesh.creation.box(extents=(2, 2, 2))
    small.apply_translation((10, 0, 0))
    both = trimesh.util.concatenate([large, small])
    regions = regions_of(both)
    assert len(set(regions.names)) == 12
    first = regions.of_face[:12]
    assert {regions.names[i] for i in first} == {f"plane {s}{a} 1" for s in "+-" for a in "xyz"}


def test_crumbs_form_the_rest() -> None:
    """0.6 mm cubes have 0.4 % of the area of a 10 mm cube and get no region of their own."""
    crumbs = []
    for i in range(3):
        crumb = trimesh.creation.box(extents=(0.6, 0.6, 0.6))
        crumb.apply_translation((20 + 2 * i, 0, 0))
        crumbs.append(crumb)
    regions = regions_of(trimesh.util.concatenate([trimesh.creation.box((10, 10, 10)), *crumbs]))
    assert len(regions.names) == 7
    assert regions.names[-1] == "rest"
    np.testing.assert_array_equal(np.flatnonzero(regions.of_face == 6), np.arange(12, 48))


def test_mesh_without_large_patches_still_has_a_region() -> None:
    """A noisy scan falls apart into single faces; all of them are the rest."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    assert regions_of(mesh, angle_deg=0.1).names == ("rest",)


def test_angle_decides_what_is_smooth() -> None:
    """The edges of an octagonal prism turn by 45 degrees."""
    prism = trimesh.creation.cylinder(radius=5, height=20, sections=8)
    assert len(regions_of(prism, angle_deg=44).names) == 10
    assert len(regions_of(prism, angle_deg=46).names) == 3


def test_open_edges_are_counted() -> None:
    mesh = trimesh.creation.box()
    faces = np.asarray(mesh.faces)
    assert find_neighbours(faces).open_edges == 0
    assert find_neighbours(faces[1:]).open_edges == 3
    # Boxes that touch along an edge: four triangles there, and yet nothing is open.
    other = trimesh.creation.box()
    other.apply_translation((1, 1, 0))
    touching = trimesh.util.concatenate([mesh, other])
    welded = weld(touching.vertices)[touching.faces]
    found = find_neighbours(welded)
    assert found.open_edges == 0
    assert len(found.pairs) == 2 * 18 - 2


def test_faces_that_use_a_vertex_twice_change_nothing() -> None:
    faces = np.asarray(trimesh.creation.box().faces)
    padded = np.concatenate(([[0, 0, 1]], faces, [[2, 2, 2]]))
    found = find_neighbours(padded)
    assert found.open_edges == 0
    np.testing.assert_array_equal(found.pairs, find_neighbours(faces).pairs + 1)
    assert len(find_neighbours(np.array([[1, 1, 1]])).pairs) == 0


def test_flipping_finds_exactly_the_turned_minority() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    areas = np.asarray(mesh.area_faces)
    rng = np.random.default_rng(5)
    for share in (0.0, 0.01, 0.3, 0.45):
        turned = rng.random(len(mesh.faces)) < share
        faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
        found = find_neighbours(faces)
        flipped, one_sided = cells_to_flip(found.pairs, found.opposed, areas)
        np.testing.assert_array_equal(flipped, turned)
        assert not one_sided.any()


def test_equal_holes_have_the_same_numbers_in_millimetres_and_metres() -> None:
    """Six tubes of one size: their bores differ in area by the rounding of the file alone."""
    turns = np.radians(60.0 * np.arange(6))
    places = 43.0 * np.stack((np.cos(turns), np.sin(turns)), axis=1)
    mesh = trimesh.util.concatenate([tube(9.0, 7.0, (float(x), float(y))) for x, y in places])
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    in_mm = trimesh.Trimesh(vertices.astype(np.float32), faces, process=False)
    in_m = trimesh.Trimesh(1e3 * (vertices / 1e3).astype(np.float32), faces, process=False)
    one, other = regions_of(in_mm), regions_of(in_m)
    assert sum(name.startswith("hole") for name in one.names) == 6
    assert other.names == one.names
    np.testing.assert_array_equal(other.of_face, one.of_face)
