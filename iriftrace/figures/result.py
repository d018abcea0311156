"""Figures of any result: a pose or a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import xarray as xr
from attrs import frozen
from matplotlib.figure import Figure

from iriftrace.core.errors import InputError
from iriftrace.figures.style import write_figure
from iriftrace.image.aov_image import AovImage
from iriftrace.image.displacement import NORM, Component
from iriftrace.io.exr import read_exr
from iriftrace.planning.criteria import STANDARD_CRITERIA, Criteria
from iriftrace.sweep.store import read_sweep

if TYPE_CHECKING:
    from iriftrace.tracing.render import Rendering


@frozen(eq=False)
class Plots:
    """The figures of a result.

    Attributes
    ----------
    figures
        Matplotlib figures by name; the file has the same name.
    vectors
        Names of those that `save` also writes as PDF next to the PNG.
    missing
        Figures that could not be drawn and the reasons, a sentence each.
    """

    figures: dict[str, Figure]
    vectors: frozenset[str] = frozenset()
    missing: tuple[str, ...] = ()

    def save(self, folder: str | Path) -> list[Path]:
        """Write all figures to an existing folder; files of the same names are replaced.

        Raises
        ------
        InputError
            A file cannot be written.
        """
        written = []
        for name, figure in self.figures.items():
            for suffix in (".png", ".pdf") if name in self.vectors else (".png",):
                written.append(Path(folder) / f"{name}{suffix}")
                write_figure(figure, written[-1])
        return written


def plot(
    result: AovImage | Rendering | xr.Dataset,
    *,
    criteria: Criteria = STANDARD_CRITERIA,
    name: str | None = None,
    component: Component = NORM,
) -> Plots:
    """Draw a result.

    Parameters
    ----------
    result
        A pose (an AOV image or a rendering), or a sweep (a dataset).
    criteria
        Criteria by which a sweep's poses are ranked.
    name
        Name of the figure of a pose; by default that of the file, else "displacement".
    component
        Component of a pose's displacement, see `displacement_figure`.

    Raises
    ------
    InputError
        The image has no good ray, or no pose of the sweep can be ranked.
    """
    if not isinstance(result, xr.Dataset):
        from iriftrace.figures.pose import pose_figures

        image = result if isinstance(result, AovImage) else result.image
        name = name or ("displacement" if image.origin is None else Path(image.origin.path).stem)
        return Plots(pose_figures(image, name, component=component))
    if component != NORM:
        raise InputError(
            f"A component of the displacement ({component}) can be drawn for one pose, but this is "
            "a sweep; give the EXR of a pose.",
            code="component.of_sweep",
            argument="component",
        )
    from iriftrace.figures.sweep import sweep_charts, sweep_pictures
    from iriftrace.planning.summary import summarise

    summary = summarise(result, criteria)
    charts = sweep_charts(summary)
    pictures, missing = sweep_pictures(result, summary)
    return Plots({**charts, **pictures}, frozenset(charts), missing)


def read_result(path: str | Path) -> AovImage | xr.Dataset:
    """Read an AOV image (.exr) or a sweep (.nc); raises InputError for other files."""
    suffix = Path(path).suffix.lower()
    if suffix == ".exr":
        return read_exr(path)
    if suffix != ".nc":
        raise InputError(
            f"{path} ends in neither .nc nor .exr; give a sweep or the AOV image of a "
            "pose (`iriftrace view` shows clouds, fields and parts).",
            code="file.ending",
        )
    return read_sweep(path)
