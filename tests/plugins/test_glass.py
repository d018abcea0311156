"""A window between camera and part bends rays together with the air, or is refused."""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import Status
from iriftrace.medium.shells.hessian import PLY_COLUMNS
from iriftrace.scenes import folder_of
from validation.inputs.small_scenes import (
    AMBIENT,
    ball_in_shells,
    channels,
    part,
    ply,
    scene,
    shell,
    vector,
)

pytestmark = pytest.mark.usefixtures("variant")

THICKNESS, GLASS = 4.0, 1.5
ENGINES: dict[str, dict[str, Any]] = {
    "first_hit": {},
    "gradient_path": {"field": str(folder_of("cylinder") / "field.npz")},
}


def pane() -> trimesh.Trimesh:
    mesh = trimesh.creation.box((60.0, THICKNESS, 60.0))
    mesh.apply_translation((0.0, -60.0, 0.0))
    return mesh


def opaque(folder: Path, **bsdf: Any) -> dict[str, Any]:
    return ply(folder / "window.ply", pane(), face_normals=True, bsdf=bsdf)


def test_a_window_of_iso_shell_shifts_rays_as_snell_says(tmp_path: Path) -> None:
    """By t (tan i - tan i') at a plane behind it, with n sin i' = n_air sin i."""
    wall = trimesh.creation.box((60.0, 2.0, 50.0))
    shapes = {
        "part": part(tmp_path, wall),
        "window": shell(tmp_path, "window", pane(), AMBIENT, GLASS),
    }
    pixels = channels(scene(shapes))
    good = pixels["status.code"] == Status.GOOD
    straight = vector(pixels, "straight")[good]
    # The camera is at y = -100, and the wall's front at -1.
    tangent = np.hypot(straight[:, 0], straight[:, 2]) / 99.0
    inside = AMBIENT / GLASS * np.sin(np.arctan(tangent))
    expected = -THICKNESS * (tangent - np.tan(np.arcsin(inside)))
    away = straight[:, [0, 2]] / np.hypot(straight[:, 0], straight[:, 2])[:, None]
    found = (vector(pixels, "displacement")[good][:, [0, 2]] * away).sum(axis=1)
    assert good.sum() > 1000
    assert found == pytest.approx(expected, abs=1e-5)
    assert np.ptp(expected) > 0.3


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("bsdf", ["dielectric", "thindielectric", "roughdielectric", "null"])
def test_glass_of_mitsuba_is_refused(tmp_path: Path, bsdf: str, engine: str) -> None:
    content = {**ball_in_shells(tmp_path), "window": opaque(tmp_path, type=bsdf)}
    loaded = scene(content, type=engine, **ENGINES[engine])
    with pytest.raises(InputError, match="Light passes through shape 'window'") as caught:
        loaded.integrator().image(loaded, loaded.sensors()[0])
    assert caught.value.code == "scene.transparent"


@pytest.mark.parametrize("bsdf", ["diffuse", "conductor", "plastic", "principled"])
def test_what_reflects_alone_blocks_the_view(tmp_path: Path, bsdf: str) -> None:
    content = {**ball_in_shells(tmp_path), "window": opaque(tmp_path, type=bsdf)}
    assert set(channels(scene(content))["status.code"].ravel()) == {Status.BLOCKED}


def test_the_cells_engine_does_not_pass_over_a_window(tmp_path: Path) -> None:
    glass = shell(tmp_path, "window", pane(), AMBIENT, GLASS)
    content = {"part": part(tmp_path, trimesh.creation.box((9, 9, 9))), "window": glass}
    loaded = scene(content, type="gradient_path", **ENGINES["gradient_path"])
    with pytest.raises(InputError, match="'window' is glass, but gradient_path") as caught:
        loaded.integrator().image(loaded, loaded.sensors()[0])
    assert caught.value.code == "shells.glass"


def test_a_window_does_not_switch_off_the_bending_in_layers(tmp_path: Path) -> None:
    """Requested bending at the shells is another matter."""
    content = {name: mi.load_dict(shape) for name, shape in ball_in_shells(tmp_path).items()}
    for name, shape in content.items():
        for attribute, size in PLY_COLUMNS.items() if name != "part" else ():
            # The shells are 3 to 4 mm apart.
            values = np.array(shape.vertex_normals_buffer()) / 3.5
            values = values if size == 3 else np.zeros(shape.vertex_count())
            shape.add_attribute(f"vertex_{attribute}", size, mi.Float(values))
    content["window"] = shell(tmp_path, "window", pane(), AMBIENT, GLASS)
    with pytest.raises(InputError, match="no layers, so all rays would bend at the shells alone"):
        channels(scene(content))
    bent = channels(scene(content, bending="shells"))
    assert (bent["status.code"] == Status.GOOD).sum() > 150
