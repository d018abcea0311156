"""Scene folders: written from part, shells and camera; loaded into Mitsuba for tracing."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from iriftrace import runtime
from iriftrace.camera import Camera
from iriftrace.continuous_field import FIELD_FILE, save_field_file
from iriftrace.ensemble.loaded import LoadedEnsemble
from iriftrace.ensemble.members import MEMBER, is_ensemble, member_folder, members_of
from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.part import Part, read_part, save_part
from iriftrace.scene_file import SceneFile, read_scene_file, readable
from iriftrace.scene_wavelength import (
    dispersion,
    of_the_file,
    set_shells,
    table_at,
    wanted_wavelength,
)
from iriftrace.scene_xml import PART_FILE, scene_xml, shell_shapes
from iriftrace.shell_io import save_shells
from iriftrace.shell_stack import ShellStack
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    from iriftrace.field import IndexField
    from iriftrace.shell_report import ShellReport

SHELLS_FOLDER = "shells"
ENGINES = ("shells", "continuous")


@frozen(eq=False)
class LoadedScene:
    """A scene in memory, ready to be rendered at any number of poses.

    Attributes
    ----------
    path : Path
        The XML file.
    part : Part
        The measured part, mm, world.
    part_to_world : (4, 4) array
        What the XML does to the part's file.
    camera : Camera
        The scene's own (first) sensor.
    variables : dict of str
        Values that were given for the file's ``<default>`` parameters.
    engine : str
        ``"shells"`` or ``"continuous"``.
    normals : str
        ``"gradient"`` or ``"facet"``, and for how many shells if not for all; for the continuous
        engine where its gradient comes from.
    index_rule : str
        How surfaces and layers were chosen, and whether the scene still has all of them.
    shells_table : dict
        The shells' JSON table (air, source, index rule); empty when the scene has none. For the
        continuous engine air and source of its field, and the notes of the shells' table.
    load_s, build_s : float
        Seconds for files and Mitsuba's acceleration structure, and for the tables.
    ensemble : LoadedEnsemble or None
        The members that are traced together, where the scene has several fields and none of them
        was chosen. All else is then that of the first member.
    """

    path: Path
    part: Part
    part_to_world: NDArray[np.float64]
    camera: Camera
    variables: dict[str, str]
    engine: str
    normals: str
    index_rule: str
    shells_table: dict[str, Any]
    load_s: float
    build_s: float
    variant: str
    mitsuba_scene: Any = field(repr=False)
    integrator: Any = field(repr=False)
    ensemble: LoadedEnsemble | None = field(default=None, repr=False)


def write_scene(
    folder: str | Path,
    part: Part,
    shells: ShellStack,
    camera: Camera,
    *,
    name: str = "scene.xml",
    scale: float = 1.0,
    normals: str = "gradient",
    inside_hit: str = "refract",
    report: Sequence[ShellReport] | None = None,
    notes: Mapping[str, str] | None = None,
    paraview: bool = True,
    field: IndexField | None = None,
) -> Path:
    """Write a complete scene folder: XML, part, shells and what the continuous engine needs.

    Parameters
    ----------
    folder : path
        Created when missing; files of the same names are replaced.
    part : Part
    shells : ShellStack
    camera : Camera
        At its full resolution.
    name : str
        Name of the XML file.
    scale : float
        Default of the XML's parameter ``scale``, a factor on the resolution.
    normals : str
        Default of the XML's parameter ``normals``: ``"gradient"`` or ``"facet"``.
    inside_hit : str
        ``"drop"`` gives up rays that meet a shell from its inside; see ``first_hit``.
    report : sequence of ShellReport, optional
        Added to the shells' table.
    notes : mapping of str, optional
        What is known of the field, such as ``{"time": "snapshot"}``; kept beside the shells.
    paraview : bool
        Whether to write ``shells.vtm`` too.
    field : IndexField, optional
        Written too, as `continuous_field.FIELD_FILE`, for the continuous engine.

    Returns
    -------
    Path
        The XML file.

    Raises
    ------
    InputError
        If the folder cannot be written or the camera is not a pinhole camera.
    """
    if camera.projection != "pinhole":
        raise InputError(
            "calibrated_camera is a pinhole camera; put an orthographic sensor into the XML by "
            "hand."
        )
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {target}: {error.strerror}.") from error
    save_part(part, target / PART_FILE)
    files = save_shells(shells, target / SHELLS_FOLDER, report, notes=notes, paraview=paraview)
    meshes = [path for path in files if path.suffix == ".ply"]
    shapes = shell_shapes(shells, meshes, SHELLS_FOLDER)
    origin = shells.source.origin if shells.source else ""
    if field is not None:
        save_field_file(field, target / FIELD_FILE)
    with whole_file(target / name) as temporary:
        temporary.write_text(
            scene_xml(
                camera,
                scale,
                normals,
                shapes,
                f"Field: {origin}" if origin else "",
                inside_hit=inside_hit,
            ),
            encoding="utf-8",
        )
    return target / name


def load_scene(
    path: str | Path,
    variables: Mapping[str, Any] | None = None,
    *,
    variant: str | None = None,
    engine: str | None = None,
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
        Mitsuba variant; see :func:`iriftrace.runtime.ensure`.
    engine : str, optional
        ``"shells"`` or ``"continuous"``, whatever the XML's own integrator is.

    Raises
    ------
    InputError
        If the file is missing, Mitsuba cannot read it, or it is no scene that can be traced.
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


def _load_one(
    path: Path, values: dict[str, str], variant: str | None, engine: str | None
) -> LoadedScene:
    """A scene with one field, or with one member of several."""
    chosen = runtime.ensure(variant)
    import mitsuba as mi

    from iriftrace.plugins.aov_integrator import camera_of

    started = time.perf_counter()
    file = read_scene_file(path, values)
    try:
        scene = mi.load_file(
            str(path),
            optimize=False,
            **of_the_file(values),  # type: ignore[arg-type]
        )
    except (RuntimeError, ValueError) as error:
        raise InputError(readable(error)) from error
    loaded = time.perf_counter()
    air = member_folder(path, values.get(MEMBER, "1")) if is_ensemble(path) else path.parent
    integrator = _integrator(scene.integrator(), engine, path, air / FIELD_FILE)
    if not scene.sensors():
        raise InputError(f"{path} has no sensor, so there is nothing to look through; add one.")
    table = _shells_table(file)
    wavelength = wanted_wavelength(values)
    if wavelength is not None:
        if integrator.engine == "continuous":
            integrator.wavelength_nm = wavelength
        else:
            set_shells(scene, dispersion(table.get("air") or {}, wavelength))
            table = table_at(table, wavelength)
    prepared = integrator.prepare(scene)
    part = read_part(file.part_path).transformed(file.part_to_world)
    _check_same_part(part, *prepared.tables.part_arrays())
    built = time.perf_counter()
    continuous = integrator.engine == "continuous"
    if continuous:
        table = _field_table(integrator.air.cells, table, path)
    return LoadedScene(
        path=path,
        part=part,
        part_to_world=file.part_to_world,
        camera=Camera.from_dict(camera_of(scene.sensors()[0]).description()),
        variables=values,
        engine=integrator.engine,
        normals=f"none, {integrator.gradient} gradient"
        if continuous
        else _normals(integrator.normals, prepared.tables),
        index_rule="none, linear in each tetrahedron"
        if continuous
        else _index_rule(path, table, prepared.tables),
        shells_table=table,
        load_s=loaded - started,
        build_s=built - loaded,
        variant=chosen,
        mitsuba_scene=scene,
        integrator=integrator,
    )


def _integrator(own: Any, engine: str | None, path: Path, field_file: Path) -> Any:
    """The scene's own integrator, or one for the engine that is asked for."""
    import mitsuba as mi

    if engine is not None and engine not in ENGINES:
        raise InputError(f"There is no engine {engine!r}; use one of {', '.join(ENGINES)}.")
    if not hasattr(own, "image"):
        raise InputError(
            f"{path} has the integrator {own.class_name()}, which computes light and not hits; use "
            '<integrator type="first_hit"/>.'
        )
    if engine is None or engine == own.engine:
        return own
    # The two kinds of normals have their counterparts: each kind converges to its gradient.
    smooth = own.normals == "gradient" if engine == "continuous" else own.gradient == "recovered"
    if engine == "shells":
        chosen = {"type": "first_hit", "normals": "gradient" if smooth else "facet"}
    else:
        chosen = {
            "type": "gradient_path",
            "field": str(field_file.resolve()),
            "gradient": "recovered" if smooth else "constant",
        }
    return mi.load_dict({**chosen, "trace_all": own.trace_all})


def _field_table(cells: Any, shells: dict[str, Any], path: Path) -> dict[str, Any]:
    """What the field's file says of air and source, and the notes beside the shells."""
    theirs = (shells.get("source") or {}).get("sha256", cells.source["sha256"])
    if theirs != cells.source["sha256"]:
        warnings.warn(
            f"The shells of {path} were made from another field than its field file, so the two "
            "engines trace different air; write the scene again.",
            IriftraceWarning,
            stacklevel=3,
        )
    return {"air": cells.air, "source": cells.source, "notes": shells.get("notes")}


def _normals(wanted: str, tables: Any) -> str:
    if wanted == "facet" or not tables.has_normals:
        return "facet"
    without = len(tables.facet_shells)
    return f"gradient, but facet for {without} of the shells" if without else wanted


def _index_rule(path: Path, table: dict[str, Any], tables: Any) -> str:
    """The table's rule, as long as the scene has the table's shells."""
    rule: str | None = table.get("rule")
    if rule is None:
        return "not stated"
    if tables.stock_shells:
        return f"edited: {rule} shells as Mitsuba's dielectric"
    pairs = tables.index_pairs
    listed = [(1 + row["ext"], 1 + row["int"]) for row in table.get("shells", [])]
    kept = sum(any(np.allclose(pair, own, rtol=0, atol=1e-12) for own in pairs) for pair in listed)
    if kept == len(listed) == len(pairs):
        return rule
    warnings.warn(
        f"{path} has {len(pairs)} shells, {kept} of the {len(listed)} that were made for it, so "
        "the air is cut into other layers than the field asks for; results say that it was edited.",
        IriftraceWarning,
        stacklevel=3,
    )
    return f"edited: {kept} of {len(listed)} {rule} shells, {len(pairs) - kept} others"


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _shells_table(file: SceneFile) -> dict[str, Any]:
    folders = {path.parent for path in file.shell_paths}
    for folder in folders:
        table = folder / "shells.json"
        if table.is_file():
            try:
                content = json.loads(table.read_text(encoding="utf-8"))
            except ValueError as error:
                raise InputError(
                    f"{table} is damaged ({error}); write the scene again, or remove the file "
                    "(then results do not state the field)."
                ) from error
            return content if isinstance(content, dict) else {}
    return {}


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
