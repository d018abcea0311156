"""Figure of errors that fall with a number of steps or shells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

MOST_TICKS = 6

Curves = Mapping[str, tuple[Sequence[int], Sequence[float]]]
"""For each name, numbers of steps and the errors, all positive."""


def draw_convergence(
    path: Path, panels: Mapping[str, Curves], across: str, up: str, order: float
) -> None:
    """Errors over numbers of steps, with the expected slope.

    Parameters
    ----------
    path : Path
        Of the picture.
    panels : mapping
        Title and curves of each panel.
    across, up : str
        Labels of the axes.
    order : float
        Of the dashed line.
    """
    figure, axes = plt.subplots(
        1, len(panels), figsize=(5.2 * len(panels), 4.2), sharey=True, squeeze=False
    )
    for axis, (title, curves) in zip(axes[0], panels.items(), strict=True):
        for name, (steps, errors) in curves.items():
            axis.loglog(steps, errors, "o-", markersize=4, label=name)
        steps = np.unique(np.concatenate([steps for steps, _ in curves.values()]))
        top = max(errors[0] for _, errors in curves.values())
        guide = 2 * top * (steps / steps[0]) ** -float(order)
        axis.loglog(steps, guide, "--", color="0.6", label=f"order {order:g}")
        named = steps if len(steps) <= MOST_TICKS else steps[::2]
        axis.set_xticks(named, [str(n) for n in named])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
        axis.set_title(title)
        axis.set_xlabel(across)
        axis.legend(frameon=False, fontsize="small")
    axes[0, 0].set_ylabel(up)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
