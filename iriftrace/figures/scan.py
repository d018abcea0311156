"""Figure of a simulated measurement: what a deviation map against the CAD model would show."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from iriftrace.field.origin import synthetic_mark
from iriftrace.figures.style import finish_axes, new_figure
from iriftrace.triangulation.scan import Scan, ScanStatus

UM_PER_MM = 1000.0


def scan_figure(scan: Scan) -> Figure:
    """Draw the error along the part's normal, in the camera's picture and as a histogram.

    Colours are symmetric about 0 up to the 99th percentile of the errors' sizes; pixels on the part
    that were not measured are grey.
    """
    error = UM_PER_MM * scan.error_normal
    low, middle, high = np.percentile(error, (5, 50, 95))
    mark = synthetic_mark(scan.provenance["assumptions"]["field_origin"])
    marked = f" ({mark})" if mark else ""
    figure, body = new_figure(
        8.0,
        4.4,
        f"What hot air adds to a {scan.system} measurement{marked}",
        f"median {middle:.2g} µm, 5th to 95th percentile {low:.2g} to {high:.2g} µm along the "
        "part's normal; grey: on the part, not measured",
    )
    left, right = body.subplots(1, 2, width_ratios=(3, 2))
    limit = float(np.percentile(np.abs(error), 99))
    picture = np.full(scan.status.shape, np.nan)
    picture[scan.status == ScanStatus.MEASURED] = error
    lost = np.isin(scan.status, (ScanStatus.MEASURED, ScanStatus.NOT_SEEN), invert=True)
    left.imshow(np.where(lost, 1.0, np.nan), cmap="Greys", vmin=0.0, vmax=3.0)
    shown = left.imshow(picture, cmap="RdBu_r", vmin=-limit, vmax=limit, interpolation="none")
    rows, columns = np.nonzero(np.isfinite(picture) | lost)
    left.set_xlim(columns.min() - 2, columns.max() + 2)
    left.set_ylim(rows.max() + 2, rows.min() - 2)
    left.set_axis_off()
    body.colorbar(shown, ax=left, orientation="horizontal", label="error along the normal (µm)")
    _, _, left_over = scan.best_fit()
    bins = np.linspace(-1.5 * limit, 1.5 * limit, 61)
    for values, name in ((error, "as measured"), (UM_PER_MM * left_over, "after best fit")):
        right.hist(values.clip(bins[0], bins[-1]), bins, histtype="step", label=name)
    right.axvline(0.0, color="0.5", linewidth=0.8)
    right.set_xlabel("error along the normal (µm)")
    right.set_ylabel("points")
    right.legend(fontsize="small")
    finish_axes(right)
    return figure
