"""Scenes loaded into Mitsuba for tracing: of one field, or of an ensemble, member by member."""

from __future__ import annotations

import time
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from attrs import Factory, evolve, field, frozen
from numpy.typing import NDArray

from iriftrace.air.refractivity import dispersion
from iriftrace.camera.camera import Camera
from iriftrace.core.engines import AUTO, Bending
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.units import parse_quantity
from iriftrace.field.path_data import FIELD_FILE, FieldCells, load_field_file
from iriftrace.field.source import FieldSource
from iriftrace.part.part import Part, read_part
from iriftrace.runtime import variant as runtime
from iriftrace.scene.air import (
    air_statement_of,
    other_shells,
    warn_of_another_part,
)
from iriftrace.scene.ensemble import (
    MEMBER,
    FieldMember,
    members_of,
    weights_of,
)
from iriftrace.scene.file import check_meshes, read_scene_file, readable
from iriftrace.scene.integrators import (
    field_file,
    found_of_field,
    found_of_shells,
    integrator_for,
    set_wavelength,
)
from iriftrace.scene.member_weights import MemberWeights
from iriftrace.scene.wavelength import WAVELENGTH, of_the_file, set_shells
from iriftrace.shells.table import AirStatement

KEPT_TRIANGLES = 10_000_000
"""Triangles of shells that stay in memory between poses, about 1.5 GB with Mitsuba's own tree."""


@frozen(eq=False)
class _Lease:
    """Frees the scene when no `LoadedScene` has it any more.

    Mitsuba's scene holds its integrator, whose tables hold the scene: only one of them letting go
    frees both.
    """

    integrator: Any

    def __attrs_post_init__(self) -> None:
        weakref.finalize(self, self.integrator.forget).atexit = False


@frozen(eq=False)
class LoadedScene:
    """A scene in memory, ready to be rendered at any number of poses.

    Attributes
    ----------
    path : Path or None
        The XML file; None of a scene of objects (`iriftrace.Scene`).
    part : Part
        The measured part, mm, world.
    part_to_world : (4, 4) array
        What the XML does to the part's file.
    camera : Camera
        The scene's own (first) sensor.
    full_resolution : (2,) tuple of int, px
        Of that sensor's film before ``scale`` changed it.
    variables : dict of str
        Values that were given for the file's ``<default>`` parameters.
    engine : str
        ``"shells"`` or ``"cells"``.
    wanted_engine : str
        What was asked for, whatever the XML says; ``"auto"`` where nothing was.
    normals : str
        ``"gradient"`` or ``"facet"``, and for how many shells if not for all; of cells where their
        gradient comes from.
    bending : Bending
        Where rays are bent.
    index_rule : str
        How surfaces and layers were chosen, and whether the scene still has all of them.
    stated : AirStatement
        What is known of the air (its state, source, index rule); nothing when the scene does not
        say. For the cells engine air and source are those of its field.
    load_s, build_s : float
        Seconds for files and Mitsuba's acceleration structure, and for the tables.
    second : Camera or None
        The second sensor, with which points are triangulated; None where there is none.
    second_id : str
        Its id in the file.
    ensemble : LoadedEnsemble or None
        The members that are traced together, where the scene has several fields and none of them
        was chosen. All else is then that of the first member.
    """

    path: Path | None
    part: Part
    part_to_world: NDArray[np.float64]
    camera: Camera
    full_resolution: tuple[int, ...]
    variables: dict[str, str]
    engine: str
    wanted_engine: str
    normals: str
    bending: Bending
    index_rule: str
    stated: AirStatement
    load_s: float
    build_s: float
    variant: str
    mitsuba_scene: Any = field(repr=False)
    integrator: Any = field(repr=False)
    second: Camera | None = None
    second_id: str = ""
    ensemble: LoadedEnsemble | None = field(default=None, repr=False)
    _cells: Callable[[], FieldCells] | None = field(default=None, repr=False)
    _lease: _Lease = field(
        repr=False, default=Factory(lambda scene: _Lease(scene.integrator), takes_self=True)
    )

    def __repr__(self) -> str:
        width, height = self.camera.resolution
        fields = "" if self.ensemble is None else f", {len(self.ensemble)} fields"
        return (
            f"LoadedScene({self.name}: {self.part!r}, {width} x {height} px, engine {self.engine}"
            f"{fields}, {self.variant})"
        )

    @property
    def name(self) -> str:
        """What messages call the scene."""
        return "the scene" if self.path is None else str(self.path)

    @cached_property
    def through_cells(self) -> LoadedScene | None:
        """The same scene traced through its field's cells, which are read at the first need.

        None where an engine or bending at the shells was asked for, and where the field that the
        shells were cut from does not lie beside the scene.
        """
        if self.wanted_engine != AUTO or self.bending is not Bending.LAYERS:
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IriftraceWarning)
            try:
                found = self.with_cells()
            except InputError:
                return None
        return found if self.same_field(found) else None

    def same_field(self, other: LoadedScene) -> bool:
        """Whether both scenes state the same file as the source of their air."""
        own, its = (one.source.sha256 if one.source else None for one in (self, other))
        return own == its

    @property
    def cells(self) -> FieldCells:
        """The cells of its field; an InputError where there is none."""
        if self.path is not None:
            return load_field_file(field_file(self.path, self.variables))
        assert self._cells is not None
        return self._cells()

    def with_cells(self) -> LoadedScene:
        """The same scene traced through its field's cells in place of its shells.

        InputError where there is no field.
        """
        started = time.perf_counter()
        with runtime.using(self.variant):
            if self.path is not None:
                file = field_file(self.path, self.variables)
                integrator = integrator_for(self.integrator, "cells", self.name, file)
                set_wavelength(integrator, self.variables)
            else:
                integrator = integrator_for(self.integrator, "cells", self.name, Path(FIELD_FILE))
                integrator.use(self.cells)
            integrator.prepare_as(self.integrator)
            found = found_of_field(integrator, self.stated, self.name)
        return evolve(
            self,
            wanted_engine="cells",
            integrator=integrator,
            build_s=self.build_s + time.perf_counter() - started,
            lease=_Lease(integrator),
            ensemble=None if self.ensemble is None else self.ensemble.with_cells(),
            **found,
        )

    @property
    def source(self) -> FieldSource | None:
        """What is known of the file that the air comes from."""
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
        """Every member's scene, in their order; what does not fit is let go after its turn."""
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


def load_scene(
    path: str | PathLike[str],
    variables: Mapping[str, Any] | None = None,
    *,
    variant: str | None = None,
    engine: str = AUTO,
) -> LoadedScene:
    """Load a scene's XML file into Mitsuba and build what every pose needs.

    Parameters
    ----------
    path : path
        The XML file; its integrator must be ``first_hit`` or ``gradient_path``.
    variables : mapping, optional
        Values for the file's ``<default>`` parameters, as Mitsuba's ``-D name=value``; and
        ``wavelength`` ("450 nm"), if it shall be another than the one the scene was made for.
    variant : str, optional
        Mitsuba variant; see :func:`iriftrace.runtime.variant.ensure`.
    engine : str
        ``"shells"`` or ``"cells"``, whatever the XML's own integrator is; ``"auto"`` for that one,
        and cells where its shells are too few (:func:`iriftrace.trace.engine.choose`).

    Raises
    ------
    InputError
        If the file is missing, Mitsuba cannot read it, it is no scene that can be traced, or
        compiled plugins lie beside it.
    SetupError
        If no usable LLVM or CUDA is there.

    Warns
    -----
    IriftraceWarning
        If something in the file costs accuracy.
    """
    values = {name: _text(value) for name, value in (variables or {}).items()}
    members = members_of(Path(path), values)
    if not members:
        return _load_one(Path(path), values, variant, engine)
    ensemble = LoadedEnsemble(
        members,
        lambda number: _load_one(Path(path), {**values, MEMBER: str(number)}, variant, engine),
    )
    # Closed at once, the others are loaded when they are traced.
    first = next(ensemble.scenes())
    return evolve(first, variables=values, ensemble=ensemble)


def _load_one(path: Path, values: dict[str, str], variant: str | None, engine: str) -> LoadedScene:
    """A scene with one field, or with one member of several."""
    chosen = runtime.ensure(variant)
    runtime.refuse_foreign_plugins(path.parent)
    import mitsuba as mi

    from iriftrace.plugins.film import camera_of

    started = time.perf_counter()
    file = read_scene_file(path, values)
    check_meshes(file.file_paths)
    try:
        scene = mi.load_file(
            str(path),
            optimize=False,
            **of_the_file(values),  # type: ignore[arg-type]
        )
    except (RuntimeError, ValueError) as error:
        runtime.refuse_gpu_without_optix(error)
        raise InputError(readable(error)) from error
    loaded = time.perf_counter()
    integrator = integrator_for(scene.integrator(), engine, str(path), field_file(path, values))
    sensors = scene.sensors()
    if not sensors:
        raise InputError(f"{path} has no sensor, so there is nothing to look through; add one.")
    stated = air_statement_of(file)
    if integrator.engine == "cells":
        set_wavelength(integrator, values)
    elif WAVELENGTH in values:
        wavelength = parse_quantity(values[WAVELENGTH], "nm")
        set_shells(scene, dispersion(stated.air, wavelength))
        stated = stated.at_wavelength(wavelength)
    prepared = integrator.prepare(scene)
    part = read_part(file.part_path, length_unit="mm").transformed(file.part_to_world)
    warn_of_another_part(file, part, stated.part)
    _check_same_part(part, *prepared.tables.part_arrays())
    built = time.perf_counter()
    if integrator.engine == "cells":
        found = found_of_field(integrator, stated, str(path))
    else:
        others = other_shells(file, stated)
        found = found_of_shells(integrator, stated, prepared.tables, str(path), others)
    return LoadedScene(
        path=path,
        part=part,
        part_to_world=file.part_to_world,
        camera=_camera(sensors[0]),
        full_resolution=camera_of(sensors[0]).full_resolution(),
        variables=values,
        wanted_engine=engine,
        load_s=loaded - started,
        build_s=built - loaded,
        variant=chosen,
        mitsuba_scene=scene,
        integrator=integrator,
        second=_camera(sensors[1]) if len(sensors) > 1 else None,
        second_id=str(sensors[1].id()) if len(sensors) > 1 else "",
        **found,
    )


def _camera(sensor: Any) -> Camera:
    """The camera that a sensor is, of its film's crop window alone."""
    from iriftrace.plugins.film import camera_of

    camera = Camera.from_dict(camera_of(sensor).description())
    (left, top), (width, height) = sensor.film().crop_offset(), sensor.film().crop_size()
    if (width, height) == camera.resolution:
        return camera
    return camera.cropped(int(left), int(top), int(width), int(height))


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _check_same_part(part: Part, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> None:
    """Face numbers mean the same in Mitsuba's mesh and in ours, or the metrics would lie."""
    same = len(faces) == len(part.faces) and np.allclose(
        vertices[faces], part.vertices[part.faces], rtol=1e-5, atol=1e-4
    )
    if not same:
        raise InputError(
            f"Mitsuba reads {part.path} with other triangles than iriftrace does, so that faces "
            "and regions would be confused; write the part anew with `iriftrace scene`."
        )
