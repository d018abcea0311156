"""Surfaces drawn off screen: the plotter, the part, and meshes with too many triangles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.vtkFiltersCore import vtkBinnedDecimation

from iriftrace.errors import SetupError
from iriftrace.part import Part

# Of one surface. The time for thinning out grows with the third power of the bins along each side;
# these are about as fine as the picture's pixels and cost 0.07 s.
_MOST_TRIANGLES = 100_000
_BINS = 400

PART_COLOUR = "#ff8c1a"


@contextmanager
def off_screen(size_px: tuple[int, int]) -> Iterator[pv.Plotter]:
    """A plotter that blends in the order of drawing and needs no display.

    Raises
    ------
    SetupError
        This machine has no OpenGL that draws without a display.
    """
    # Where VTK tries several kinds of windows, it reports each one that fails.
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(
            off_screen=True, window_size=list(size_px), theme=pv.themes.DocumentTheme()
        )
        try:
            _require_opengl(plotter)
            plotter.enable_anti_aliasing("msaa", multi_samples=8)
            plotter.renderer.SetUseOIT(False)
            yield plotter
        finally:
            plotter.close()


def _require_opengl(plotter: pv.Plotter) -> None:
    # Without a working OpenGL the window stays as it is, and drawing would end the process.
    if not opens(plotter.render_window):
        raise SetupError(
            "the 3-D figure needs an OpenGL library that draws without a display, and none was "
            "found; install Mesa's EGL (on Debian and Ubuntu: apt-get install libegl1) or leave "
            "the figure out."
        )


def opens(window: Any) -> bool:
    """Whether a window of VTK has a working OpenGL."""
    window.Initialize()
    return bool(window.GetInitialized())


def add_part(plotter: pv.Plotter, part: Part) -> None:
    """Add the part with its edges sharp, as hot steel."""
    surface = thinned(surface_of(part.vertices, part.faces))
    surface = surface.clean().compute_normals(
        split_vertices=True, feature_angle=30.0, auto_orient_normals=False
    )
    plotter.add_mesh(surface, color=PART_COLOUR, smooth_shading=True, ambient=0.35, specular=0.2)


def surface_of(vertices: NDArray[Any], faces: NDArray[Any]) -> pv.PolyData:
    """Triangles as a mesh that VTK draws."""
    surface: pv.PolyData = pv.PolyData.from_regular_faces(vertices, faces)
    return surface


def thinned(surface: pv.PolyData) -> pv.PolyData:
    """The surface itself, or with vertices merged that lie in one bin, when it is huge."""
    if surface.n_cells <= _MOST_TRIANGLES:
        return surface
    thinning = vtkBinnedDecimation()
    thinning.SetInputData(surface)
    thinning.AutoAdjustNumberOfDivisionsOff()
    size = np.ptp(np.asarray(surface.bounds).reshape(3, 2), axis=1)
    divisions = np.maximum(1, np.ceil(_BINS * size / size.max())).astype(int)
    thinning.SetNumberOfDivisions(*divisions.tolist())
    thinning.SetProducePointData(True)
    thinning.Update()
    thin: pv.PolyData = pv.wrap(thinning.GetOutput())
    return thin
