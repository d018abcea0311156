"""A scene as Mitsuba traces it: its `mi.Scene`, integrator and tables, of one state of the air."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from operator import is_
from pathlib import Path
from typing import TYPE_CHECKING, Any

from attrs import evolve, field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.engines import Bending, Engine
from iriftrace.core.errors import InputError
from iriftrace.core.runtime import variant as runtime
from iriftrace.core.units import parse_quantity
from iriftrace.io.field_npz import FIELD_FILE
from iriftrace.medium.air.refractivity import dispersion
from iriftrace.medium.path_data import FieldCells
from iriftrace.medium.shells.table import AirStatement
from iriftrace.medium.source import FieldSource
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.tracing.air import Integrator, traced_air
from iriftrace.tracing.file import WAVELENGTH, warn_of_dielectric
from iriftrace.tracing.objects import mitsuba_scene

if TYPE_CHECKING:
    import mitsuba as mi

    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.plugins.kernels.tables import SceneTables


@frozen(eq=False)
class Compiled:
    """What a scene of one state of the air is in Mitsuba; freed with the scenes that have it.

    Attributes
    ----------
    camera, second : Camera; the second may be None
        What Mitsuba's first two sensors show.
    full_resolution : (2,) tuple of int, px
        Resolution of that sensor's film before ``scale`` changed it.
    engine : Engine
        Shells or cells.
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
    variant : str
        Mitsuba's variant.
    """

    camera: Camera
    full_resolution: tuple[int, ...]
    engine: Engine
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
    _state: dict[str, object] | None = field(default=None, repr=False)

    def __attrs_post_init__(self) -> None:
        # Mitsuba's scene refers to its integrator, whose tables refer to the scene. Both are freed
        # only if one of them drops its reference.
        weakref.finalize(self, self.integrator.forget).atexit = False

    @property
    def mitsuba_scene(self) -> mi.Scene:
        """The scene in Mitsuba; InputError if `mi.traverse` has changed it since `from_mitsuba`."""
        if self._state is not None:
            from iriftrace.plugins.scene_state import same_state, scene_state

            if not same_state(self._state, scene_state(self._mitsuba_scene)):
                raise InputError(
                    "The mi.Scene was changed since from_mitsuba; call from_mitsuba again.",
                    code="scene.changed",
                )
        return self._mitsuba_scene

    @property
    def tables(self) -> SceneTables:
        """Meshes and indices, as the kernels read them."""
        tables: SceneTables = self.integrator.prepare(self.mitsuba_scene).tables
        return tables

    @property
    def source(self) -> FieldSource | None:
        """Facts about the file that the air comes from."""
        return self.stated.source

    def unscaled(self, camera: Camera) -> tuple[int, ...]:
        """Resolution of a camera before ``scale`` changed it, px.

        That of the film for a camera with as many pixels as the scene's own, else the camera's.
        """
        own = camera.resolution == self.camera.resolution
        return self.full_resolution if own else camera.resolution

    def same_field(self, other: Compiled) -> bool:
        """True if both state the same state of a file as the source of their air."""
        own, its = (one.source.state if one.source else None for one in (self, other))
        return own == its

    def through_cells(self, name: str, cells: FieldCells) -> Compiled:
        """The same scene traced through cells."""
        started = time.perf_counter()
        with runtime.using(self.variant):
            integrator = integrator_for(self.integrator, Engine.CELLS, name, Path(FIELD_FILE))
            integrator.use(cells)
            integrator.prepare_as(self.integrator)
            tables = integrator.prepare(self.mitsuba_scene).tables
        return evolve(
            self,
            integrator=integrator,
            build_s=self.build_s + time.perf_counter() - started,
            **traced_air(integrator, self.stated, name, tables),
        )


@frozen(eq=False)
class Origin:
    """The file that a scene was read from; a scene with other part, air or blockers has none."""

    path: Path  # absolute
    sha256: str
    given: str  # as the user wrote it
    variables: dict[str, str]  # values given for the file's parameters
    part_to_world: FloatArray  # (4, 4), of the part's file
    compile: Callable[[dict[str, str], Engine], Compiled]  # for its parameters and an engine
    bodies: tuple[object, ...]  # part, air and blockers as they were read


class Held:
    """What was made of a scene; scenes that differ in nothing but their devices share it."""

    def __init__(self, values: tuple[object, ...] = ()) -> None:
        self.values = values
        self.compiled: Compiled | None = None
        self.members: dict[int, Any] = {}  # scenes of an ensemble's members by their numbers
        self.triangles = 0  # of their shells
        self.cells: Any = None  # the scene that is traced through cells instead, if there is one
        self.cells_sought = False
        self.shells: Any = None  # the ensemble whose cells this one traces

    def of_others(self, bodies: tuple[object, ...]) -> bool:
        """True for what was made of a checked scene with other bodies, so these are unchecked."""
        *before, _light, _engine, _variant, stored = self.values or (False,) * 4
        return bool(stored) and not same(tuple(before), bodies)


def same(some: tuple[object, ...], others: tuple[object, ...]) -> bool:
    """True for the same objects."""
    return len(some) == len(others) and all(map(is_, some, others))


def of_objects(
    part: Part,
    shells: ShellStack,
    devices: Mapping[str, Camera],
    blockers: Sequence[Part],
    stated: AirStatement,
    *,
    normals: str,
    wavelength_nm: float | None,
    variant: str,
) -> Compiled:
    """Compile objects with the shells of one state of the air; see `mitsuba_scene`."""
    started = time.perf_counter()
    with runtime.using(variant):
        scene = mitsuba_scene(part, shells, devices, normals=normals, blockers=blockers)
        if wavelength_nm is not None:
            stated = set_shells(scene, stated, wavelength_nm)
        loaded = time.perf_counter()
        integrator: Integrator = scene.integrator()
        found = traced_air(integrator, stated, "the scene", integrator.prepare(scene).tables)
    return Compiled(
        camera=devices["camera"],
        second=next((one for name, one in devices.items() if name != "camera"), None),
        full_resolution=devices["camera"].resolution,
        load_s=loaded - started,
        build_s=time.perf_counter() - loaded,
        variant=variant,
        mitsuba_scene=scene,
        integrator=integrator,
        **found,
    )


def of_mitsuba(scene: mi.Scene) -> tuple[Compiled, Part, tuple[Camera, Camera | None, str]]:
    """A scene made with Mitsuba, its part and its devices; see `iriftrace.from_mitsuba`."""
    variant = runtime.ensure()
    import mitsuba as mi

    from iriftrace.plugins.scene_state import scene_state

    if not isinstance(scene, mi.Scene):
        raise InputError(
            f"from_mitsuba takes a mitsuba.Scene of the variant {mi.variant()}, not a "
            f"{type(scene).__name__}; `load_scene` reads files.",
            code="scene.wrong_type",
        )
    name = "Your mi.Scene"
    integrator = integrator_for(scene.integrator(), Engine.AUTO, name, Path(FIELD_FILE))
    sensors = sensors_of(scene, name)
    devices = devices_of(sensors)
    started = time.perf_counter()
    integrator.refresh(scene)
    tables = integrator.prepare(scene).tables
    found = traced_air(integrator, AirStatement(), name, tables)
    if tables.stock_shells:
        warn_of_dielectric(name)
    compiled = Compiled(
        camera=devices[0],
        second=devices[1],
        full_resolution=full_resolution_of(sensors[0]),
        load_s=0.0,
        build_s=time.perf_counter() - started,
        variant=variant,
        mitsuba_scene=scene,
        integrator=integrator,
        state=scene_state(scene),
        **found,
    )
    return compiled, part_of_mesh(*tables.part_arrays(), name=name), devices


def set_wavelength(integrator: Integrator, values: Mapping[str, str]) -> None:
    """Set another wavelength than that of the cells engine's field, if requested."""
    if WAVELENGTH in values:
        integrator.wavelength_nm = parse_quantity(values[WAVELENGTH], "nm")


def set_shells(scene: mi.Scene, stated: AirStatement, wavelength_nm: float) -> AirStatement:
    """Give the shells of a Mitsuba scene another wavelength, and return the statement of it.

    n - 1 of all the air, hot or not, is proportional to that of the ambient air (Gladstone and
    Dale). The shells do not move, because each lies at one temperature.
    """
    from iriftrace.plugins.kernels.tables import shell_indices

    factor = dispersion(stated.air, wavelength_nm)
    shells = {}
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        if shell_indices(bsdf) is None:
            continue
        if not hasattr(bsdf, "ext_ior"):
            raise InputError(
                "The scene has shells with Mitsuba's dielectric, whose indices are not stated, so "
                "they cannot be changed to another wavelength; use iso_shell.",
                code="scene.dielectric",
            )
        # Several shapes may use one bsdf.
        shells[id(bsdf)] = bsdf
    for bsdf in shells.values():
        indices = (bsdf.ext_ior, bsdf.int_ior, bsdf.iso_ior)
        bsdf.set_indices(*(1.0 + factor * (index - 1.0) for index in indices))
    return stated.at_wavelength(wavelength_nm)


def sensors_of(scene: mi.Scene, name: str) -> list[mi.Sensor]:
    """Sensors of a Mitsuba scene, of which there is at least one; none shares another's film."""
    from iriftrace.plugins.film import refuse_shared_films

    sensors: list[mi.Sensor] = scene.sensors()
    if not sensors:
        raise InputError(
            f"{name} has no sensor, so it cannot be rendered; add one.", code="scene.no_sensor"
        )
    refuse_shared_films(sensors)
    return sensors


def devices_of(sensors: Sequence[mi.Sensor]) -> tuple[Camera, Camera | None, str]:
    """Cameras of the first two sensors, and the id of the second one."""
    second = sensors[1] if len(sensors) > 1 else None
    return (
        camera_of_sensor(sensors[0]),
        None if second is None else camera_of_sensor(second),
        "" if second is None else str(second.id()),
    )


def full_resolution_of(sensor: mi.Sensor) -> tuple[int, ...]:
    """Resolution of a sensor's film before ``scale`` changed it, px."""
    from iriftrace.plugins.film import camera_of

    return tuple(camera_of(sensor).full_resolution())


def camera_of_sensor(sensor: mi.Sensor) -> Camera:
    """The camera of a sensor, for its film's crop window alone."""
    from iriftrace.plugins.film import camera_of

    camera = Camera.from_dict(camera_of(sensor).description())
    (left, top), (width, height) = sensor.film().crop_offset(), sensor.film().crop_size()
    if (width, height) == camera.resolution:
        return camera
    return camera.cropped(int(left), int(top), int(width), int(height))


def integrator_for(own: Integrator, engine: Engine, name: str, field_file: Path) -> Integrator:
    """The scene's own integrator, or one for the requested engine."""
    import mitsuba as mi

    if not hasattr(own, "image"):
        raise InputError(
            f"{name} has the integrator {own.class_name()}, which computes light and not hits; use "
            '<integrator type="first_hit"/>.',
            code="scene.integrator",
        )
    if engine.free or engine.through_cells == Engine(own.engine).through_cells:
        return own
    # The two kinds of normals have counterparts: each kind converges to its gradient.
    if engine.through_cells:
        chosen = {
            "type": "gradient_path",
            "field": str(field_file.resolve()),
            "gradient": "recovered" if own.normals == "gradient" else "constant",
        }
    else:
        normals = "gradient" if own.gradient == "recovered" else "facet"
        chosen = {"type": "first_hit", "normals": normals}
    return mi.load_dict({**chosen, "trace_all": own.trace_all})
