"""A scene as a value: part, hot air and devices, in memory."""

from __future__ import annotations

import time
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import Attribute, evolve, field, frozen

from iriftrace.air.refractivity import dispersion
from iriftrace.camera.camera import Camera
from iriftrace.core.engines import AUTO
from iriftrace.core.errors import InputError, warn
from iriftrace.part.part import Part
from iriftrace.runtime import variant as runtime
from iriftrace.scene.air import Integrator, traced_air
from iriftrace.scene.ensemble import FieldMember
from iriftrace.scene.hot_air import HotAir
from iriftrace.scene.load import load_scene, set_shells
from iriftrace.scene.loaded import LoadedEnsemble, LoadedScene, check_engine
from iriftrace.scene.objects import kept_camera, kept_part, mitsuba_scene
from iriftrace.scene.viewpoint import refuse_bad_places
from iriftrace.scene.xml import SCALE, SceneSettings

if TYPE_CHECKING:
    from iriftrace.field.part_fit import Fit
    from iriftrace.field.path_data import FieldCells
    from iriftrace.scene.save import SavedScene


@frozen(eq=False)
class Scene:
    """A part in hot air, seen by one device or measured by two.

    Nothing is written or read; `attrs.evolve` creates a scene with another camera, light or air.

    Attributes
    ----------
    part : Part
        The measured part, mm, world.
    air : HotAir
    camera : Camera
    second : Camera or None
        The device with which points are triangulated (:func:`iriftrace.measure`).
    second_id : str
        Its kind: ``"projector"``, ``"camera_2"`` or ``"laser"``.
    wavelength_nm : float or None, nm
        Wavelength of the light in vacuum; by default that of the air.
    engine : str
        ``"shells"``, ``"cells"``, or ``"auto"`` for shells, and cells in views for which they are
        too few (:func:`iriftrace.trace.engine.choose`).
    variant : str or None
        Mitsuba variant; see :func:`iriftrace.runtime.variant.ensure`.
    blockers : tuple of Part
        Bodies that only block the view, mm, world: supports; or the hot part, if `part` is a
        board that is seen past it.
    """

    part: Part
    air: HotAir
    camera: Camera
    second: Camera | None = None
    second_id: str = "projector"
    wavelength_nm: float | None = None
    engine: str = field(default=AUTO)
    variant: str | None = None
    blockers: tuple[Part, ...] = field(default=(), converter=tuple)

    def __attrs_post_init__(self) -> None:
        """Raise InputError for what is still to be read, such as a file's name."""
        for value, kind, remedy in (
            (self.part, Part, 'part = iriftrace.read_part("part.stl")'),
            (self.air, HotAir, "air = iriftrace.HotAir(field)"),
            (self.camera, Camera, "camera = iriftrace.Camera(...)"),
        ):
            if not isinstance(value, kind):
                raise InputError(
                    f"A Scene is made of Part, HotAir and Camera, and {value!r} is no "
                    f"{kind.__name__}; give {remedy}."
                )

    @engine.validator
    def _check_engine(self, _: Attribute[str], engine: str) -> None:
        check_engine(engine)

    @cached_property
    def loaded(self) -> LoadedScene:
        """The scene in Mitsuba, ready to be traced; created on first use.

        Raises
        ------
        InputError
            Field and part do not overlap, a device stands in the part or in hot air, or both stand
            at one place.

        Warns
        -----
        IriftraceWarning
            Field and part do not fit together.
        """
        for fit in filter(None, self._fits):
            for message in fit.warnings:
                warn(message)
        for state in self.air.states:
            bodies = (self.part, *self.blockers)
            refuse_bad_places(self.camera, self.second, bodies, state)
        states = self.air.states
        if len(states) == 1:
            return _one_state(self, 0)
        members = tuple(FieldMember.of(n, state) for n, state in enumerate(states, start=1))
        ensemble = LoadedEnsemble(members, lambda number: _one_state(self, number - 1))
        return evolve(next(ensemble.scenes()), ensemble=ensemble)

    @cached_property
    def _fits(self) -> tuple[Fit | None, ...]:
        """How each field and the part lie relative to each other; None for ready-made shells."""
        return tuple(
            state.fit(self.part, self.blockers, self.air.wall_temperature_k)
            for state in self.air.states
        )

    def save(self, path: str | PathLike[str], *, scale: float = SCALE) -> SavedScene:
        """Write the scene's folder, as ``iriftrace scene`` does; `iriftrace.load_scene` reads it.

        Parameters
        ----------
        path : path
            The scene's XML file; part, shells and field are written next to it. Its folder is
            created if it is missing.
        scale : float
            Default of the file's parameter ``scale``, a factor on the resolution.

        Returns
        -------
        SavedScene
            Usable as the path of the XML file.

        Raises
        ------
        InputError
            As for `loaded`; or the XML file was edited by hand, or the folder cannot be written.

        Warns
        -----
        IriftraceWarning
            Field and part do not fit together.
        """
        from iriftrace.scene.save import save_scene

        settings = SceneSettings(
            scale=scale,
            normals=self.air.normals,
            notes=self.air.notes,
            second=self.second,
            second_id=self.second_id,
            blockers=self.blockers,
        )
        return save_scene(
            Path(path),
            self.part,
            self.air.states,
            self.camera,
            settings,
            ensemble=len(self.air.states) > 1,
            wall_temperature_k=self.air.wall_temperature_k,
        )


def _one_state(scene: Scene, number: int) -> LoadedScene:
    """A scene of objects with one state of its air."""
    chosen = runtime.ensure(scene.variant)
    air, state = scene.air, scene.air.states[number]
    started = time.perf_counter()
    part, camera = kept_part(scene.part), kept_camera(scene.camera)
    second = None if scene.second is None else kept_camera(scene.second)
    fit = scene._fits[number]
    notes = {**air.notes, **({} if fit is None else fit.notes)}
    if len(air.states) > 1:
        notes["member"] = f"{number + 1}: {state.label}"
    stated = state.shells.stated(notes)
    devices = {"camera": camera} | ({} if second is None else {scene.second_id: second})
    found = mitsuba_scene(
        part,
        state.shells,
        devices,
        normals=air.normals,
        blockers=[kept_part(body) for body in scene.blockers],
    )
    if scene.wavelength_nm is not None:
        set_shells(found, dispersion(stated.air, scene.wavelength_nm))
        stated = stated.at_wavelength(scene.wavelength_nm)
    loaded = time.perf_counter()
    integrator: Integrator = found.integrator()
    prepared = integrator.prepare(found)

    def cells() -> FieldCells:
        if state.cells is None:
            raise InputError(
                "The air of the scene has ready-made shells and no field, so there are no cells to "
                "trace through; give HotAir the field."
            )
        light = scene.wavelength_nm
        return state.cells if light is None else state.cells.at_wavelength(light)

    shells = LoadedScene(
        path=None,
        part=part,
        part_to_world=np.eye(4),
        camera=camera,
        full_resolution=camera.resolution,
        variables={},
        requested_engine=scene.engine,
        load_s=loaded - started,
        build_s=time.perf_counter() - loaded,
        variant=chosen,
        mitsuba_scene=found,
        integrator=integrator,
        second=second,
        second_id="" if second is None else scene.second_id,
        cells=cells,
        **traced_air(integrator, stated, "the scene", prepared.tables),
    )
    return shells.with_cells() if scene.engine == "cells" else shells


AnyScene = Scene | LoadedScene | str | PathLike[str]
"""A scene of objects, a scene loaded from files, or the name of its file."""


def loaded_scene(scene: AnyScene) -> LoadedScene:
    """A scene ready to be traced; a path is loaded first."""
    if isinstance(scene, LoadedScene):
        return scene
    return scene.loaded if isinstance(scene, Scene) else load_scene(scene)
