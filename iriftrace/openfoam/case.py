"""What is simulated, as one value, and the folder in which it is written down."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from attrs import field, frozen

from iriftrace.errors import InputError
from iriftrace.openfoam.domain import Domain, domain_around
from iriftrace.openfoam.resolution import MeshSize
from iriftrace.openfoam.symmetry import check_mirrors, mirrored_points
from iriftrace.openfoam.times import Times
from iriftrace.openfoam.wall import WallTemperatures, wall_temperature
from iriftrace.part import Part
from iriftrace.whole_file import whole_file

RECORD = "case.json"
"""In the case's folder: what was asked for, so that a later call goes on with the same."""

AMBIENT_RANGE = (200.0, 400.0)  # K
PRESSURE_RANGE = (60e3, 120e3)  # Pa
_MOST_PROCESSES = 1024


@frozen(eq=False)
class Case:
    """A part in air; temperatures in K, lengths in mm, world.

    Attributes
    ----------
    part : Part
        Closed, mm, world; gravity along -z.
    wall : WallTemperatures
    ambient_k, pressure_pa : float
        Air far away.
    size : MeshSize
    times : Times
    mirrors : str
        Axes at whose centre plane the field is mirrored: "", "x", "y" or "xy".
    margin : float
        Factor on the air around the part.
    processes : int
        Processes for the solver.
    """

    part: Part
    wall: WallTemperatures
    size: MeshSize
    times: Times
    ambient_k: float = 293.15
    pressure_pa: float = 101325.0
    mirrors: str = ""
    margin: float = 1.0
    processes: int = 1
    domain: Domain = field(init=False)

    def __attrs_post_init__(self) -> None:
        """Refuse what cannot be simulated, before anything is written."""
        if not self.part.closed:
            raise InputError(
                f"{self.part.path} is not closed, so no mesh can keep the air out of it; close the "
                "holes of its surface first."
            )
        _check_range(self.ambient_k, AMBIENT_RANGE, "an ambient temperature", "K")
        _check_range(self.pressure_pa, PRESSURE_RANGE, "an air pressure", "Pa")
        _check_range(self.margin, (0.25, 4.0), "a margin", "times the usual air around the part")
        if not 1 <= self.processes <= _MOST_PROCESSES:
            raise InputError(
                f"the solver cannot run as {self.processes} processes; give a number from 1 to "
                f"{_MOST_PROCESSES}."
            )
        self.wall.check(self.part, self.ambient_k)
        check_mirrors(self.part, self.mirrors)
        if self.mirrors and self.wall.regions:
            _check_mirrored_wall(self)
        domain = domain_around(self.part, self.size, self.mirrors, self.margin)
        object.__setattr__(self, "domain", domain)

    def record(self) -> dict[str, Any]:
        """What the flow and the mesh depend on."""
        return {
            "part_sha256": self.part.sha256,
            "part_bounds_mm": np.round(self.part.bounds, 6).tolist(),
            "wall_k": self.wall.default,
            "regions_k": self.wall.regions,
            "transition_mm": self.wall.transition,
            "ambient_k": self.ambient_k,
            "pressure_pa": self.pressure_pa,
            "background_mm": self.size.background,
            "mirrors": self.mirrors,
            "margin": self.margin,
        }


def stored_record(folder: Path) -> dict[str, Any] | None:
    """What an earlier call wrote down in a folder; None where there is no case of ours.

    Raises
    ------
    InputError
        The folder holds other files, which are not overwritten.
    """
    file = folder / RECORD
    if file.is_file():
        return read_record(file)
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(
            f"the folder {folder} holds files that are no case of iriftrace, which would be "
            "overwritten; name an empty or a new one."
        )
    return None


def read_record(file: Path) -> dict[str, Any]:
    """What a file of ours in a case's folder says.

    Raises
    ------
    InputError
        It is damaged.
    """
    try:
        stored = json.loads(file.read_text())
    except ValueError as error:
        stored = error
    if not isinstance(stored, dict):
        raise InputError(
            f"{file}, in which is written what was done so far, is damaged ({stored}); delete the "
            "folder, or name another one."
        )
    return stored


def check_same(case: Case, stored: dict[str, Any], folder: Path) -> None:
    """Refuse to go on with another case than the one in the folder; times may differ.

    Raises
    ------
    InputError
    """
    wanted = json.loads(json.dumps(case.record()))
    different = [name for name, value in wanted.items() if stored.get(name) != value]
    if different:
        raise InputError(
            f"the folder {folder} holds a case that differs in {', '.join(different)}; name "
            "another folder, or give the same options to go on with it."
        )


def keep_record(case: Case, folder: Path) -> None:
    """Write down what the case is."""
    with whole_file(folder / RECORD) as temporary:
        temporary.write_text(json.dumps(case.record(), indent=1) + "\n")


def _check_range(value: float, limits: tuple[float, float], what: str, unit: str) -> None:
    low, high = limits
    if not low <= value <= high:
        raise InputError(
            f"{what} of {value:g} {unit} cannot be simulated here; give one from {low:g} to "
            f"{high:g}."
        )


def _check_mirrored_wall(case: Case) -> None:
    """A mirrored half has mirrored temperatures."""
    part = case.part
    here = wall_temperature(case.wall, part, part.face_centres)
    for name in case.mirrors:
        axis = "xy".index(name)
        other = mirrored_points(part.face_centres, axis, part.centre[axis])
        share = part.face_areas[np.abs(wall_temperature(case.wall, part, other) - here) > 1.0].sum()
        if share > 0.01 * part.area:
            raise InputError(
                f"the wall's temperatures are not symmetric about {name} = "
                f"{part.centre[axis]:g} mm, so the field is not; leave {name} out of --symmetry."
            )
