"""The integrator gradient_path: from XML and by option, its channels, and what it refuses."""

import re
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import CHANNELS, ERROR_CHANNEL, Status
from iriftrace.io.exr import read_exr
from iriftrace.io.field_npz import FIELD_FILE, load_field_file, save_field_file
from iriftrace.medium.path_data import cells_of
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.plugins.calibrated_camera import sensor_of
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import is_inside, trace_rays
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.inputs.shell_fields import AMBIENT, HOTTEST, field_of, hexahedra, sphere_field

pytestmark = pytest.mark.usefixtures("variant")

CAMERA = camera_at((0.0, -60.0, 5.0), resolution=(192, 160))


@pytest.fixture(scope="module")
def part() -> Part:
    ball = trimesh.creation.icosphere(2, 4.0)
    return part_of_mesh(ball.vertices, ball.faces, name="ball")


@pytest.fixture(scope="module")
def xml(tmp_path_factory: pytest.TempPathFactory, part: Part) -> Path:
    """A ball in air that is hottest in its centre, with 8 shells and the field itself."""
    field = sphere_field(16)
    shells = contour_shells(field, 8)
    return write_scene(
        tmp_path_factory.mktemp("ball"),
        part,
        AirState(field, ready=shells),
        CAMERA,
        paraview=False,
    )


def without_field(xml: Path, folder: Path, integrator: str = "") -> Path:
    """A copy of the scene, without its field file, with another integrator if one is given."""
    import shutil

    shutil.copytree(xml.parent, folder, dirs_exist_ok=True)
    (folder / FIELD_FILE).unlink()
    copy = folder / "scene.xml"
    if integrator:
        text = copy.read_text()
        start, end = text.index("<integrator"), text.index("</integrator>")
        text = text[:start] + integrator + text[end + len("</integrator>") :]
        copy.write_text(re.sub(r' *<default name="(normals|bending)".*\n', "", text))
    return copy


def test_engines_agree_on_the_ball(xml: Path) -> None:
    shells = render_scene(load_scene(xml)).image
    continuous = render_scene(load_scene(xml, engine="cells")).image
    np.testing.assert_array_equal(shells.status, continuous.status)
    good = (shells.status == 0) & (shells.channels["incidence.angle"] < np.radians(70))
    assert good.sum() > 600
    for name in ("straight.X", "incidence.angle", "part.face"):
        np.testing.assert_array_equal(shells.channels[name], continuous.channels[name])
    norm = continuous.channels["displacement.norm"][good]
    off = np.linalg.norm(
        shells.vector("displacement", good) - continuous.vector("displacement", good), axis=1
    )
    # Cells of 1.5 mm around a ball of 4 mm: both are several per cent off the truth.
    assert np.median(off) < 0.05 * np.median(norm)
    error = continuous.channels[ERROR_CHANNEL]
    assert (error[continuous.status == Status.MISSED] == 0).all()
    assert 0.001 * np.median(norm) < np.median(error[good]) < 0.3 * np.median(norm)
    assert (continuous.channels["path.crossings"][good] > 10).all()


def test_faceted_shells_of_the_engines_own_cells_converge_to_the_constant_gradient(
    tmp_path: Path, part: Part
) -> None:
    """Eight times as many shells take at least a quarter of the difference away."""
    field = sphere_field(10)
    corners = tetrahedra_of(field.grid).corners.astype(np.int64)
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: corners}, np.asarray(field.grid.points))
    field = evolve(field, grid=grid)
    random = np.random.default_rng(0)
    origins = np.column_stack((random.uniform(-2, 2, (1000, 2)), np.full(1000, 60.0)))
    directions = np.tile((0.0, 0.0, -1.0), (1000, 1))

    def hits(layers: int, engine: str) -> np.ndarray:
        shells = contour_shells(field, layers, min_size_mm=0.0)
        folder = tmp_path / str(layers)
        xml = write_scene(folder, part, AirState(field, ready=shells), CAMERA, paraview=False)
        scene = load_scene(xml, {"normals": "facet"}, engine=engine)
        return trace_rays(scene, origins, directions).refracted

    limit = hits(10, "cells")
    few, many = (np.median(np.linalg.norm(hits(n, "shells") - limit, axis=1)) for n in (10, 80))
    assert many < 0.75 * few


def test_xml_names_the_integrator_and_a_field_beside_it(xml: Path, tmp_path: Path) -> None:
    """The file is found as seen from the scene, and gives what the option gives."""
    copy = without_field(
        xml,
        tmp_path,
        '<integrator type="gradient_path"><string name="field" value="air/my.npz"/></integrator>',
    )
    (tmp_path / "air").mkdir()
    (tmp_path / "air" / "my.npz").write_bytes((xml.parent / FIELD_FILE).read_bytes())
    own, asked = (
        render_scene(load_scene(p, engine=e)).image for p, e in ((copy, "auto"), (xml, "cells"))
    )
    assert own.header["engine"] == asked.header["engine"] == "cells"
    for name, plane in own.channels.items():
        np.testing.assert_array_equal(plane, asked.channels[name])
    # And back to shells by option.
    assert load_scene(copy, engine="shells").compiled.engine == "shells"


@pytest.mark.filterwarnings("ignore::iriftrace.IriftraceWarning")
def test_another_working_folder_later_on_changes_nothing(
    xml: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The field of a project that happened to lie there was read, or a name without folder."""
    monkeypatch.chdir(xml.parent)
    loaded = load_scene(xml.name)
    assert loaded.name == xml.name
    integrator = mi.load_dict({"type": "gradient_path"})
    monkeypatch.chdir(tmp_path)
    assert integrator.air.cells is not None
    through_cells = loaded.through_cells
    assert through_cells is not None
    own, asked = (
        render_scene(scene).image for scene in (through_cells, load_scene(xml, engine="cells"))
    )
    np.testing.assert_array_equal(own.status, asked.status)
    assert own.header["scene"] == asked.header["scene"]


@pytest.mark.parametrize(
    ("normals", "gradient"), [("gradient", "recovered"), ("facet", "constant")]
)
def test_each_kind_of_normals_has_its_gradient(xml: Path, normals: str, gradient: str) -> None:
    loaded = load_scene(xml, {"normals": normals}, engine="cells")
    assert loaded.compiled.integrator.gradient == gradient
    assert loaded.compiled.normals == f"{gradient} gradient"


def test_error_channel_survives_the_file(xml: Path, tmp_path: Path) -> None:
    rendering = render_scene(load_scene(xml, engine="cells"))
    exr, _ = rendering.save(tmp_path / "out.exr")
    back = read_exr(exr)
    assert tuple(back.channels) == (*CHANNELS, ERROR_CHANNEL)
    np.testing.assert_array_equal(
        back.channels[ERROR_CHANNEL], rendering.image.channels[ERROR_CHANNEL]
    )


def test_mitsuba_renders_all_channels(xml: Path) -> None:
    loaded = load_scene(xml, engine="cells")
    compiled = loaded.compiled
    planes = np.array(mi.render(compiled.mitsuba_scene, integrator=compiled.integrator))
    image = render_scene(loaded).image
    for k, name in enumerate(image.channels):
        np.testing.assert_array_equal(planes[..., k + 1], image.channels[name])


def test_scene_without_a_field_file_says_how_to_get_one(xml: Path, tmp_path: Path) -> None:
    copy = without_field(xml, tmp_path)
    with pytest.raises(InputError, match=r"no file .*field\.npz.*`iriftrace scene"):
        load_scene(copy, engine="cells")
    assert load_scene(copy).compiled.engine == "shells"


@pytest.mark.parametrize(
    ("integrator", "message"),
    [
        ('<float name="field" value="1"/>', '"field" is'),
        ('<string name="gradient" value="smooth"/>', "recovered, constant"),
        ('<integer name="max_steps" value="0"/>', "max_steps"),
    ],
)
def test_wrong_parameters_are_refused(
    xml: Path, tmp_path: Path, integrator: str, message: str
) -> None:
    copy = without_field(
        xml, tmp_path, f'<integrator type="gradient_path">{integrator}</integrator>'
    )
    with pytest.raises(InputError, match=message):
        load_scene(copy)


def test_unknown_engine_is_refused(xml: Path) -> None:
    with pytest.raises(InputError, match="no engine 'fast'; use one of auto, shells, cells"):
        load_scene(xml, engine="fast")


def test_shells_of_another_field_are_warned_of(xml: Path, tmp_path: Path) -> None:
    copy = without_field(xml, tmp_path)
    field = sphere_field(8)
    object.__setattr__(field.source, "sha256", "1" * 64)
    try:
        save_field_file(field, tmp_path / FIELD_FILE)
    finally:
        object.__setattr__(field.source, "sha256", "0" * 64)
    with pytest.warns(IriftraceWarning, match="from another field"):
        load_scene(copy, engine="cells")


def test_field_file_holds_the_field_bit_for_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("iriftrace.medium.ambient.AMBIENT_SHARE", 0.0)
    field = sphere_field(6)
    before, after = cells_of(field), load_field_file(save_field_file(field, tmp_path / "f.npz"))
    for name in ("points", "refractivity", "celltypes", "cell_offsets", "cell_connectivity"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
        assert getattr(after, name).dtype == getattr(before, name).dtype
    np.testing.assert_array_equal(after.cell_offsets, field.grid.cell_offsets)
    assert (after.air, after.ambient, after.source) == (before.air, before.ambient, before.source)
    assert after.ambient == AMBIENT


def test_cells_of_ambient_air_are_left_out(
    tmp_path: Path, part: Part, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Light runs straight there, also where the mesh is folded: only the cells passed are fewer.

    Gradients at the last points that are not ambient are then those of one side.
    """
    grid = hexahedra(16, 12.0)
    depth = np.maximum(1 - np.linalg.norm(grid.points, axis=1) / 10, 0)
    field = field_of(grid, AMBIENT + (HOTTEST - AMBIENT) * depth**2)
    points = np.asarray(field.grid.points).copy()
    ambient = np.abs(points).max(axis=1) == 12.0
    assert (field.refractivity[ambient] == AMBIENT).all()
    shells = contour_shells(field, 8)

    def displacements(name: str) -> tuple[np.ndarray, np.ndarray]:
        xml = write_scene(
            tmp_path / name, part, AirState(field, ready=shells), CAMERA, paraview=False
        )
        image = render_scene(load_scene(xml, engine="cells")).image
        good = image.status == Status.GOOD
        return image.vector("displacement", good), image.channels["path.crossings"][good]

    fewer, few = displacements("fewer")
    field.grid.points[ambient] *= np.random.default_rng(3).uniform(0.7, 1.3, (ambient.sum(), 1))
    np.testing.assert_array_equal(displacements("folded")[0], fewer)
    field.grid.points[:] = points
    monkeypatch.setattr("iriftrace.medium.ambient.AMBIENT_SHARE", 0.0)
    whole, all_of_them = displacements("whole")
    change, moved = (np.linalg.norm(vectors, axis=1) for vectors in (fewer - whole, whole))
    assert np.percentile(change, 95) < 2e-3 * np.median(moved)
    assert few.mean() < 0.9 * all_of_them.mean()


@pytest.mark.parametrize("kept", [0, 10, 500, 0.5, 0.999])
def test_damaged_field_file_is_refused(xml: Path, tmp_path: Path, kept: float) -> None:
    whole = (xml.parent / FIELD_FILE).read_bytes()
    size = kept if isinstance(kept, int) else int(kept * len(whole))
    (tmp_path / "f.npz").write_bytes(whole[:size])
    with pytest.raises(InputError, match="cannot be read"):
        load_field_file(tmp_path / "f.npz")


def test_field_file_whose_cells_lack_points_is_refused(xml: Path, tmp_path: Path) -> None:
    with np.load(xml.parent / FIELD_FILE) as content:
        arrays = dict(content)
    arrays["points"] = arrays["points"][:-1]
    np.savez(tmp_path / "f.npz", **arrays)
    with pytest.raises(InputError, match="its cells do not fit its points"):
        load_field_file(tmp_path / "f.npz")


def test_camera_in_the_datas_cool_corner_sees_what_one_outside_sees(
    tmp_path: Path, part: Part
) -> None:
    """The field, not the shells, tells whether the camera stands in hot air."""
    field = sphere_field(24, half=40.0)
    xml = write_scene(tmp_path, part, AirState(field, layers=5), CAMERA, paraview=False)
    loaded = load_scene(xml, engine="cells")
    places = [(0.0, -60.0, 0.0), (0.0, -30.0, 0.0), (0.0, -8.0, 1.0), (0.0, 0.0, 1.0)]
    np.testing.assert_array_equal(is_inside(loaded, places), (False, False, True, True))
    directions = np.array([[0.0, 1.0, 0.0], [0.02, 1.0, 0.03], [-0.05, 1.0, 0.01]])
    far, near = (
        trace_rays(loaded, directions * (at / directions[:, 1:2]), directions)
        for at in (-60.0, -30.0)
    )
    assert (near.status == 0).all()
    np.testing.assert_allclose(near.refracted, far.refracted, atol=1e-9)
    assert np.linalg.norm(near.displacement[1:], axis=1).min() > 1e-6
    with pytest.raises(InputError, match="inside the hot air"):
        render_scene(loaded, camera=CAMERA.at(look_at((0, -8.0, 0), (0, 0, 0))))
    with pytest.raises(InputError, match="inside the part"):
        render_scene(loaded, camera=CAMERA.at(look_at((0, -2.0, 0), (0, 0, 0))))


def test_plume_that_leaves_the_data_is_counted(tmp_path: Path, part: Part) -> None:
    """Rays that come in through the top, where the air is hot, are marked and stay good."""

    def hot_above(points: np.ndarray) -> np.ndarray:
        height = np.clip((points[:, 2] + 12) / 24, 0, 1)
        return AMBIENT * (1 - 0.5 * height)

    field = field_of(hexahedra(12, 12.0), hot_above)
    camera = CAMERA.at(look_at((0.0, -30.0, 50.0), (0.0, 0.0, 0.0)))
    xml = write_scene(tmp_path, part, AirState(field, layers=5), camera, paraview=False)
    image = render_scene(load_scene(xml, engine="cells")).image
    assert (image.status == 0).sum() > 600
    assert image.header["counts"]["open_boundary"] == (image.status == 0).sum()


def test_second_pose_compiles_no_kernel(xml: Path, kernel_history: Any) -> None:
    loaded = load_scene(xml, engine="cells")
    scene, integrator = loaded.compiled.mitsuba_scene, loaded.compiled.integrator

    def look(origin: tuple[float, float, float]) -> None:
        sensor = sensor_of(CAMERA.at(look_at(origin, (0.0, 0.0, 0.0))))
        assert integrator.surroundings(scene, sensor) is None
        integrator.image(scene, sensor)

    look((0.0, -60.0, 5.0))
    look((30.0, -40.0, 15.0))
    kernel_history()
    for x in range(4):
        look((-50.0, 10.0 * x, 40.0))
    launched = kernel_history()
    assert len(launched) > 10
    assert not [k for k in launched if not k["cache_hit"] or k["cache_disk"]]
