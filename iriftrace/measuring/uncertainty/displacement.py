"""Uncertainty of what one camera sees: of each pixel's displacement, and of its statistics."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from attrs import evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, Float32Array, FloatArray
from iriftrace.core.blocks import blocks
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import U_CHANNEL, AovImage
from iriftrace.image.displacement import good_mask
from iriftrace.measuring.uncertainty.air_groups import AirGroups
from iriftrace.measuring.uncertainty.budget import Contribution, Uncertainty, uncertainty_of
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.tracing.render import Rendering, render_scene
from iriftrace.tracing.scene import Scene, ready_scene

_AXES = tuple(f"displacement.{axis}" for axis in "XYZ")
_SHIFT = ("shift.px.X", "shift.px.Y")

_VECTORS = slice(0, 3), slice(3, 5)
"""Rows of the displacement's axes and of the shift's among the channels."""

STATISTICS = {"median": 50.0, "95th percentile": 95.0}
"""Percentiles of a pose that have an uncertainty."""


@frozen(eq=False)
class PoseUncertainty:
    """A pose with the uncertainty of its displacement.

    Attributes
    ----------
    rendering : Rendering
        Its image has the channel `U_CHANNEL`.
    displacement_mm, shift_px : dict of Uncertainty
        Of the percentiles `STATISTICS` over the pixels that are good in all members, by name.
    """

    rendering: Rendering
    displacement_mm: dict[str, Uncertainty]
    shift_px: dict[str, Uncertainty]


def render_with_uncertainty(
    scene: Scene,
    inputs: Inputs,
    *,
    camera: Camera | None = None,
    include: Collection[int] = (0,),
) -> PoseUncertainty:
    """Trace a pose as :func:`iriftrace.render_scene`, with the uncertainty of its displacement.

    Raises
    ------
    InputError
        As `render_scene`, and if nothing is known of the uncertainty of the air.
    """
    ready = ready_scene(scene)
    groups = AirGroups.of(ready, inputs)
    if inputs.of_pose:  # which is computed for two devices only
        groups = evolve(groups, missing=(*groups.missing, "position and rotation of the camera"))
    if not groups.known:
        raise InputError(
            "Nothing is known of the uncertainty of the air; state that of its contrast, or make "
            "the scene of several fields.",
            code="uncertainty.nothing_known",
            argument="uncertainty",
        )
    images: list[tuple[BoolArray, Float32Array]] = []

    def keep(_: int, image: AovImage) -> None:
        planes = [image.channels[name] for name in (*_AXES, *_SHIFT)]
        images.append((good_mask(image, tuple(include)), np.stack(planes)))

    rendering = render_scene(ready, camera=camera, include=include, each=keep)
    good = np.logical_and.reduce([mask for mask, _ in images])
    if not good.any():
        raise InputError(
            "No pixel is good in the air of every member, so no displacement has an uncertainty; "
            "see which rays are lost in a picture of one member.",
            code="uncertainty.no_pixel",
        )
    values = np.stack([planes[:, good] for _, planes in images])
    images.clear()
    u, lengths = np.empty(values.shape[2], dtype=np.float32), np.empty((2, values.shape[2]))
    for pixels in blocks(len(u)):
        block = values[..., pixels].astype(np.float64)
        members = None if groups.weights is None else block[:, :3]
        mean = block[0] if groups.weights is None else groups.weights.mean(block)
        u[pixels] = np.linalg.norm(groups.total(mean[:3], members), axis=0)
        lengths[:, pixels] = [np.linalg.norm(mean[rows], axis=0) for rows in _VECTORS]
    plane = np.zeros(good.shape, dtype=np.float32)
    plane[good] = u
    image = evolve(rendering.image, channels={**rendering.image.channels, U_CHANNEL: plane})
    displacement, shift = (
        _statistics(groups, mean, [one[rows] for one in values])
        for mean, rows in zip(lengths, _VECTORS, strict=True)
    )
    return PoseUncertainty(evolve(rendering, image=image), displacement, shift)


def _statistics(
    groups: AirGroups, mean: FloatArray, by_member: Sequence[Float32Array]
) -> dict[str, Uncertainty]:
    """Percentiles, with uncertainties, of the mean's lengths (n,), by vectors (c, n) of members."""
    sources, found = groups.sources(), {}
    percentiles = list(STATISTICS.values())
    rows = [np.percentile(np.linalg.norm(v.astype(float), axis=0), percentiles) for v in by_member]
    for number, (name, percentile) in enumerate(STATISTICS.items()):
        value = float(np.percentile(mean, percentile))
        members = None if groups.weights is None else np.array(rows)[:, number]
        parts = groups.parts(value, members)
        listed = [Contribution(group, float(u), "B", sources[group]) for group, u in parts.items()]
        found[name] = uncertainty_of(value, listed, groups.mixture(members), groups.missing)
    return found
