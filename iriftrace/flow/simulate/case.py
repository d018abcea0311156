"""Case of natural convection as one value: part, air, times, mesh; its record on disk."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import asdict, evolve, field, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.flow.simulate.bodies import Body, check_bodies, check_inlets, check_mirrored_bodies
from iriftrace.flow.simulate.domain import Domain, MeshSize, air_lengths, domain_around, mesh_size
from iriftrace.flow.simulate.draught import Draught, Lean, leans, rise_speed
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.part_surface import (
    check_mirrors,
    is_symmetric,
    mirrored_points,
    symmetric_axes,
)
from iriftrace.flow.simulate.times import Times, natural_times
from iriftrace.io.refusals import damaged
from iriftrace.medium.source import Variation
from iriftrace.part.part import Part, refuse_unlikely_size
from iriftrace.part.region_choice import values_by_region
from iriftrace.part.wall_temperature import WallTemperatures, wall_temperature

RECORD = "case.json"
"""Record in the case's folder of what was requested, so that a later call continues it."""
UNFINISHED = "unfinished"
"""File in the folder of a case whose files are not all written yet."""
# Sideways distances, as fractions of the height, at which a leaning plume is searched.
_LEANS = (0.0, 0.25, 0.5)
_SAME_MM = 1e-3

STANDARD_SIMULATION = SimulationOptions()


@frozen(eq=False)
class Case:
    """A closed part in air; temperatures in K, lengths in mm, world; gravity along -z."""

    part: Part
    wall: WallTemperatures
    size: MeshSize
    times: Times
    options: SimulationOptions = STANDARD_SIMULATION  # air, floor and processes
    mirrors: str = ""  # axes at whose centre plane the field is mirrored: "", "x", "y" or "xy"
    draught: Draught | None = None  # None in still air
    bodies: tuple[Body, ...] = ()
    family: tuple[Draught, ...] = ()  # draughts of all cases that use the same mesh
    variation: Variation | None = None  # of a case that varies another one, and uses its mesh
    domain: Domain = field(init=False)

    def __attrs_post_init__(self) -> None:
        """Refuse what cannot be simulated, before anything is written."""
        if not self.part.closed:
            raise InputError(
                f"{self.part.path} is not closed, so the air cannot be meshed around it; close the "
                "holes of its surface first.",
                code="part.open",
            )
        self.wall.check(self.part, self.options.ambient)
        check_mirrors(self.part, self.mirrors)
        if self.draught is not None and (crossed := self.draught.crossed(self.mirrors)):
            raise InputError(
                f"the {self.draught.text} blows through the symmetry plane across {crossed[0]}, so "
                f"half of the air is not enough; leave {crossed} out of the symmetry.",
                code="draught.across_symmetry",
                argument="symmetry",
            )
        for name in self.mirrors if self.wall.varies(self.part) else "":
            if not _has_mirrored_wall(self, name):
                raise InputError(
                    f"the wall's temperatures are not symmetric about {name} = "
                    f"{self.part.centre['xy'.index(name)]:g} mm, so the field is not; leave "
                    f"{name} out of the symmetry.",
                    code="wall.asymmetric",
                    argument="symmetry",
                )
        domain = domain_around(
            self.part,
            self.size,
            self.mirrors,
            self.options.margin,
            self.options.floor,
            self._leaning,
        )
        check_mirrored_bodies(self.bodies, self.part.centre, self.mirrors)
        check_bodies(self.bodies, self.part, domain, self.options.floor is not None)
        if self.draught is not None:
            check_inlets(self.bodies, self.draught.inlets, domain)
        object.__setattr__(self, "domain", domain)

    @property
    def probes(self) -> tuple[tuple[float, float, float], ...]:
        """Points, mm, at which the plume's temperature is monitored; in a draught leeward too."""
        points = np.array(self.domain.probes)
        if self.draught is not None:
            wind = np.array((*self.draught.source[:2], 0.0))
            heights = points[:, 2:] - self.part.bounds[1][2]
            points = np.concatenate([points - lean * heights * wind for lean in _LEANS])
        return tuple((float(x), float(y), float(z)) for x, y, z in points)

    @property
    def _leaning(self) -> tuple[Lean, ...]:
        """Leans of the plumes for which the mesh is refined."""
        height = float(np.ptp(self.part.bounds[:, 2]))
        own = () if self.draught is None else (self.draught,)
        temperatures = {"wall": self.wall.hottest, "ambient": float(self.options.ambient)}
        if self.variation is not None and self.variation.quantity in temperatures:
            temperatures[self.variation.quantity] -= self.variation.step
        return leans(self.family or own, rise_speed(height, *temperatures.values()))

    def record(self) -> JsonObject:
        """Values on which flow and mesh depend."""
        return {
            "part_sha256": self.part.sha256,
            "part_bounds_mm": np.round(self.part.bounds, 6).tolist(),
            "wall_k": self.wall.default,
            "regions_k": self.wall.regions,
            "transition_mm": self.wall.transition,
            "wall_from": None if self.wall.measured is None else self.wall.measured.record(),
            "ambient_k": self.options.ambient,
            "pressure_pa": self.options.pressure,
            "background_mm": self.size.background,
            "mirrors": self.mirrors,
            "margin": self.options.margin,
            "draught_m_s": None if self.draught is None else list(self.draught.velocity),
            "bodies": [body.record() for body in self.bodies],
            "floor_mm": self.options.floor,
            "leaning": [asdict(lean) for lean in self._leaning],
        }


def natural_case(
    part: Part,
    options: SimulationOptions,
    *,
    mirrors: str | None = None,
    draught: Draught | None = None,
    family: Sequence[Draught] = (),
    wall: WallTemperatures | None = None,
    bodies: Sequence[Body] | None = None,
) -> Case:
    """Case of a part in air, with mesh and times that suit its size and temperature.

    Planes of symmetry, wall and bodies are those of the options unless given. The mesh is also fine
    enough for the draughts of a `family`. Raises InputError if it cannot be simulated.
    """
    refuse_unlikely_size(part)
    wall = options.wall() if wall is None else wall
    wall = evolve(wall, regions=values_by_region(part, wall.regions))
    wall.check(part, options.ambient)
    extents = np.ptp(part.bounds, axis=0)
    crossing = 0.0
    if draught is not None:
        crossing = draught.crossing(air_lengths(part, options.margin))
    times = natural_times(options, float(extents.max()), wall.hottest, crossing)
    size = mesh_size(options.resolution, extents, options.background_cell)
    planes = options.mirrors if mirrors is None else mirrors
    others = options.bodies(part.length_unit) if bodies is None else bodies
    return Case(part, wall, size, times, options, planes, draught, tuple(others), tuple(family))


def is_stored(case: Case, folder: Path) -> bool:
    """True if the folder holds this case, possibly with other times; InputError if other files.

    A case whose files were not all written, as it was interrupted, is to be written again.
    """
    file = folder / RECORD
    if file.is_file():
        stored, current = read_record(file), json.loads(json.dumps(case.record()))
        different = [name for name, value in current.items() if stored.get(name) != value]
        if different:
            raise InputError(
                f"the folder {folder} holds a case that differs in {', '.join(different)}; name "
                "another folder, or give the same options to continue it.",
                code="output.other_work",
            )
        return True
    if folder.is_dir() and any(folder.iterdir()) and not (folder / UNFINISHED).is_file():
        raise InputError(
            f"the folder {folder} holds files that are not a case of iriftrace and would be "
            "overwritten; name an empty or a new one.",
            code="output.replaces",
            argument="output",
        )
    return False


def read_record(file: Path) -> JsonObject:
    """Content of a JSON file in a case's folder; raises InputError if it is damaged."""
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        stored = error
    if not isinstance(stored, dict):
        raise damaged(file, stored, "delete the folder, or name another one")
    return stored


def recorded_wall(folder: Path, part: Part) -> WallTemperatures | str | None:
    """Temperatures of the wall in the record of a case's folder; None without one for this part.

    The name of their file, which may be gone, if they were measured.
    """
    file = folder / RECORD
    if not file.is_file():
        return None
    try:
        stored = read_record(file)
        bounds = np.asarray(stored["part_bounds_mm"], dtype=np.float64)
        if not (bounds.shape == (2, 3) and np.allclose(bounds, part.bounds, atol=_SAME_MM)):
            return None
        if stored.get("wall_from"):
            return str(stored["wall_from"]["file"])
        return WallTemperatures(
            float(stored["wall_k"]),
            {str(name): float(kelvin) for name, kelvin in stored["regions_k"].items()},
            float(stored["transition_mm"]),
        )
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return None  # a damaged file, or another program's file of this name


_PLACES = 2000
"""Points on the wall at which its temperatures are compared with those of its mirror image."""


def symmetric_case(case: Case) -> str:
    """Axes of "xy" across which part, temperatures and bodies are symmetric."""
    return "".join(
        name
        for name in symmetric_axes(case.part)
        if _has_mirrored_wall(case, name)
        and all(is_symmetric(body.surface, name, case.part.centre) for body in case.bodies)
    )


def _has_mirrored_wall(case: Case, name: str) -> bool:
    part, axis = case.part, "xy".index(name)
    places, _ = part.surface.even_places(_PLACES)
    here = wall_temperature(case.wall, part, places)
    other = mirrored_points(places, axis, part.centre[axis])
    return bool(np.mean(np.abs(wall_temperature(case.wall, part, other) - here) > 1.0) <= 0.01)
