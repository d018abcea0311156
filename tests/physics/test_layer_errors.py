"""Where 13 shells bend rays wrongly in a plume: outside them all, and where a ray turns round."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.engines import camera_at
from benchmarks.layer_errors import OUTSIDE, TURNING, found_from
from benchmarks.solved_fields import SOLVED
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.shells.contour import contour_shells

FROM_ABOVE = (60.0, -190.0, 110.0)


@pytest.mark.usefixtures("variant")
def test_air_outside_the_shells_and_turns_within_a_layer_make_most_of_the_error(
    tmp_path: Path,
) -> None:
    field, part = SOLVED["wishbone"].field(tmp_path), SOLVED["wishbone"].part
    stack = contour_shells(field, 13)
    xml = write_scene(
        tmp_path / "scene", part, stack, camera_at(FROM_ABOVE), paraview=False, field=field
    )
    scenes = [load_scene(xml), load_scene(xml, engine="continuous")]
    found = found_from(field, part, scenes, FROM_ABOVE, (13, "midpoint"))
    traced = found.shells - found.engine
    # The model knows nothing of facets nor of how the rays that it asks for air are bent.
    unlike = found.share(found.without() - traced)
    assert unlike == pytest.approx((0.0, 0.0), abs=2.5)
    sizes = [np.linalg.norm(values, axis=1) for values in (traced, found.without())]
    assert np.corrcoef(*sizes)[0, 1] > 0.8
    whole, rest = found.share(found.without()), found.share(found.without(OUTSIDE, TURNING))
    assert np.all(np.array(rest) < 0.5 * np.array(whole))
