"""Worlds whose flow is solved again, in which U must hold.

A cylinder of 30 mm at 800 degC in draughts. Each world has its own draught, wall, ambient air and
pressure, and its flow is solved for them: once on another mesh than the members, and once in
draughts stronger than those of all members, where a board behind the part tells which air it was.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve, frozen

import iriftrace
from iriftrace.cli import main
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.index_field import IndexField
from iriftrace.part.board import Board
from validation.coverage import Held, held_by
from validation.inputs.cameras import camera_at
from validation.inputs.leaning_air import measured_shifts

WALL_C, AMBIENT_C, PRESSURE_HPA = 800.0, 20.0, 1013.25
DRAUGHTS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3)
"""Of the members, m/s, from +y."""

VARIED = DRAUGHTS.index(0.2)
"""The member with the largest effect, solved again with other inputs and on the other mesh."""

OUTSIDE = (0.35, 0.5)
"""Range of the draughts of the worlds with a board, m/s."""

MEMBERS_MM, OTHER_MM = 44.0, 36.0
"""Background cells of the members and of the worlds on another mesh; a sixteenth at the wall."""

STATED = Inputs.of("wall 15 K, ambient 2 K, pressure 3 hPa, sensor 2 um")
SENSOR_MM, DOT_PX = 0.002, 0.05

BOARD = Board((240.0, 240.0), 3.5)
BOARD_TO_WORLD = np.array(((0, 0, 1.0, -170.0), (1.0, 0, 0, 0), (0, 1.0, 0, 60.0), (0, 0, 0, 1.0)))
"""The board stands across the cylinder's axis, behind its end."""

BOARD_CAMERA = camera_at(
    (400.0, 0.0, 60.0),
    (0.0, 0.0, 60.0),
    focal_length_mm=25.0,
    sensor_mm=(12.0, 12.0),
    resolution=(2000, 2000),
)
DEVICE = iriftrace.Camera(focal_length_mm=25.0, sensor_mm=(4.0, 3.2), resolution=(60, 48))


@frozen
class State:
    """Draught, m/s, and wall, ambient air (degC) and pressure (hPa) of a simulation."""

    draught: float
    wall_c: float = WALL_C
    ambient_c: float = AMBIENT_C
    pressure_hpa: float = PRESSURE_HPA

    def case(self, folder: Path, cell_mm: float) -> Path:
        """Folder of its flow on a mesh."""
        state = f"{self.draught:g}m_s_{self.wall_c:g}C_{self.ambient_c:g}C_{self.pressure_hpa:g}hPa"
        return folder / f"{state}_{cell_mm:g}mm"

    def field(self, folder: Path, cell_mm: float, vary: str = "") -> IndexField:
        """Its field, solved unless the folder has it."""
        case = self.case(folder, cell_mm)
        file = case / "field.vtu"
        if not file.is_file():
            part = folder / "part.ply"
            if not part.is_file():
                folder.mkdir(parents=True, exist_ok=True)
                main(f"part cylinder -o {part} --diameter 30mm --length 40mm".split())
            words = ["field", "simulate", str(part), "-o", str(case / "case")]
            words += ["--field", str(file), "--symmetry", "x", "--end-time", "3 s"]
            words += ["--average-time", "1.5 s", "--background-cell", f"{cell_mm} mm"]
            words += ["--wall-temperature", f"{self.wall_c} degC"]
            words += ["--ambient", f"{self.ambient_c} degC"]
            words += ["--pressure", f"{self.pressure_hpa} hPa"]
            if self.draught > 0.0:
                words += ["--draught", f"{self.draught} m/s", "--draught-from", "90"]
            if vary:
                words += ["--vary", vary]
            if code := main(words):
                raise SystemExit(code)
        return iriftrace.read_field(file)


def drawn(rng: np.random.Generator, low: float, high: float) -> State:
    """A world of a draught in a range and of normal errors of what is stated."""
    assert STATED.wall_k is not None
    assert STATED.ambient_k is not None
    assert STATED.pressure_pa is not None
    wall, ambient, pressure = rng.normal(size=3)
    return State(
        round(rng.uniform(low, high), 4),
        round(WALL_C + STATED.wall_k * wall, 3),
        round(AMBIENT_C + STATED.ambient_k * ambient, 3),
        round(PRESSURE_HPA + 0.01 * STATED.pressure_pa * pressure, 3),
    )


def members(folder: Path) -> list[IndexField]:
    """Fields of the draughts, and of one with each input changed by what is stated."""
    varied = "wall 15 K, ambient 2 K, pressure 3 hPa"
    fields = [
        State(draught).field(folder, MEMBERS_MM, varied if n == VARIED else "")
        for n, draught in enumerate(DRAUGHTS)
    ]
    of = State(DRAUGHTS[VARIED]).case(folder, MEMBERS_MM)
    return fields + [
        iriftrace.read_field(of / f"field_{name}.vtu") for name in ("wall", "ambient", "pressure")
    ]


def scene_in(air: iriftrace.HotAir, part: iriftrace.Part) -> iriftrace.Scene:
    """Two devices to the lee."""
    first, second = (
        DEVICE.at(iriftrace.look_at((x, -283.0, 283.0), (0.0, 0.0, 0.0))) for x in (-75.0, 75.0)
    )
    return iriftrace.Scene(part, air, first, second, "camera_2", engine="cells")


def on_another_mesh(folder: Path, count: int, rng: np.random.Generator) -> list[Held]:
    """Worlds whose flow is solved on another mesh; what the meshes differ by is stated."""
    family = members(folder)
    part = iriftrace.read_part(folder / "part.ply")
    other = State(DRAUGHTS[VARIED]).field(folder, OTHER_MM)
    inputs = evolve(STATED, mesh=difference(family[VARIED], other, part))
    scene = scene_in(iriftrace.HotAir(family), part)
    found = []
    for state in [drawn(rng, DRAUGHTS[0], DRAUGHTS[-1]) for _ in range(count)]:
        field = state.field(folder, OTHER_MM)
        true = scene_in(iriftrace.HotAir(field), part)
        found.append(held_by(scene, true, inputs, SENSOR_MM, rng))
    return found


def difference(one: IndexField, other: IndexField, part: iriftrace.Part) -> float:
    """What the error of the diameter differs by in another mesh, as a fraction of that in one."""
    errors = []
    for field in (one, other):
        scan = iriftrace.measure(scene_in(iriftrace.HotAir(field), part))
        (feature,) = scan.features(part, ["cylinder"], gate=None)
        diameters = [feature.fits[name].size_mm or np.nan for name in ("measured", "cold")]
        errors.append(diameters[0] - diameters[1])
    return abs(errors[1] / errors[0] - 1.0)


def with_a_board(folder: Path, count: int, rng: np.random.Generator) -> list[Held]:
    """Worlds in stronger draughts than the members', whose weights a board has found."""
    draughts = members(folder)[: len(DRAUGHTS)]
    part = iriftrace.read_part(folder / "part.ply")
    board = BOARD.part.transformed(BOARD_TO_WORLD)
    found = []
    for n, state in enumerate([drawn(rng, *OUTSIDE) for _ in range(count)]):
        field = state.field(folder, MEMBERS_MM)
        air = iriftrace.HotAir(field)
        seen = iriftrace.Scene(board, air, BOARD_CAMERA, blockers=(part,), engine="cells")
        shifts = measured_shifts(seen, DOT_PX, seed=n, board=BOARD, to_world=BOARD_TO_WORLD)
        fit = iriftrace.fit_members(evolve(seen, air=iriftrace.HotAir(draughts)), shifts)
        fitted = iriftrace.HotAir(draughts, weights=fit.weights)
        scene = scene_in(fitted, part)
        found.append(held_by(scene, scene_in(air, part), STATED, SENSOR_MM, rng))
    return found
