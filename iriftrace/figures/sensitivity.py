"""Figure of the derivative of a diameter by the air: where the air is that moves it."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from iriftrace.figures.scan import PartOutline
from iriftrace.figures.style import FAINT, SIGNED_COLOUR_MAP, ColourScale, finish_axes, new_figure
from iriftrace.measuring.two_devices.sensitivity import MOST, Sensitivity
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.part.part import Part


def sensitivity_figure(found: Sensitivity, part: Part) -> Figure:
    """Draw the effect of 1 % of the excess temperature in the camera's picture, and by distance.

    Each hexagon has the sum along the lines of sight, unless it is below `FAINT`; the curve is the
    fraction of the effects' sizes within a distance from the part.
    """
    nm = found.effect_nm
    mark = synthetic_mark(stated_source(found.scan.provenance["field"]))
    title = f"Which air moves the diameter of {found.name}" + (f" ({mark})" if mark else "")
    figure, body = new_figure(8.0, 4.4, title, f"{found.sentence}; grey: part")
    left, right = body.subplots(1, 2, width_ratios=(3, 2))
    left.set_xlabel("camera's picture (px)")
    camera = found.scan.camera
    place = camera.project(found.cells.points.astype(np.float64))
    seen = camera.holds(place) & (nm != 0.0)
    strong = seen & (np.abs(nm) > FAINT * np.abs(nm).max(initial=0.0))
    PartOutline(part, camera, place[strong] if strong.any() else found.scan.pixel).draw(left)
    u, v = place[seen].T
    ends = left.axis()
    count = 50, max(1, round(50 / math.sqrt(3.0) * abs((ends[3] - ends[2]) / (ends[1] - ends[0]))))
    extent = (min(ends[:2]), max(ends[:2]), min(ends[2:]), max(ends[2:]))
    shown = left.hexbin(
        *(u, v, nm[seen]),
        gridsize=count,
        extent=extent,
        reduce_C_function=np.sum,
        cmap=SIGNED_COLOUR_MAP,
        linewidths=0.1,
    )
    left.axis(ends)
    sums = np.asarray(shown.get_array())
    limit = max(float(np.percentile(np.abs(sums), 99)) if len(sums) else 0.0, 1e-9)
    label = "diameter by 1 % of the excess temperature (nm)"
    # The part is seen through what is as good as 0.
    shown.set_array(np.ma.masked_where(np.abs(sums) < FAINT * limit, sums))
    scale = ColourScale(sums, (-limit, limit), label, False, SIGNED_COLOUR_MAP)
    shown.set(norm=scale.norm)
    scale.add_bar(body, shown, ax=left, location="bottom")
    distances, fractions = found.by_distance
    right.plot(distances, 100.0 * fractions)
    edge = found.within(MOST)
    right.plot([0.0, edge, edge], [100.0 * MOST, 100.0 * MOST, 0.0], color="0.5", linewidth=0.8)
    right.set(
        xlabel="distance from the part (mm)",
        ylabel="fraction of the effects' sizes (%)",
        xlim=(0.0, 1.05 * found.within(0.99)),
        ylim=(0.0, 102.0),
    )
    finish_axes(right)
    return figure
