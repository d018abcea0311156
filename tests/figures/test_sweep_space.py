"""Pictures of a sweep in space: poses around the part, and faces coloured by their numbers."""

from typing import Any

import numpy as np
import pytest
import pyvista as pv
import xarray as xr
from attrs import evolve
from matplotlib import colormaps

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.figures.picture import PART_COLOUR
from iriftrace.figures.style import scale_of
from iriftrace.figures.sweep_charts import (
    rays_figure,
)
from iriftrace.figures.sweep_space import (
    sweep_face_figure,
    sweep_scene_figure,
)
from iriftrace.part.part import Part
from iriftrace.planning.summary import SweepSummary, summarise
from iriftrace.scenes import folder_of
from iriftrace.sweep.faces import face_maps_of, faces_seen
from iriftrace.sweep.reload import Surroundings, surroundings_of
from validation.inputs.sweep_tables import (
    GRID,
    known_sweep,
    with_faces,
)


@pytest.fixture(scope="module")
def summary() -> SweepSummary:
    return summarise(known_sweep())


# A tetrahedron; face i is seen by the first 3 - i poses, and the last one by none.
TETRAHEDRON = Part(
    vertices=np.array([(0.0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10)]),
    faces=np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]),
    region_of_face=np.array([0, 0, 1, 1]),
    region_names=("flat", "rest"),
    smooth_group=np.arange(4),
    path="tetrahedron.ply",
    sha256="",
    length_unit="mm",
    closed=True,
)


def faces_sweep(**more: Any) -> xr.Dataset:
    sightings = [
        [(face, 10, 1e-3 * (1 + face + pose), 20.0 + pose) for face in range(3 - pose)]
        for pose in range(3)
    ]
    return with_faces(
        known_sweep(empty=(), **more),
        [*sightings, *[[]] * 11],
        TETRAHEDRON.face_areas,
        TETRAHEDRON.region_of_face + 1,
    )


def test_faces_hit_are_counted_pose_by_pose() -> None:
    found = summarise(faces_sweep())
    assert found.faces.tolist() == [3, 2, 1, *[0] * 11]
    upper, faces, triangles = rays_figure(found).subfigs[0].axes
    assert faces.get_ylabel() == "Faces of the part seen"
    assert faces.patches[0].get_data().values.tolist() == found.faces.tolist()
    assert triangles.get_ylabel() == "Shell triangles in view"
    assert upper.get_ylabel() == "Rays that hit the part"
    assert faces_seen(faces_sweep(), "part").tolist() == found.faces.tolist()


def test_maps_of_faces_are_those_of_the_sweep() -> None:
    displacement, times, incidence = face_maps_of(faces_sweep())
    # Face 0: 1, 2, 3 um; face 1: 2, 3 um; face 2: 3 um.
    assert displacement.values == pytest.approx([2.0, 2.5, 3.0, np.nan], nan_ok=True, rel=1e-6)
    assert times.values == pytest.approx([3, 2, 1, np.nan], nan_ok=True)
    assert incidence.values == pytest.approx([20, 20, 20, np.nan], nan_ok=True)
    assert face_maps_of(known_sweep()) == ()


Meshes = list[tuple[pv.PolyData, dict[str, Any]]]


@pytest.fixture
def meshes(monkeypatch: pytest.MonkeyPatch) -> Meshes:
    """Meshes that are drawn in space, and their looks."""
    drawn: Meshes = []
    add = pv.Plotter.add_mesh

    def record(self: pv.Plotter, mesh: pv.PolyData, **look: Any) -> Any:
        drawn.append((mesh, look))
        return add(self, mesh, **look)

    monkeypatch.setattr(pv.Plotter, "add_mesh", record)
    return drawn


def test_faces_have_the_colours_of_their_numbers(meshes: Meshes) -> None:
    """Three colours of the map and the grey of the face that no pose sees, from both sides."""
    data = faces_sweep()
    _, times, _ = face_maps_of(data)
    sweep_face_figure(summarise(data), TETRAHEDRON, times)
    coloured = [mesh.cell_data["colour"] for mesh, look in meshes if look.get("rgb")]
    seen = colormaps["viridis"](times.values[:3] / 3.0)[:, :3]
    expected = np.rint(255 * np.concatenate((seen, [(201 / 255,) * 3])))
    assert len(coloured) == 2
    for colours in coloured:
        np.testing.assert_array_equal(colours, expected)
    with pytest.raises(InputError, match="4 faces and the sweep 3"):
        sweep_face_figure(summarise(data), TETRAHEDRON, evolve(times, values=np.ones(3)))


@pytest.mark.usefixtures("meshes")
def test_the_legend_of_a_scene_with_all_kinds_of_things_is_not_cut(summary: SweepSummary) -> None:
    body = TETRAHEDRON.vertices, TETRAHEDRON.faces
    all_kinds = evolve(summary, warned=np.ones((len(GRID), 1), dtype=bool))
    around = Surroundings(TETRAHEDRON, (body,), body)
    figure = sweep_scene_figure(all_kinds, all_kinds.displacement, around)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 6
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert box.y0 >= 0


def test_the_part_stands_among_the_poses(summary: SweepSummary, meshes: Meshes) -> None:
    """And each pose has its sphere in the colour of its score, or its ring without one."""
    sweep_scene_figure(summary, summary.score, Surroundings(TETRAHEDRON))
    bounds = {look.get("color"): np.reshape(mesh.bounds, (3, 2)).T for mesh, look in meshes}
    np.testing.assert_allclose(bounds[PART_COLOUR], TETRAHEDRON.bounds)
    (spheres,) = (mesh for mesh, _ in meshes if "colour" in mesh.point_data)
    known = summary.score.known
    centres = spheres.points.reshape(known.sum(), -1, 3).mean(axis=1)
    np.testing.assert_allclose(centres, summary.origins[known], atol=1e-3)
    colours = spheres.point_data["colour"].reshape(known.sum(), -1, 3)[:, 0]
    scale = scale_of(summary.score)
    np.testing.assert_array_equal(colours, np.rint(255 * scale.rgb(summary.score.values[known])))


def test_files_of_the_sweep_are_found_again() -> None:
    folder = folder_of("cylinder")
    scene, mesh = folder / "scene.xml", folder / "part.ply"
    named = {
        "scene": {"path": str(scene), "sha256": sha256_of(scene)},
        "part": {
            "path": str(mesh),
            "sha256": sha256_of(mesh),
            "length_unit": "mm",
            "to_world": np.eye(4).tolist(),
        },
    }
    found = surroundings_of(known_sweep(**named))
    assert found.missing == ()
    assert found.part is not None
    assert found.hot_air is not None
    # The outermost shell encloses the part.
    vertices, _ = found.hot_air
    assert np.all(vertices.min(axis=0) < found.part.bounds[0])
    assert np.all(vertices.max(axis=0) > found.part.bounds[1])

    named["scene"]["sha256"] = "another"
    named["part"]["path"] = "gone.ply"
    found = surroundings_of(known_sweep(**named))
    assert (found.part, found.hot_air) == (None, None)
    assert [("gone" in text, "has changed" in text) for text in found.missing] == [
        (True, False),
        (False, True),
    ]


def test_a_sweep_that_names_no_files_is_drawn_without_them() -> None:
    assert len(surroundings_of(known_sweep()).missing) == 2
