"""Shells that bend nothing must change nothing: the noise floor of the tracer."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.image.aov_image import Status
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from validation.sections.noise_floor import matched_scene


@pytest.mark.usefixtures("variant")
def test_index_matched_shells_of_the_real_scene_displace_nothing(tmp_path: Path) -> None:
    """Displacement <= 1e-9 mm at every pixel, no ray lost, none miscounted.

    Beside an edge the two rays' queries may name different faces; both hits are then moved to the
    face that is really met, so that not even the edges of the facets are an exception.
    """
    image = pose_image(matched_scene(tmp_path / "scene", 0.25))
    status = image.status
    assert set(np.unique(status)) == {Status.GOOD, Status.MISSED, Status.OUT_OF_FOCUS}
    hit = status != Status.MISSED
    assert image.channels["displacement.norm"].max() <= 1e-9
    # Crossings: the real shells bend rays by micrometres, so nearly all meet the same triangles,
    # and there the index steps must add up, but for the ray that the ledger knows (1 of 289,111).
    real = pose_image(load_scene(folder_of("cylinder_paper") / "scene.xml", {"scale": 0.25}))
    assert (real.status == Status.INDEX_MISMATCH).sum() <= 1
    crossings = (image.channels["path.crossings"], real.channels["path.crossings"])
    assert (crossings[0] != crossings[1])[hit].mean() < 1e-3
    assert np.abs(image.channels["shift.px.X"][hit]).max() < 1e-6
