"""The study ``rays``: what the number of rays costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from attrs import evolve

from iriftrace.errors import InputError
from iriftrace.field import IndexField
from iriftrace.scene import LoadedScene
from iriftrace.studies.comparison import Axis
from iriftrace.studies.mode import Mode, some_shells_of
from iriftrace.studies.pictures import View, loaded_shells
from iriftrace.studies.timing import Timing


def rays_study(
    field: IndexField,
    view: View,
    scales: Sequence[float],
    modes: Sequence[Mode],
    source: Mapping[str, Any],
    *,
    layers: int = 13,
) -> Timing:
    """Time the stages of one picture at several resolutions.

    Parameters
    ----------
    field : IndexField
    view : View
        With the camera at its full resolution.
    scales : sequence of float
        Factors on the resolution.
    modes : sequence of Mode
    source : mapping
        See :class:`iriftrace.studies.timing.Timing`.
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

    @contextmanager
    def scene(mode: Mode, position: int) -> Iterator[tuple[LoadedScene, int, int]]:
        stack = some_shells_of(field, layers, mode)
        with loaded_shells(evolve(view, camera=cameras[position]), stack, mode) as loaded:
            yield loaded, len(stack.shells), stack.triangles

    for mode in modes:
        mode.check_layers(layers, 1)
    return Timing(
        name="rays",
        axis=Axis("launched", tuple(rays), "rays launched"),
        modes=tuple(modes),
        scene=scene,
        source={**source, "layers": layers},
    )
