"""Reading the folder of a scene."""

from __future__ import annotations

import time
from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.engines import Engine, engine_named
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.files import sha256_of
from iriftrace.core.runtime import variant as runtime
from iriftrace.core.units import parse_quantity
from iriftrace.io.field_npz import FIELD_FILE
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart
from iriftrace.part.part import Part
from iriftrace.tracing.air import air_statement_of, other_shells, traced_air, warn_of_another_part
from iriftrace.tracing.compiled import (
    Compiled,
    Origin,
    devices_of,
    full_resolution_of,
    integrator_for,
    sensors_of,
    set_shells,
    set_wavelength,
)
from iriftrace.tracing.ensemble import MEMBER, is_ensemble, member_files, member_folder, members_of
from iriftrace.tracing.file import (
    WAVELENGTH,
    SceneFile,
    check_meshes,
    of_the_file,
    read_scene_file,
)
from iriftrace.tracing.hot_air import AirFiles, AirState, HotAir
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import SHELLS_FOLDER


def load_scene(
    path: str | PathLike[str],
    variables: Mapping[str, object] | None = None,
    *,
    variant: str | None = None,
    engine: str = Engine.AUTO,
) -> Scene:
    """Read a scene's XML file and the meshes that it names.

    Parameters
    ----------
    path : path
        The XML file; its integrator must be ``first_hit`` or ``gradient_path``.
    variables : mapping, optional
        Values for the file's ``<default>`` parameters, as Mitsuba's ``-D name=value``; and
        ``wavelength`` ("450 nm"), if it differs from the one the scene was made for.
    variant : str, optional
        Mitsuba variant; see :func:`iriftrace.core.runtime.variant.ensure`.
    engine : str
        ``"shells"`` or ``"cells"``, independent of the XML's own integrator; ``"auto"`` for that
        one, and cells where its shells are too few (:func:`iriftrace.tracing.engine.choose`).

    Returns
    -------
    Scene
        With the file's camera at its ``scale``. Mitsuba traces what the file says, also objects and
        settings that a `Scene` does not have, until another part, air or blocker is given. Shells
        and cells of the air are read when `AirState.shells` and `AirState.cells` are first needed.

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
    xml, given, requested = Path(path), str(Path(path)), engine_named(engine)
    values = {name: _text(value) for name, value in (variables or {}).items()}
    members = members_of(xml, values)
    first = {**values, MEMBER: str(members[0].number)} if members else values
    chosen = runtime.ensure(variant)
    read = _read(xml, first, chosen, requested)
    compiled = [read.compiled]
    light = values.pop(WAVELENGTH, None)
    # As it is now, wherever the working folder will be.
    xml = xml.absolute()

    def compile_again(values: dict[str, str], engine: Engine) -> Compiled:
        return compiled.pop() if compiled else _read(xml, values, chosen, engine).compiled

    stated, integrator = read.compiled.stated, read.compiled.integrator
    # Shells that the file moves are known to Mitsuba alone, and do not lie where the field does.
    moved, cells = read.file.shells_moved, read.compiled.engine.through_cells
    shells = read.file.shell_paths

    def usable(files: AirFiles) -> AirFiles:
        return evolve(files, shells=None, field=files.field if cells else None) if moved else files

    air = HotAir.of_states(
        [
            AirState(
                None,
                member.label,
                member.time,
                member.weight,
                member.covariance,
                files=usable(
                    AirFiles(
                        member_folder(xml, member.number) / SHELLS_FOLDER,
                        member_folder(xml, member.number) / FIELD_FILE,
                        member.source,
                    )
                ),
            )
            for member in members
        ]
        or [
            AirState(
                None,
                files=usable(
                    AirFiles(
                        shells[0].parent if shells else None,
                        field_file(xml, values),
                        stated.source,
                    )
                ),
            )
        ],
        normals=getattr(integrator, "normals", "gradient"),
        notes=stated.notes,
    )
    camera, second, second_id = read.devices
    with without_warnings():
        blockers = tuple(
            read_part(file, ReadPart(length_unit="mm")).transformed(place)
            for file, place in read.file.blockers
        )
    origin = Origin(
        path=xml,
        sha256=sha256_of(xml),
        given=given,
        variables=values,
        part_to_world=read.file.part_to_world,
        compile=compile_again,
        bodies=(read.part, air, *blockers),
    )
    scene = Scene(
        read.part,
        air,
        camera,
        second,
        second_id,
        None if light is None else parse_quantity(light, "nm"),
        requested,
        chosen,
        blockers,
        origin=origin,
        stored=True,
    )
    assert scene.compiled is read.compiled
    return scene


def field_file(path: Path, values: Mapping[str, str]) -> Path:
    """The cells engine's field next to a scene, or that of its member."""
    folder = member_folder(path, values.get(MEMBER, "1")) if is_ensemble(path) else path.parent
    return folder / FIELD_FILE


def scene_files(path: Path, values: Mapping[str, str], *, field: bool) -> tuple[Path, ...]:
    """Every file that a scene names, for an ensemble those of all members that are traced.

    With `field` also those for the cells engine next to it, which the XML need not name.
    """
    members = members_of(path, values)
    each = [{**values, MEMBER: str(m.number)} for m in members] or [{**values}]
    named = [file for one in each for file in read_scene_file(path, one).file_paths]
    fields = [field_file(path, one) for one in each] if field else []
    listed = member_files(path) if is_ensemble(path) else ()
    return tuple(dict.fromkeys((*listed, *named, *filter(Path.is_file, fields))))


@frozen(eq=False)
class _Read:
    """A scene's file with one field, or with one member of several."""

    file: SceneFile
    part: Part
    devices: tuple[Camera, Camera | None, str]
    compiled: Compiled


def _read(path: Path, values: Mapping[str, str], variant: str, engine: Engine) -> _Read:
    runtime.ensure(variant)
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
        raise InputError(runtime.readable(error), code="scene.unreadable") from error
    loaded = time.perf_counter()
    own = scene.integrator()
    integrator = integrator_for(own, engine, str(path), field_file(path, values))
    if file.shells_moved and Engine(integrator.engine).through_cells and integrator is not own:
        raise InputError(
            f"{path} moves its shells (to_world), and the field data next to it lie where they "
            "were, so the two engines would trace different air; use the shells, or write the "
            "scene again from the moved field.",
            code="shells.moved",
            argument="engine",
        )
    sensors = sensors_of(scene, str(path))
    devices = devices_of(sensors)
    stated = air_statement_of(file)
    through_cells = Engine(integrator.engine).through_cells
    if through_cells:
        set_wavelength(integrator, values)
    elif WAVELENGTH in values:
        stated = set_shells(scene, stated, parse_quantity(values[WAVELENGTH], "nm"))
    prepared = integrator.prepare(scene)
    part = read_part(file.part_path, ReadPart(length_unit="mm")).transformed(file.part_to_world)
    warn_of_another_part(file, part, stated.part)
    _check_same_part(part, *prepared.tables.part_arrays())
    built = time.perf_counter()
    others = () if through_cells else other_shells(file, stated)
    compiled = Compiled(
        camera=devices[0],
        second=devices[1],
        full_resolution=full_resolution_of(sensors[0]),
        load_s=loaded - started,
        build_s=built - loaded,
        variant=variant,
        mitsuba_scene=scene,
        integrator=integrator,
        **traced_air(integrator, stated, str(path), prepared.tables, others),
    )
    return _Read(file, part, devices, compiled)


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
            "and regions would be confused; write the part again with `iriftrace scene`.",
            code="part.other_triangles",
        )
