"""Figure of one ray: offset of its path through hot air from the straight one."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from iriftrace.core.arrays import FloatArray
from iriftrace.figures.style import COLOURS, finish_axes, legend_below, new_figure
from iriftrace.tracing.replay import Replay

_MARKS = ("o", "s", "x")
_MARGIN = 0.05


def ray_figure(replay: Replay) -> Figure:
    """Draw the lateral offset of a ray's paths from its straight line, over the distance along it.

    Offsets are those along two directions across the straight ray: horizontal, and upwards. The
    picture begins shortly before the first place where a path is bent.
    """
    start, along = np.array(replay.ray.origin_mm), np.array(replay.ray.direction)
    along /= np.linalg.norm(along)
    across = _across(along)
    ray = replay.ray
    figure, body = new_figure(
        8.0,
        5.6,
        f"Ray {ray.number}: {ray.device} pixel ({ray.pixel[0]:.6g}, {ray.pixel[1]:.6g})",
        "offset of the refracted ray from the straight one",
    )
    rows = body.subplots(2, 1, sharex=True)
    lines = []
    for path, colour, mark in zip(replay.paths, COLOURS, _MARKS, strict=False):
        offset = path.points - start
        distance, aside = offset @ along, 1e3 * offset @ across.T
        label = f"{path.tracer}: {path.status.text}, {path.crossings:,} crossings"
        for axes, values in zip(rows, aside.T, strict=True):
            style = {"color": colour, "marker": mark, "ms": 4, "lw": 1.2, "mfc": "none"}
            (line,) = axes.plot(distance, values, label=label, **style)
        lines.append(line)
    first, last = _extent(replay, start, along)
    margin = _MARGIN * max(last - first, 1.0)
    for axes, name in zip(rows, ("horizontal", "upwards"), strict=True):
        axes.set_ylabel(f"Offset, {name} (µm)")
        axes.set_xlim(first - margin, last + margin)
        if replay.straight is not None:
            hit = float((replay.straight - start) @ along)
            part = axes.axvline(hit, color="0.6", ls="--", lw=1.0, label="Part (straight ray)")
        finish_axes(axes)
    rows[1].set_xlabel("Distance along the straight ray (mm)")
    legend_below(figure, lines if replay.straight is None else [*lines, part], columns=2)
    return figure


def _extent(replay: Replay, start: FloatArray, along: FloatArray) -> tuple[float, float]:
    """Distances, mm, of the first place where a path is bent and of the last of all ends."""
    distances = [(path.points - start) @ along for path in replay.paths]
    firsts = [each[min(1, len(each) - 1)] for each in distances]
    return float(min(firsts)), float(max(each.max() for each in distances))


def _across(along: FloatArray) -> FloatArray:
    """Unit vectors (2, 3) across a direction: horizontal, and upwards from there."""
    level = np.cross(along, (0.0, 0.0, 1.0))
    # A vertical ray has no horizontal direction of its own.
    level = np.array((1.0, 0.0, 0.0)) if np.linalg.norm(level) < 1e-6 else level
    level /= np.linalg.norm(level)
    return np.stack((level, np.cross(level, along)))
