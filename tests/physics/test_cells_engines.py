"""The two engines on a real field: each kind of shells converges to its own continuous solution."""

import numpy as np
import pytest

from iriftrace.camera.pose import look_at
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.scenes import folder_of
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at
from validation.inputs.solved_fields import DATA, in_tetrahedra

pytestmark = pytest.mark.slow

FIELD = DATA / "cylinder_A.vtu"
CAMERA = camera_at(
    (60.0, -190.0, 110.0), sensor_mm=(6.7, 5.6), resolution=(306, 256), focus_mm=(50.0, 350.0)
)
LAYERS = (5, 13, 30)

Images = dict[tuple[int | str, str], AovImage]


@pytest.fixture(scope="module")
def field() -> IndexField:
    return read_field(FIELD)


@pytest.fixture(scope="module")
def images(variant: str, tmp_path_factory: pytest.TempPathFactory, field: IndexField) -> Images:
    """The oblique view by shells and by the cells engine, with either kind of gradient."""
    part = read_part(folder_of("cylinder") / "part.ply")
    found: Images = {}
    # The engine splits the solver's hexahedra, in whose own surfaces facets have other slopes.
    for normals, cut in (("gradient", field), ("facet", in_tetrahedra(field))):
        for layers in LAYERS:
            folder = tmp_path_factory.mktemp(f"shells_{layers}")
            stack = contour_shells(cut, layers)
            volume = field if layers == LAYERS[0] else None
            xml = write_scene(folder, part, AirState(volume, ready=stack), CAMERA, paraview=False)
            found[layers, normals] = pose_image(load_scene(xml, {"normals": normals}))
            if volume is not None:
                scene = load_scene(xml, {"normals": normals}, engine="cells")
                found["cells", normals] = pose_image(scene)
    return found


def difference_um(images: Images, one: tuple, other: tuple) -> np.ndarray:
    """Distances between the hits of rays that are good in all pictures."""
    good = np.all([image.status == Status.GOOD for image in images.values()], axis=0)
    vectors = [images[key].vector("displacement", good) for key in (one, other)]
    return np.linalg.norm(vectors[0] - vectors[1], axis=1) * 1e3


@pytest.fixture(scope="module")
def both_engines(
    variant: str, tmp_path_factory: pytest.TempPathFactory, field: IndexField
) -> dict[str, Scene]:
    """Thirteen shells with gradient normals, and the field that they were cut from."""
    part = read_part(folder_of("cylinder") / "part.ply")
    stack = contour_shells(field, 13)
    folder = tmp_path_factory.mktemp("thirteen")
    xml = write_scene(folder, part, AirState(field, ready=stack), CAMERA, paraview=False)
    return {engine: load_scene(xml, engine=engine) for engine in ("shells", "cells")}


@pytest.mark.parametrize(
    "origin",
    [(150.0, -100.0, 120.0), (0.0, -160.0, 160.0), (235.0, 0.0, 0.0), (60.0, -190.0, 110.0)],
    ids=["corner", "above", "axis", "oblique"],
)
def test_thirteen_gradient_shells_agree_with_the_continuous_solution(
    both_engines: dict[str, Scene], origin: tuple[float, float, float]
) -> None:
    camera = CAMERA.at(look_at(origin, (0.0, 0.0, 0.0)))
    shells, field = (pose_image(scene, camera=camera) for scene in both_engines.values())
    good = (shells.status == Status.GOOD) & (field.status == Status.GOOD)
    exact = field.vector("displacement", good)
    norm = np.linalg.norm(exact, axis=1)
    off = np.linalg.norm(shells.vector("displacement", good) - exact, axis=1)
    assert np.median(off) < 0.02 * np.median(norm)
    assert np.quantile(off, 0.95) < 0.03 * np.quantile(norm, 0.95)


def test_faceted_shells_converge_to_the_constant_gradient(images: Images) -> None:
    """And not to the recovered one, from which they stay far away."""
    limit, other = ("cells", "facet"), ("cells", "gradient")
    off = [np.median(difference_um(images, (n, "facet"), limit)) for n in LAYERS]
    assert off[1] < 0.6 * off[0]
    assert off[2] < 0.55 * off[1]
    assert off[2] < 0.4 * np.median(difference_um(images, (30, "facet"), other))


def test_gradient_shells_converge_to_the_recovered_gradient(images: Images) -> None:
    limit, other = ("cells", "gradient"), ("cells", "facet")
    for layers in LAYERS:
        near = np.median(difference_um(images, (layers, "gradient"), limit))
        assert near < 0.15 * np.median(difference_um(images, (layers, "gradient"), other))


def test_no_ray_is_lost(images: Images) -> None:
    shells = images[13, "gradient"].status
    for normals in ("gradient", "facet"):
        image = images["cells", normals]
        counts = image.header["counts"]
        assert counts["relocated"] == counts["open_boundary"] == 0
        assert not np.isin(image.status, (Status.GAVE_UP, Status.INDEX_MISMATCH)).any()
        # At most a few of the silhouette's rays end elsewhere.
        assert (image.status != shells).sum() <= 3


def test_error_channel_is_the_difference_of_the_two_gradients(images: Images) -> None:
    """To first order: it is summed up along one of the two rays."""
    constant = images["cells", "facet"]
    good = np.all([image.status == Status.GOOD for image in images.values()], axis=0)
    good &= constant.channels["incidence.angle"] < np.radians(80)
    found = constant.channels["path.error"][good] * 1e3
    between = constant.vector("displacement", good) - images["cells", "gradient"].vector(
        "displacement", good
    )
    expected = np.linalg.norm(between, axis=1) * 1e3
    np.testing.assert_allclose(found, expected, rtol=0.05, atol=0.04)
    assert np.median(np.abs(found - expected)) < 0.01 * np.median(expected)
    assert np.isfinite(constant.channels["path.error"]).all()
