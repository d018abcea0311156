"""Studies of cost: times against the number of rays, and of triangles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from attrs import evolve
from scipy.spatial import cKDTree

from iriftrace.core.errors import InputError
from iriftrace.field.index_field import IndexField
from iriftrace.geometry.triangles import polydata
from iriftrace.shells.edit import subdivide_midpoint
from iriftrace.shells.stack import Shell, ShellStack
from iriftrace.studies.modes import Mode, shells_of, some_shells_of
from iriftrace.studies.picture import View
from iriftrace.studies.study import Axis, Study, source_of


def rays_study(
    field: IndexField,
    view: View,
    scales: Sequence[float],
    modes: Sequence[Mode],
    *,
    layers: int = 13,
) -> Study:
    """Time the stages of one picture at several resolutions.

    Parameters
    ----------
    field : IndexField
    view : View
        With the camera at its full resolution.
    scales : sequence of float
        Factors on the resolution.
    modes : sequence of Mode
    layers : int
        Number of shells.

    Raises
    ------
    InputError
        If two scales give the same number of rays.
    """
    cameras = [view.camera.scaled(scale) for scale in scales]
    rays = [camera.resolution[0] * camera.resolution[1] for camera in cameras]
    if not rays or len(set(rays)) < len(rays):
        raise InputError(
            f"The scales {', '.join(f'{scale:g}' for scale in scales) or 'none'} give "
            f"{', '.join(map(str, rays)) or 'no'} rays; give at least one, each different."
        )
    for mode in modes:
        mode.check_layers(layers, 1)
    return Study(
        name="rays",
        axis=Axis("launched", tuple(rays), "rays launched"),
        modes=tuple(modes),
        view=lambda position: evolve(view, camera=cameras[position]),
        stack=lambda mode, position: shells_of(field, layers, mode),
        source=source_of(view, [field], layers=layers),
    )


def polygons_study(
    field: IndexField,
    view: View,
    modes: Sequence[Mode],
    *,
    layers: int = 13,
    smallest: int = 4_700,
    largest: int = 320_000,
) -> Study:
    """Time the stages of one picture at several numbers of triangles.

    Midpoint subdivision leaves the surfaces where they are, so all but the first step trace the
    same rays through the same air.

    Parameters
    ----------
    field : IndexField
    view : View
    modes : sequence of Mode
    layers : int
        Number of shells.
    smallest : int
        Triangles of each shell to begin with, by default as Kern et al. (2025); larger shells are
        thinned out to it.
    largest : int
        No more subdivisions than give this mean number of triangles for each shell (4.8 million in
        Kern et al.).

    Raises
    ------
    InputError
        If the limits are not in order.
    """
    if not 100 <= smallest <= largest:
        raise InputError(
            f"Triangles of a shell from {smallest} to {largest} are no range; give at least 100 "
            "and then more."
        )
    for mode in modes:
        mode.check_layers(layers, 1)

    @lru_cache(maxsize=len(modes))
    def start(mode: Mode) -> ShellStack:
        return thinned(some_shells_of(field, layers, mode), smallest)

    first = start(modes[0])
    steps = int(np.log(largest * len(first.shells) / first.triangles) / np.log(4) + 1e-9)
    return Study(
        name="polygons",
        axis=Axis("subdivisions", tuple(range(max(0, steps) + 1)), "midpoint subdivisions"),
        modes=tuple(modes),
        view=lambda position: view,
        stack=lambda mode, position: subdivide_midpoint(start(mode), position),
        source=source_of(view, [field], layers=layers, smallest=smallest),
    )


def thinned(stack: ShellStack, triangles: int) -> ShellStack:
    """Shells with at most about a number of triangles each, by quadric edge collapse.

    Each vertex gets the gradient normal and the derivatives of the nearest vertex of before.
    """
    return evolve(stack, shells=[_thinned(shell, triangles) for shell in stack.shells])


def _thinned(shell: Shell, triangles: int) -> Shell:
    if len(shell.faces) <= triangles:
        return shell
    mesh = polydata(shell.vertices, shell.faces).decimate(1.0 - triangles / len(shell.faces))
    vertices = np.asarray(mesh.points, dtype=np.float32)
    nearest = cKDTree(shell.vertices).query(vertices)[1]
    return evolve(
        shell,
        vertices=vertices,
        faces=mesh.regular_faces,
        normals=None if shell.normals is None else shell.normals[nearest],
        derivatives=None if shell.derivatives is None else shell.derivatives[nearest],
    )
