"""Worlds in which U holds: drawn from the stated inputs, each traced, measured and corrected.

A cylinder of 12 mm in air of a formula, whose plume leans in a draught. In each world the plume
leans anywhere between the members', and wall, ambient air and pressure are off by normal errors;
its air is made anew on the mesh and traced, so that the truth does not come from the linear model
that the budget uses. The cloud has the sensor's noise.

    python -m validation.coverage 200
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path
from typing import Literal

import numpy as np
import pyvista as pv
import trimesh
from attrs import evolve, frozen

import iriftrace
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.measuring.features.choice import on_region
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import Variation
from iriftrace.part.part import part_of_mesh
from validation.inputs.cameras import camera_at

RADIUS = 6.0
LEANS = (0.0, 0.2, 0.4, 0.6)
AMBIENT_K, WALL_K, PRESSURE_PA = 293.15, 993.15, 101325.0

U_WALL_K, U_AMBIENT_K, U_PRESSURE_PA, U_SENSOR_MM = 15.0, 2.0, 300.0, 0.0005
"""Standard uncertainties of the worlds."""

INPUTS = Inputs(
    wall_k=U_WALL_K, ambient_k=U_AMBIENT_K, pressure_pa=U_PRESSURE_PA, sensor_mm=U_SENSOR_MM
)


STEPS: tuple[tuple[Literal["wall", "ambient", "pressure"], str, float], ...] = (
    ("wall", "wall_k", 20.0),
    ("ambient", "ambient_k", 4.0),
    ("pressure", "pressure_pa", 1000.0),
)
"""Inputs with which the first member is solved again, and by how much more."""


@frozen
class State:
    """Lean of the plume, mm/mm, in a draught; wall, ambient air (K) and pressure (Pa)."""

    lean: float
    wall_k: float = WALL_K
    ambient_k: float = AMBIENT_K
    pressure_pa: float = PRESSURE_PA


def field_in(state: State, folder: Path, name: str) -> IndexField:
    """The air of a state: a layer whose thickness has the similarity's p^(-1/2), and a plume."""
    axes = [np.linspace(-18.0, end, n) for end, n in ((42.0, 21), (18.0, 13), (42.0, 21))]
    grid = pv.StructuredGrid(*np.meshgrid(*axes, indexing="ij")).cast_to_unstructured_grid()
    x, y, z = np.asarray(grid.points).T
    off = np.hypot(np.maximum(np.hypot(x, y) - RADIUS, 0.0), np.maximum(np.abs(z) - RADIUS, 0.0))
    thickness = 3.0 * (state.pressure_pa / PRESSURE_PA) ** -0.5
    around = np.exp(-off / thickness) * np.maximum(1.0 - off / 11.0, 0.0)
    height = np.maximum(z - RADIUS, 0.0)
    across = (x - state.lean * height) ** 2 + y**2
    plume = height / (height + 4.0) * np.exp(-across / (2.0 * (4.0 + 0.05 * height) ** 2))
    plume *= np.maximum(1.0 - (height / 34.0) ** 2, 0.0)
    rise = state.wall_k - state.ambient_k
    grid.point_data["T"] = state.ambient_k + rise * (around + 0.65 * plume)
    file = folder / f"{name}.vtu"
    grid.save(file)
    air = Air(temperature_k=state.ambient_k, pressure_pa=state.pressure_pa)
    return iriftrace.read_field(file, air=air)


def members(folder: Path) -> list[IndexField]:
    """The draughts, and the first of them solved again with each input off by one step."""
    fields = [field_in(State(lean), folder, f"lean_{lean:g}") for lean in LEANS]
    of = fields[0].source.sha256
    for quantity, attribute, step in STEPS:
        state = State(LEANS[0])
        changed = evolve(state, **{attribute: getattr(state, attribute) + step})
        one = field_in(changed, folder, quantity)
        facts = evolve(one.source.facts, variation=Variation(quantity, step, of))
        fields.append(evolve(one, source=evolve(one.source, facts=facts)))
    return fields


def cylinder() -> iriftrace.Part:
    """The part, mm."""
    mesh = trimesh.creation.cylinder(RADIUS, 2.0 * RADIUS, sections=256)
    return part_of_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), name="cylinder")


def scene_in(air: iriftrace.HotAir, part: iriftrace.Part) -> iriftrace.Scene:
    """Two devices that look from above past the plume."""
    first, second = (
        camera_at((55.0, y, 70.0), (0.0, 0.0, 0.0), focal_length_mm=20.0, resolution=(36, 30))
        for y in (-25.0, 25.0)
    )
    return iriftrace.Scene(part, air, first, second, "camera_2", engine="cells")


def drawn(rng: np.random.Generator) -> State:
    """One world."""
    return State(
        rng.uniform(LEANS[0], LEANS[-1]),
        WALL_K + U_WALL_K * rng.normal(),
        AMBIENT_K + U_AMBIENT_K * rng.normal(),
        PRESSURE_PA + U_PRESSURE_PA * rng.normal(),
    )


@frozen
class Held:
    """What one world says of U."""

    error: float  # of the corrected diameter, mm
    expanded: float
    ratios: FloatArray  # of the points: error along the normal over u
    outside: bool  # the answer says that the air is outside the members

    @property
    def holds(self) -> bool:
        """True if the true diameter lies within U."""
        return abs(self.error) <= self.expanded


def held_by(
    scene: iriftrace.Scene,
    true: iriftrace.Scene,
    inputs: Inputs,
    sensor_mm: float,
    rng: np.random.Generator,
) -> Held:
    """Measure a cylinder in the true air, correct by a scene, compare with the truth."""
    scan = iriftrace.measure(true)
    noise = sensor_mm * rng.normal(size=(len(scan.points), 1)) * scan.normal
    found = iriftrace.correct(scan.points + noise, scene, inputs=inputs)
    (feature,) = found.features(scene.part, ["cylinder"], gate=None)
    good = found.corrected
    mantle = good & on_region(feature.region, found.face, scene.part)
    diameter = iriftrace.fit_feature(scan.true[mantle], "cylinder").size_mm
    size = feature.size
    along = np.einsum("ij,ij->i", found.points - scan.true, found.normal)[good]
    assert size.uncertainty is not None
    return Held(
        size.answer - diameter,
        size.uncertainty.expanded,
        along / found.u_normal[good],
        "air outside the members" in size.uncertainty.missing,
    )


def of_a_formula(count: int, rng: np.random.Generator) -> list[Held]:
    """Worlds drawn from what is stated, in the air of a formula."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = scene_in(iriftrace.HotAir(members(folder)), cylinder())
        found = []
        for _ in range(count):
            air = iriftrace.HotAir(field_in(drawn(rng), folder, "world"))
            found.append(held_by(scene, scene_in(air, scene.part), INPUTS, U_SENSOR_MM, rng))
    return found


def statements(worlds: list[Held]) -> list[str]:
    """Sentences on worlds: how many hold, and how large U is."""
    points = np.mean(np.abs(np.concatenate([one.ratios for one in worlds])) <= 2.0)
    expanded = 1e3 * np.median([one.expanded for one in worlds])
    error = 1e3 * np.median([abs(one.error) for one in worlds])
    outside = sum(one.outside for one in worlds)
    said = f"; of {outside} the answer says that the air is outside the members" if outside else ""
    return [
        f"{np.mean([one.holds for one in worlds]):.1%} of {len(worlds)} true diameters lie "
        f"within U{said}",
        f"{points:.1%} of the points lie within 2 u",
        f"median U {expanded:.3g} um, median error {error:.3g} um",
    ]


def main(count: int) -> None:
    warnings.simplefilter("ignore", IriftraceWarning)
    for sentence in statements(of_a_formula(count, np.random.default_rng(53))):
        print(sentence)


if __name__ == "__main__":
    main(int(sys.argv[1]))
