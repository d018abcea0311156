"""Loading scenes into Mitsuba: from an XML file, or from a Mitsuba scene of one's own."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import numpy as np
from attrs import evolve

from iriftrace.air.refractivity import dispersion
from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.engines import AUTO
from iriftrace.core.errors import InputError
from iriftrace.core.units import parse_quantity
from iriftrace.field.path_data import FIELD_FILE
from iriftrace.part.part import Part, part_of_mesh, read_part
from iriftrace.runtime import variant as runtime
from iriftrace.scene.air import air_statement_of, other_shells, traced_air, warn_of_another_part
from iriftrace.scene.ensemble import MEMBER, members_of
from iriftrace.scene.file import (
    WAVELENGTH,
    check_meshes,
    of_the_file,
    read_scene_file,
    readable,
    warn_of_dielectric,
)
from iriftrace.scene.loaded import (
    LoadedEnsemble,
    LoadedScene,
    field_file,
    integrator_for,
    set_wavelength,
)
from iriftrace.shells.table import AirStatement

if TYPE_CHECKING:
    import mitsuba as mi


def load_scene(
    path: str | PathLike[str],
    variables: Mapping[str, object] | None = None,
    *,
    variant: str | None = None,
    engine: str = AUTO,
) -> LoadedScene:
    """Load a scene's XML file into Mitsuba and build the data for all poses.

    Parameters
    ----------
    path : path
        The XML file; its integrator must be ``first_hit`` or ``gradient_path``.
    variables : mapping, optional
        Values for the file's ``<default>`` parameters, as Mitsuba's ``-D name=value``; and
        ``wavelength`` ("450 nm"), if it differs from the one the scene was made for.
    variant : str, optional
        Mitsuba variant; see :func:`iriftrace.runtime.variant.ensure`.
    engine : str
        ``"shells"`` or ``"cells"``, independent of the XML's own integrator; ``"auto"`` for that
        one, and cells where its shells are too few (:func:`iriftrace.trace.engine.choose`).

    Raises
    ------
    InputError
        If the file is missing, Mitsuba cannot read it, it is not a scene that can be traced, or
        compiled plugins lie next to it.
    SetupError
        If there is no usable LLVM or CUDA.

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
    # Closed at once; the others are loaded when they are traced.
    first = next(ensemble.scenes())
    return evolve(first, variables=values, ensemble=ensemble)


def _load_one(path: Path, values: dict[str, str], variant: str | None, engine: str) -> LoadedScene:
    """A scene with one field, or with one member of several."""
    chosen = runtime.ensure(variant)
    runtime.refuse_foreign_plugins(path.parent)
    import mitsuba as mi

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
    sensors = _sensors(scene, str(path))
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
    others = () if integrator.engine == "cells" else other_shells(file, stated)
    found = traced_air(integrator, stated, str(path), prepared.tables, others)
    return LoadedScene(
        # As it is now, wherever the working folder will be.
        path=path.absolute(),
        given=str(path),
        part=part,
        part_to_world=file.part_to_world,
        variables=values,
        requested_engine=engine,
        load_s=loaded - started,
        build_s=built - loaded,
        variant=chosen,
        mitsuba_scene=scene,
        integrator=integrator,
        **_devices(sensors),
        **found,
    )


def from_mitsuba(scene: mi.Scene) -> LoadedScene:
    """Use a scene made with Mitsuba in `render_scene`, `trace_rays` and `measure`.

    Parameters
    ----------
    scene : mitsuba.Scene
        A scene of the current variant, loaded with ``optimize=False``, with the integrator
        ``first_hit`` or ``gradient_path``, a part (mm) and one or two sensors
        ``calibrated_camera``.

    Returns
    -------
    LoadedScene
        Its part has the mesh's triangles, and regions by their form. Of its air only what bends
        the rays is known: no wavelength, no source, and with shells no cells. It is the scene as
        it is now: after a change by `mitsuba.traverse` it is refused, and made anew.

    Raises
    ------
    InputError
        If it is something else, or has no sensor, no part, or another integrator, or the current
        variant traces no rays here.
    """
    chosen = runtime.ensure()
    import mitsuba as mi

    from iriftrace.plugins.scene_state import scene_state

    if not isinstance(scene, mi.Scene):
        raise InputError(
            f"from_mitsuba takes a mitsuba.Scene of the variant {mi.variant()}, not a "
            f"{type(scene).__name__}; `load_scene` reads files."
        )
    name = "Your mi.Scene"
    integrator = integrator_for(scene.integrator(), AUTO, name, Path(FIELD_FILE))
    sensors = _sensors(scene, name)
    started = time.perf_counter()
    integrator.refresh(scene)
    tables = integrator.prepare(scene).tables
    found = traced_air(integrator, AirStatement(), name, tables)
    if tables.stock_shells:
        warn_of_dielectric(name)
    return LoadedScene(
        path=None,
        part=part_of_mesh(*tables.part_arrays(), name=name),
        part_to_world=np.eye(4),
        variables={},
        requested_engine=integrator.engine,
        load_s=0.0,
        build_s=time.perf_counter() - started,
        variant=chosen,
        mitsuba_scene=scene,
        integrator=integrator,
        state=scene_state(scene),
        **_devices(sensors),
        **found,
    )


def set_shells(scene: mi.Scene, factor: float) -> None:
    """Multiply n - 1 on both sides of all shells of a Mitsuba scene, for another wavelength.

    n - 1 of all the air, hot or not, is proportional to that of the ambient air (Gladstone and
    Dale). The shells do not move, because each lies at one temperature.
    """
    from iriftrace.plugins.kernels.tables import shell_indices

    shells = {}
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        if shell_indices(bsdf) is None:
            continue
        if not hasattr(bsdf, "ext_ior"):
            raise InputError(
                "The scene has shells with Mitsuba's dielectric, whose indices are not stated, so "
                "they cannot be changed to another wavelength; use iso_shell."
            )
        # Several shapes may use one bsdf.
        shells[id(bsdf)] = bsdf
    for bsdf in shells.values():
        indices = (bsdf.ext_ior, bsdf.int_ior, bsdf.iso_ior)
        bsdf.set_indices(*(1.0 + factor * (index - 1.0) for index in indices))


def _sensors(scene: mi.Scene, name: str) -> list[mi.Sensor]:
    from iriftrace.plugins.film import refuse_shared_films

    sensors: list[mi.Sensor] = scene.sensors()
    if not sensors:
        raise InputError(f"{name} has no sensor, so it cannot be rendered; add one.")
    refuse_shared_films(sensors)
    return sensors


class _Devices(TypedDict):
    camera: Camera
    full_resolution: tuple[int, ...]
    second: Camera | None
    second_id: str


def _devices(sensors: Sequence[mi.Sensor]) -> _Devices:
    """The cameras of a scene's first two sensors."""
    from iriftrace.plugins.film import camera_of

    second = sensors[1] if len(sensors) > 1 else None
    return {
        "camera": _camera(sensors[0]),
        "full_resolution": camera_of(sensors[0]).full_resolution(),
        "second": None if second is None else _camera(second),
        "second_id": "" if second is None else str(second.id()),
    }


def _camera(sensor: mi.Sensor) -> Camera:
    """The camera of a sensor, for its film's crop window alone."""
    from iriftrace.plugins.film import camera_of

    camera = Camera.from_dict(camera_of(sensor).description())
    (left, top), (width, height) = sensor.film().crop_offset(), sensor.film().crop_size()
    if (width, height) == camera.resolution:
        return camera
    return camera.cropped(int(left), int(top), int(width), int(height))


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _check_same_part(part: Part, vertices: FloatArray, faces: IntArray) -> None:
    """Check that face numbers mean the same in Mitsuba's mesh and in ours."""
    same = len(faces) == len(part.faces) and np.allclose(
        vertices[faces], part.vertices[part.faces], rtol=1e-5, atol=1e-4
    )
    if not same:
        raise InputError(
            f"Mitsuba reads {part.path} with other triangles than iriftrace does, so that faces "
            "and regions would be confused; write the part again with `iriftrace scene`."
        )
