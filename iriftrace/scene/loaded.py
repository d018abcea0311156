"""Scenes in memory, ready for tracing: of one field, or of an ensemble, member by member."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import Factory, evolve, field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.engines import AUTO, ENGINES, Bending
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.units import parse_quantity
from iriftrace.field.path_data import FIELD_FILE, FieldCells, load_field_file
from iriftrace.field.source import FieldSource
from iriftrace.part.part import Part
from iriftrace.runtime import variant as runtime
from iriftrace.scene.air import Integrator, traced_air
from iriftrace.scene.ensemble import MEMBER, FieldMember, is_ensemble, member_folder, weights_of
from iriftrace.scene.file import WAVELENGTH
from iriftrace.shells.table import AirStatement

if TYPE_CHECKING:
    import mitsuba as mi

KEPT_TRIANGLES = 10_000_000
"""Number of triangles of shells kept in memory between poses, 1.5 GB with Mitsuba's own tree."""


@frozen(eq=False)
class _SceneLock:
    """Frees the scene when no `LoadedScene` refers to it any more.

    Mitsuba's scene refers to its integrator, whose tables refer to the scene. Both are freed only
    if one of them drops its reference.
    """

    integrator: Integrator

    def __attrs_post_init__(self) -> None:
        weakref.finalize(self, self.integrator.forget).atexit = False


@frozen(eq=False)
class LoadedScene:
    """A scene in memory, ready to be rendered at any number of poses.

    Attributes
    ----------
    path : Path or None
        The XML file, absolute; None for a scene of objects (`iriftrace.Scene`).
    part : Part
        The measured part, mm, world.
    part_to_world : (4, 4) array
        Transform of the part's file in the XML.
    camera : Camera
        The scene's (first) sensor; `attrs.evolve` creates a scene with another camera.
    full_resolution : (2,) tuple of int, px
        Resolution of that sensor's film before ``scale`` changed it.
    variables : dict of str
        Values given for the file's ``<default>`` parameters.
    engine : str
        ``"shells"`` or ``"cells"``.
    requested_engine : str
        The requested engine, independent of the XML; ``"auto"`` if none was requested.
    normals : str
        ``"gradient"`` or ``"facet"``, and for how many shells if not for all; for cells the origin
        of their gradient.
    bending : Bending
        Where rays are bent.
    index_rule : str
        How surfaces and layers were chosen, and whether the scene still has all of them.
    stated : AirStatement
        Statements about the air (its state, source, index rule); empty if the scene has none. For
        the cells engine air and source are those of its field.
    load_s, build_s : float
        Seconds for files and Mitsuba's acceleration structure, and for the tables.
    second : Camera or None
        The second sensor, with which points are triangulated; None if there is none.
    second_id : str
        Its id in the file.
    ensemble : LoadedEnsemble or None
        The members that are traced together, if the scene has several fields and none of them
        was chosen. All other attributes are then those of the first member.
    """

    path: Path | None
    part: Part
    part_to_world: FloatArray
    camera: Camera
    full_resolution: tuple[int, ...]
    variables: dict[str, str]
    engine: str
    requested_engine: str
    normals: str
    bending: Bending
    index_rule: str
    stated: AirStatement
    load_s: float
    build_s: float
    variant: str
    _mitsuba_scene: mi.Scene = field(repr=False)
    integrator: Integrator = field(repr=False)
    second: Camera | None = None
    second_id: str = ""
    ensemble: LoadedEnsemble | None = field(default=None, repr=False)
    _given: str = field(default="the scene", repr=False)
    _state: dict[str, object] | None = field(default=None, repr=False)
    _cells: Callable[[], FieldCells] | None = field(default=None, repr=False)
    _sensor: Camera = field(
        repr=False, default=Factory(lambda scene: scene.camera, takes_self=True)
    )
    _lock: _SceneLock = field(
        repr=False, default=Factory(lambda scene: _SceneLock(scene.integrator), takes_self=True)
    )

    def __repr__(self) -> str:
        width, height = self.camera.resolution
        fields = "" if self.ensemble is None else f", {len(self.ensemble)} fields"
        return (
            f"LoadedScene({self.name}: {self.part!r}, {width} x {height} px, engine {self.engine}"
            f"{fields}, {self.variant})"
        )

    @property
    def mitsuba_scene(self) -> mi.Scene:
        """The scene in Mitsuba; InputError if `mi.traverse` has changed it since `from_mitsuba`."""
        if self._state is not None:
            from iriftrace.plugins.scene_state import same_state, scene_state

            if not same_state(self._state, scene_state(self._mitsuba_scene)):
                raise InputError(
                    "The mi.Scene was changed since from_mitsuba; call from_mitsuba again."
                )
        return self._mitsuba_scene

    @property
    def name(self) -> str:
        """Name of the scene in messages."""
        return self._given

    @property
    def other_camera(self) -> Camera | None:
        """The camera, if it is no longer that of Mitsuba's sensor."""
        return None if self.camera is self._sensor else self.camera

    @cached_property
    def through_cells(self) -> LoadedScene | None:
        """The same scene traced through its field's cells, which are read on first use.

        None if an engine or bending at the shells was requested, or if the field that the shells
        were cut from does not lie next to the scene.
        """
        if self.requested_engine != AUTO or self.bending is not Bending.LAYERS:
            return None
        with without_warnings():
            try:
                found = self.with_cells()
            except InputError:
                return None
        return found if self.same_field(found) else None

    def same_field(self, other: LoadedScene) -> bool:
        """True if both scenes state the same file as the source of their air."""
        own, its = (one.source.sha256 if one.source else None for one in (self, other))
        return own == its

    @property
    def cells(self) -> FieldCells:
        """The cells of its field; raises InputError if there is none."""
        if self.path is not None:
            return load_field_file(field_file(self.path, self.variables))
        assert self._cells is not None
        return self._cells()

    def with_cells(self) -> LoadedScene:
        """The same scene traced through its field's cells instead of its shells.

        Raises InputError if there is no field.
        """
        started = time.perf_counter()
        with runtime.using(self.variant):
            file = field_file(self.path, self.variables) if self.path else Path(FIELD_FILE)
            integrator = integrator_for(self.integrator, "cells", self.name, file)
            set_wavelength(integrator, self.variables)
            if self.path is None:
                integrator.use(self.cells)
            integrator.prepare_as(self.integrator)
            tables = integrator.prepare(self.mitsuba_scene).tables
            found = traced_air(integrator, self.stated, self.name, tables)
        return evolve(
            self,
            requested_engine="cells",
            integrator=integrator,
            build_s=self.build_s + time.perf_counter() - started,
            lock=_SceneLock(integrator),
            ensemble=None if self.ensemble is None else self.ensemble.with_cells(),
            **found,
        )

    @property
    def source(self) -> FieldSource | None:
        """Facts about the file that the air comes from."""
        return self.stated.source


class LoadedEnsemble:
    """Members of an ensemble's scene, loaded by their numbers and traced one after the other."""

    def __init__(
        self, members: tuple[FieldMember, ...], load: Callable[[int], LoadedScene]
    ) -> None:
        self.members = members
        self._load = load
        self._kept: dict[int, LoadedScene] = {}
        self._triangles = 0

    def __len__(self) -> int:
        return len(self.members)

    def with_cells(self) -> LoadedEnsemble:
        """The same members, each traced through its field's cells."""

        def load(number: int) -> LoadedScene:
            shells = self._load(number)
            cells = shells.with_cells()
            if not shells.same_field(cells):
                raise InputError(
                    f"The field of member {number} of {shells.name} is not what its shells were "
                    "cut from; write the scene again."
                )
            return cells

        return LoadedEnsemble(self.members, load)

    @property
    def weights(self) -> MemberWeights:
        """Weights of the members, in their order."""
        return weights_of(self.members)

    def scenes(self) -> Iterator[LoadedScene]:
        """Scenes of all members in order; those above the memory limit are freed after use."""
        for member in self.members:
            if member.number in self._kept:
                yield self._kept[member.number]
                continue
            scene = self._load(member.number)
            triangles = scene.stated.triangles
            if self._triangles + triangles <= KEPT_TRIANGLES:
                self._triangles += triangles
                self._kept[member.number] = scene
                yield scene
            else:
                try:
                    yield scene
                finally:
                    scene.integrator.forget()


def field_file(path: Path, values: Mapping[str, str]) -> Path:
    """The cells engine's field next to a scene, or that of its member."""
    folder = member_folder(path, values.get(MEMBER, "1")) if is_ensemble(path) else path.parent
    return folder / FIELD_FILE


def set_wavelength(integrator: Integrator, values: Mapping[str, str]) -> None:
    """Set another wavelength than that of the cells engine's field, if requested."""
    if WAVELENGTH in values:
        integrator.wavelength_nm = parse_quantity(values[WAVELENGTH], "nm")


def integrator_for(own: Integrator, engine: str, name: str, field_file: Path) -> Integrator:
    """The scene's own integrator, or one for the requested engine."""
    import mitsuba as mi

    check_engine(engine)
    if not hasattr(own, "image"):
        raise InputError(
            f"{name} has the integrator {own.class_name()}, which computes light and not hits; use "
            '<integrator type="first_hit"/>.'
        )
    if engine in (AUTO, own.engine):
        return own
    # The two kinds of normals have counterparts: each kind converges to its gradient.
    smooth = own.normals == "gradient" if engine == "cells" else own.gradient == "recovered"
    if engine == "shells":
        chosen = {"type": "first_hit", "normals": "gradient" if smooth else "facet"}
    else:
        chosen = {
            "type": "gradient_path",
            "field": str(field_file.resolve()),
            "gradient": "recovered" if smooth else "constant",
        }
    return mi.load_dict({**chosen, "trace_all": own.trace_all})


def check_engine(engine: str) -> None:
    """Refuse an engine that does not exist."""
    known = (AUTO, *ENGINES)
    if engine not in known:
        raise InputError(f"There is no engine {engine!r}; use one of {', '.join(known)}.")
