"""The picture of bent rays, and names of devices in pictures of bundled scenes."""

import re
from itertools import combinations

import numpy as np
import pytest
from attrs import evolve
from matplotlib.backends.backend_agg import FigureCanvasAgg

from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError
from iriftrace.figures import scene as scene_module
from iriftrace.figures.draw import add_picture_to
from iriftrace.figures.picture import SpacePicture
from iriftrace.figures.scene import rays_figure, scene_figure
from iriftrace.io.shells import load_shells
from iriftrace.scenes import folder_of, shells_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays


def test_rays_are_exaggerated_by_the_factor_that_the_picture_states(
    variant: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ends are those of the same rays traced again; balls lie at both ends."""
    drawn: list[SpacePicture] = []

    def draw(plotter: object, picture: SpacePicture) -> None:
        drawn.append(picture)
        add_picture_to(plotter, picture)

    monkeypatch.setattr(scene_module, "add_picture_to", draw)
    scene = load_scene(
        folder_of("cylinder") / "scene.xml", {"scale": 0.1}, variant=variant, engine="shells"
    )
    figure = rays_figure(scene)
    stated = re.search(
        r"up to ([\d.]+) µm, drawn ([\d,]+) times", " ".join(t.get_text() for t in figure.texts)
    )
    assert stated
    largest_um, factor = float(stated[1]), float(stated[2].replace(",", ""))
    (picture,) = drawn
    straight, bent = (np.array(lines.paths) for lines in picture.lines)
    start, aim = straight[:, 0], straight[:, -1]
    along = (aim - start) / np.linalg.norm(aim - start, axis=1)[:, None]
    hits = trace_rays(scene, start, along)
    displaced = hits.refracted - hits.straight
    displaced -= np.einsum("ij,ij->i", displaced, along)[:, None] * along
    np.testing.assert_allclose(bent[:, -1] - aim, factor * displaced, atol=2e-6 * factor)
    size_um = 1e3 * np.linalg.norm(displaced, axis=1).max()
    assert largest_um == pytest.approx(size_um, rel=0.01)
    balls = {surface.name: surface.vertices for surface in picture.surfaces}
    for lines in picture.lines:
        middles = balls[lines.name].reshape(len(lines.paths), -1, 3).mean(axis=1)
        np.testing.assert_allclose(middles, [path[-1] for path in lines.paths], atol=0.1)


def test_a_camera_that_looks_away_has_no_rays(variant: str) -> None:
    scene = load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.1}, variant=variant)
    behind = 2.0 * scene.camera.origin - scene.part.centre
    away = scene.camera.at(look_at(scene.camera.origin, behind))
    turned = evolve(scene, camera=away)
    with pytest.raises(InputError, match="no rays to draw"):
        rays_figure(turned)


@pytest.mark.parametrize("name", ["cylinder", "cylinder_paper", "fringe_cylinder", "bevel_gear"])
def test_names_of_devices_do_not_touch(variant: str, name: str) -> None:
    scene = load_scene(folder_of(name) / "scene.xml", {"scale": 0.1}, variant=variant)
    figure = scene_figure(scene.part, load_shells(shells_of(name)), scene.camera, scene.second)
    renderer = FigureCanvasAgg(figure).get_renderer()
    names = [t for t in figure.axes[0].texts if re.match("Camera|Near|Far|Projector", t.get_text())]
    assert len(names) >= 2
    for one, other in combinations([text.get_window_extent(renderer) for text in names], 2):
        assert not one.overlaps(other)
