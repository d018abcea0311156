"""A scene as a value: part, hot air and devices."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import Factory, evolve, field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.engines import Bending, Engine, engine_named
from iriftrace.core.errors import InputError, warn, without_warnings
from iriftrace.core.html import html_table, picture
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.runtime import variant as runtime
from iriftrace.part.part import Part
from iriftrace.tracing.compiled import Compiled, Held, Origin, of_objects, same
from iriftrace.tracing.ensemble import MEMBER
from iriftrace.tracing.file import WAVELENGTH
from iriftrace.tracing.hot_air import FieldMember, HotAir, weights_of
from iriftrace.tracing.objects import kept_camera, kept_part
from iriftrace.tracing.options import SCALE
from iriftrace.tracing.viewpoint import refuse_bad_places
from iriftrace.tracing.xml import SceneSettings

if TYPE_CHECKING:
    from iriftrace.medium.part_fit import Fit
    from iriftrace.medium.path_data import FieldCells
    from iriftrace.tracing.save import SavedScene

KEPT_TRIANGLES = 10_000_000
"""Number of triangles of shells kept in memory between poses, 1.5 GB with Mitsuba's own tree."""


def _parts(bodies: Iterable[Part]) -> tuple[Part, ...]:
    return tuple(bodies)


@frozen(eq=False)
class Scene:
    """A part in hot air, seen by one device or measured by two.

    `attrs.evolve` creates a scene with another camera, light or air. What Mitsuba needs is made
    when the scene is first traced (`compiled`), and freed with the scene.

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
    engine : Engine or str
        ``"shells"``, ``"cells"``, or ``"auto"`` for shells, and cells in views for which they are
        too few (:func:`iriftrace.tracing.engine.choose`).
    variant : str or None
        Mitsuba variant; see :func:`iriftrace.core.runtime.variant.ensure`.
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
    engine: Engine = field(default=Engine.AUTO, converter=engine_named)
    variant: str | None = None
    blockers: tuple[Part, ...] = field(default=(), converter=_parts)
    _origin: Origin | None = field(default=None, repr=False)
    _stored: bool = field(default=False, repr=False)  # numbers are those of a scene's files
    _held: Held = field(default=Factory(Held), repr=False)

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
                    f"{kind.__name__}; give {remedy}.",
                    code="scene.wrong_type",
                )
        bodies = (self.part, self.air, *self.blockers)
        if self._origin is not None and not same(self._origin.bodies, bodies):
            object.__setattr__(self, "_origin", None)
        if self._held.of_others(bodies):
            object.__setattr__(self, "_stored", False)
        values = (*bodies, self.wavelength_nm, self.engine, self.variant, self._stored)
        if not same(self._held.values, values):
            object.__setattr__(self, "_held", Held(values))

    def __repr__(self) -> str:
        width, height = self.camera.resolution
        fields = f", {len(self.members)} fields" if self.members else ""
        seen = f"{width} x {height} px, engine {self.engine}"
        return f"Scene({self.name}: {self.part!r}, {seen}{fields})"

    def _repr_html_(self) -> str:
        """Part, air and devices, for notebooks."""
        second = "none" if self.second is None else self.second_id
        return html_table(self.name, {"scene": repr(self), "second device": second}) + picture(self)

    @property
    def name(self) -> str:
        """Name of the scene in messages."""
        return "the scene" if self._origin is None else self._origin.given

    @property
    def path(self) -> Path | None:
        """The XML file that it was read from, absolute; None for a scene of objects."""
        return None if self._origin is None else self._origin.path

    @property
    def sha256(self) -> str | None:
        """SHA-256 of that file when it was read."""
        return None if self._origin is None else self._origin.sha256

    @property
    def variables(self) -> dict[str, str]:
        """Values given for the file's ``<default>`` parameters, and the wavelength (nm)."""
        light = {} if self.wavelength_nm is None else {WAVELENGTH: repr(self.wavelength_nm)}
        return {} if self._origin is None else {**self._origin.variables, **light}

    @property
    def part_to_world(self) -> FloatArray:
        """Transform (4, 4) of the part's file."""
        return np.eye(4) if self._origin is None else self._origin.part_to_world

    @property
    def members(self) -> tuple[FieldMember, ...]:
        """The fields of an ensemble; empty for one field."""
        return self.air.members

    @property
    def weights(self) -> MemberWeights:
        """Weights of the members, in their order."""
        return weights_of(self.members)

    @property
    def averages(self) -> bool:
        """True if results are means over several fields, with their scatter."""
        return bool(self.members) and self.weights.several

    @property
    def ready(self) -> Scene:
        """The scene with the numbers of its files, in which it is traced.

        The numbers of a scene's files are rounded; see `iriftrace.tracing.objects`.

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
        return self if self._stored else self._rounded

    @cached_property
    def _rounded(self) -> Scene:
        for fit in filter(None, self._fits):
            for message in fit.warnings:
                warn(message)
        for state in self.air.states:
            bodies = (self.part, *self.blockers)
            refuse_bad_places(self.camera, self.second, bodies, state)
        variant = runtime.ensure(self.variant)
        states = [
            state if fit is None or not fit.notes else state.with_notes(fit.notes)
            for state, fit in zip(self.air.states, self._fits, strict=True)
        ]
        return evolve(
            self,
            part=kept_part(self.part),
            air=self.air.with_states(states),
            camera=kept_camera(self.camera),
            second=None if self.second is None else kept_camera(self.second),
            variant=variant,
            blockers=tuple(kept_part(body) for body in self.blockers),
            stored=True,
        )

    @property
    def compiled(self) -> Compiled:
        """The scene in Mitsuba, made on first use; for an ensemble that of its first member."""
        if not self._stored:
            return self.ready.compiled
        held = self._held
        if held.compiled is None:
            held.compiled = next(self.alone()).compiled if self.members else self._compile()
        return held.compiled

    def _compile(self) -> Compiled:
        if self._origin is not None:
            return self._origin.compile(self.variables, self.engine)
        (state,) = self.air.states
        shells = of_objects(
            self.part,
            state.shells,
            {"camera": self.camera} | ({self.second_id: self.second} if self.second else {}),
            self.blockers,
            state.shells.stated({**self.air.notes, **state.notes}),
            normals=self.air.normals,
            wavelength_nm=self.wavelength_nm,
            variant=runtime.ensure(self.variant),
        )
        return self._through_cells(shells, state.cells) if self.engine.through_cells else shells

    @property
    def counted(self) -> tuple[int, ...]:
        """Places, from 0, of the fields that decide what is measured (`FieldMember.counts`)."""
        if not self.members:
            return (0,)
        return tuple(place for place, member in enumerate(self.members) if member.counts)

    def alone(self, places: Iterable[int] | None = None) -> Iterator[Scene]:
        """Scenes of one field each, in order; those above the memory limit are freed after use.

        Those of all members, or at some places, from 0.
        """
        if not self.members:
            yield self
            return
        held = self._held
        for member in self.members if places is None else [self.members[n] for n in places]:
            if member.number in held.members:
                yield self._like(held.members[member.number])
                continue
            scene = self._member(member.number)
            triangles = scene.compiled.stated.triangles
            if held.triangles + triangles <= KEPT_TRIANGLES:
                held.triangles += triangles
                held.members[member.number] = scene
                yield self._like(scene)
            else:
                try:
                    yield scene
                finally:
                    scene.compiled.integrator.forget()

    def _like(self, other: Scene) -> Scene:
        """Another scene with the devices of this one."""
        return evolve(other, camera=self.camera, second=self.second, second_id=self.second_id)

    def _member(self, number: int) -> Scene:
        """One member of an ensemble."""
        ensemble: Scene | None = self._held.shells
        if ensemble is not None:
            shells = ensemble._member(number)
            cells = shells.with_cells()
            if not shells.compiled.same_field(cells.compiled):
                raise InputError(
                    f"The field of member {number} of {self.name} is not what its shells were cut "
                    "from; write the scene again.",
                    code="scene.other_field",
                )
            return cells
        air, origin = self.air.alone(number), self._origin
        if origin is not None:
            origin = evolve(
                origin,
                variables={**origin.variables, MEMBER: str(number)},
                bodies=(self.part, air, *self.blockers),
            )
        return evolve(self, air=air, origin=origin, held=Held())

    def with_cells(self) -> Scene:
        """The same scene traced through its field's cells; InputError if there is no field."""
        if not self.members:
            return self.through(self.air.states[0].cells)
        cells = evolve(self, engine=Engine.CELLS)
        cells._held.shells = evolve(self, held=Held())
        return cells

    def through(self, cells: FieldCells) -> Scene:
        """The same scene of one field, traced through given cells of that field's source."""
        found = evolve(self, engine=Engine.CELLS, held=Held())
        found._held.compiled = self._through_cells(self.compiled, cells)
        return found

    def _through_cells(self, shells: Compiled, cells: FieldCells) -> Compiled:
        """The scene that is compiled with shells, through cells in its own light."""
        if self.wavelength_nm is not None:
            cells = cells.at_wavelength(self.wavelength_nm)
        return shells.through_cells(self.name, cells)

    @property
    def through_cells(self) -> Scene | None:
        """The same scene traced through its field's cells, which are read on first use.

        None if an engine or bending at the shells was requested, if the field that the shells were
        cut from does not lie next to the scene, or if they were moved (to_world) or edited.
        """
        held = self._held
        if not held.cells_sought:
            held.cells, held.cells_sought = self._found_cells(), True
        if held.cells is None:
            return None
        return self._like(held.cells)

    def _found_cells(self) -> Scene | None:
        compiled = self.compiled
        edited = compiled.index_rule.startswith("edited")
        if edited or not self.engine.free or compiled.bending is not Bending.LAYERS:
            return None
        with suppress(InputError), without_warnings():
            found = self.with_cells()
            return found if compiled.same_field(found.compiled) else None
        return None

    @cached_property
    def _fits(self) -> tuple[Fit | None, ...]:
        """How each field and the part lie relative to each other; None for ready-made shells."""
        return tuple(
            state.fit(self.part, self.blockers, self.air.wall_temperature_k)
            for state in self.air.states
        )

    def save(self, path: str | PathLike[str], *, scale: float = SCALE) -> SavedScene:
        """Write the scene's folder, as ``iriftrace scene`` does; `iriftrace.load_scene` reads it.

        Engine and variant are not in the files; `load_scene` takes them.

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
            As for `ready`; or the air was read from a folder or is traced at another wavelength
            than its own, the XML file was edited by hand, or the folder cannot be written.

        Warns
        -----
        IriftraceWarning
            Field and part do not fit together.
        """
        from iriftrace.tracing.save import refuse_air, save_scene

        refuse_air(self.name, self.air, self.wavelength_nm)
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


def ready_scene(scene: Scene) -> Scene:
    """The scene as it is traced; raises InputError for what is none, such as the name of a file."""
    if not isinstance(scene, Scene):
        raise InputError(
            f"{scene!r} is no Scene; read a file with iriftrace.load_scene, or make a Scene of "
            "part, air and camera.",
            code="scene.wrong_type",
        )
    return scene.ready
