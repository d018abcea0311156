"""Rays along planes of the axes: the ray query of coherent packets must not lose them.

In a picture of odd width the central column has a direction component of exactly zero. Embree's
packet traversal then missed triangles for the whole packet: 14 % of the rays of this view.
"""

import numpy as np
import pytest

from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.rays import trace_rays
from validation.inputs.cameras import camera_at


@pytest.mark.parametrize("origin", [(310.0, 0.0, 0.0), (0.0, -238.0, 0.0), (0.0, 0.0, -238.0)])
@pytest.mark.usefixtures("variant")
def test_views_along_the_axes_lose_no_ray(origin: tuple[float, float, float]) -> None:
    """Every straight hit but those at the silhouette has a refracted one, as ray by ray."""
    scene = load_scene(folder_of("cylinder") / "scene.xml")
    camera = camera_at(origin, sensor_mm=(6.7, 5.6), resolution=(245, 205))
    image = pose_image(scene, camera=camera)
    single = trace_rays(scene, *camera.rays())
    hit = image.channels["part.face"].ravel() > 0
    np.testing.assert_array_equal(hit, single.face >= 0)
    crossings = image.channels["path.crossings"].ravel()[hit]
    np.testing.assert_array_equal(crossings, single.crossings[hit])
    np.testing.assert_array_equal(image.status.ravel()[hit], single.status[hit])
