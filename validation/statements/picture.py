"""One small picture of each component."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve
from matplotlib.image import imread, imsave

from iriftrace.figures.pose import displacement_figure
from iriftrace.figures.style import write_figure
from iriftrace.figures.sweep_space import sweep_face_figure
from iriftrace.planning.criteria import THE_PAPERS
from iriftrace.planning.rank import rank_poses
from iriftrace.planning.summary import summarise
from iriftrace.sweep.faces import FaceMap
from iriftrace.sweep.reload import load_swept_scene
from validation.statements.orbit import Swept

_PERCENTILES = (2.0, 98.0)


def draw_faces(swept: Swept, path: Path) -> None:
    """Draw the median displacement on each face over the poses that do not look down the plume."""
    values = swept.face_medians_um(swept.beside_plume)
    low, high = np.nanpercentile(values, _PERCENTILES)
    shown = FaceMap(
        "displacement",
        "Displacement on each face, poses below 45° elevation",
        "Median displacement (µm)",
        values,
        (float(low), float(high)),
    )
    summary = summarise(swept.dataset, THE_PAPERS)
    write_figure(sweep_face_figure(summary, swept.part, shown), path)
    _halve(path)


def draw_best_pose(swept: Swept, path: Path, region: str) -> None:
    """Draw what the best pose for a region sees."""
    best = rank_poses(swept.dataset, evolve(THE_PAPERS, region=region)).best
    matrix = swept.dataset["matrix"].values[best]
    image = load_swept_scene(swept.dataset, best).render(matrix).image
    write_figure(displacement_figure(image), path)
    _halve(path)


def _halve(path: Path) -> None:
    """Half the size is enough on the page."""
    picture = imread(path)[:, :, :3]
    rows, columns = (2 * (size // 2) for size in picture.shape[:2])
    quarters = picture[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2, 3)
    imsave(path, quarters.mean(axis=(1, 3)))
