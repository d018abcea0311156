"""Distance of a scene's shells from the field they were cut from, on a sample of its rays."""

from __future__ import annotations

import math

from attrs import asdict, frozen

from iriftrace.core.errors import InputError
from iriftrace.image.differences import Hits, compare, displacement_statistics, hits_of
from iriftrace.scene.scene import Scene
from iriftrace.trace.engine import FEWEST
from iriftrace.trace.pose_image import pose_image

SAMPLE = 100_000
"""Number of pixels of the two pictures that are compared."""

MEDIAN_LIMIT, P95_LIMIT = 0.02, 0.04
"""Fractions above which more shells are advised: what 13 shells reach on the cylinder's fields."""


@frozen
class ShellError:
    """Differences between the refracted hits of the shells and of the cells engine.

    Median and 95th percentile of the distances are also stated as fractions of the displacement's,
    by the cells engine.
    """

    shells: int  # in the scene
    rays: int  # of the sample that are good with both engines
    unmatched: int  # good with only one of them
    median_mm: float
    p95_mm: float
    median_share: float
    p95_share: float

    @property
    def suffice(self) -> bool:
        """True if the shells are as good as 13 are on the cylinder's fields."""
        return self.median_share <= MEDIAN_LIMIT and self.p95_share <= P95_LIMIT

    def as_dict(self) -> dict[str, float | int | bool]:
        """Plain JSON values."""
        return {**asdict(self), "suffice": self.suffice}


def shell_error(scene: Scene, sample: int = SAMPLE) -> ShellError:
    """Trace a coarser picture through the shells and through the field data, and compare.

    The scene's engine must be ``"shells"``, and the field file that `Scene.save` puts next to the
    XML must exist. The pictures have about `sample` pixels.
    """
    if scene.compiled.engine != "shells":
        raise InputError(
            f"{scene.name} is traced through the field data, so there are no shells to check; "
            "choose the engine shells."
        )
    if scene.members:
        raise InputError(
            f"{scene.name} is an ensemble of {len(scene.members)} fields, and the shells of one "
            'are checked at a time; choose one, "-D member=1" for example.'
        )
    cells = scene.with_cells()
    compiled = scene.compiled
    if not compiled.same_field(cells.compiled):
        raise InputError(
            f"The shells of {scene.name} were cut from another field than its field file, so their "
            "difference is not their error; write the scene again."
        )
    here, reference = (_sampled(each, sample) for each in (scene, cells))
    differences = compare(here, reference)
    if differences.matched < FEWEST:
        raise InputError(
            f"Only {differences.matched} rays are good with both engines, too few to check the "
            f"shells; render at least {FEWEST}, with a larger -D scale."
        )
    size = displacement_statistics(reference)
    if not size["displacement_median"] > 0.0:
        raise InputError(
            f"The air of {scene.name} refracts no ray, so the shells have no relative error; "
            "check the field."
        )
    return ShellError(
        shells=len(compiled.tables.shell_shapes),
        rays=differences.matched,
        unmatched=differences.only_here + differences.only_reference,
        median_mm=differences.median,
        p95_mm=differences.p95,
        median_share=differences.median / size["displacement_median"],
        p95_share=differences.p95 / size["displacement_p95"],
    )


def _sampled(scene: Scene, sample: int) -> Hits:
    width, height = scene.camera.resolution
    camera = scene.camera.scaled(min(1.0, math.sqrt(sample / (width * height))))
    return hits_of(pose_image(scene, camera))
