"""Description of a sweep in space, with small pictures of what its poses see."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve
from matplotlib.image import imsave

from iriftrace.core.errors import InputError, SetupError
from iriftrace.figures.describe import provenance_rows
from iriftrace.figures.picture import Lines, Poses, SpacePicture
from iriftrace.figures.style import BEST_COLOUR, ColourScale, number, scale_of
from iriftrace.figures.sweep_space import surroundings_picture, towards_cameras
from iriftrace.image.aov_image import AovImage
from iriftrace.image.displacement import good_mask
from iriftrace.io.exr import read_exr
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.planning.summary import SweepSummary, extreme_images, extreme_poses, summarise
from iriftrace.sweep.faces import displacement_limits
from iriftrace.sweep.reload import surroundings_of
from iriftrace.sweep.store import attribute, file_of, included

if TYPE_CHECKING:
    import xarray as xr

WIDTH_PX = 240
MOST = 200
"""Largest number of stored images that are shown, and their width."""


def sweep_picture(dataset: xr.Dataset) -> SpacePicture:
    """Describe poses around the part, coloured by score, with maps of what they see."""
    summary = summarise(dataset)
    quantities = [summary.score, *(one for one in summary.quantities if one is not summary.score)]
    rows = tuple(
        (
            f"{summary.azimuth[pose]:.4g}",
            f"{summary.elevation[pose]:.4g}",
            *(summary.value_text(one, pose) for one in quantities),
        )
        for pose in range(len(summary.distance))
    )
    headings = (
        "azimuth (°)",
        "elevation (°)",
        *(_short(one.title, one.unit) for one in quantities),
    )
    best = summary.plan.best
    poses = Poses(
        *(summary.matrices, summary.targets, scale_of(summary.score), headings, rows, best),
        draw_maps=partial(pose_maps, dataset, summary),
    )
    sight = Lines(
        f"line of sight of pose {best}, the best by score",
        [np.stack((summary.origins[best], summary.targets[best]))],
        BEST_COLOUR,
    )
    around = surroundings_of(dataset)
    stated = {name: attribute(dataset, name) for name in ("scene", "part", "field", "ensemble")}
    source = stated_source(stated["field"])
    return evolve(
        surroundings_picture(around),
        title="Score of each camera pose",
        subtitle=summary.subtitle,
        lines=(sight,),
        poses=poses,
        towards=towards_cameras(summary.origins - summary.targets.mean(axis=0)),
        facts=provenance_rows({**dataset.attrs, **stated}, source),
        mark=synthetic_mark(source) or "",
    )


def pose_maps(dataset: xr.Dataset, summary: SweepSummary) -> tuple[dict[int, bytes], str]:
    """PNGs of the displacement in the pictures of poses, by pose, and their caption.

    The poses whose images the sweep stored, at most `MOST`, and the extreme ones, which are
    rendered again if their files still exist.
    """
    small: dict[int, np.ndarray] = {}
    include = included(dataset)
    trouble = ""
    try:
        extreme = extreme_poses(summary)
        for which, image in extreme_images(dataset, summary):
            small[extreme[which]] = _um(image, include)
    except (InputError, SetupError) as error:
        trouble = f"no picture of a pose is stored ({str(error).rstrip('.')})"
    swept = file_of(dataset)
    for pose, name in enumerate(dataset["exr"].values.tolist()):
        file = swept.parent / name if swept and name else None
        if file and file.is_file() and pose not in small and len(small) < MOST:
            small[pose] = _um(read_exr(file), include)
    if not small:
        return {}, trouble
    known = np.concatenate([um[np.isfinite(um)] for um in small.values()])
    if not len(known):
        return {}, "no pose has a good ray"
    limits = displacement_limits(known)
    scale = ColourScale(known, limits, "displacement (µm)", limits[0] > 0.0)
    low, high = (number(float(f"{end:.3g}")) for end in limits)
    caption = f"displacement, {low} (violet) to {high} µm (yellow); white: no good ray"
    return {pose: _png(um, scale) for pose, um in sorted(small.items())}, caption


def _um(image: AovImage, include: Collection[int]) -> np.ndarray:
    """Displacements, um, of every so many pixels; NaN where no ray counts."""
    step = -(-image.resolution[0] // WIDTH_PX)
    um = 1e3 * image.channels["displacement.norm"][::step, ::step].astype(np.float64)
    return np.where(good_mask(image, include)[::step, ::step], um, np.nan)


def _png(um: np.ndarray, scale: ColourScale) -> bytes:
    colours = np.ones((*um.shape, 3))
    known = np.isfinite(um)
    colours[known] = scale.rgb(um[known])
    content = BytesIO()
    imsave(content, colours, format="png")
    return content.getvalue()


def _short(title: str, unit: str) -> str:
    return title if unit.startswith("dimensionless") else f"{title} ({unit})"
