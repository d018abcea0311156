"""Families of draughts: members, what is solved and what mirrored, resuming; nothing is solved."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate import family_run
from iriftrace.flow.simulate.case import RECORD, UNFINISHED, Case, natural_case, symmetric_case
from iriftrace.flow.simulate.family import FamilyMember, plan_family
from iriftrace.flow.simulate.family_run import FAMILY, Remaining, Task, run_family, write_image
from iriftrace.flow.simulate.options import DraughtOptions, SimulationOptions
from iriftrace.flow.simulate.programs import Installation
from iriftrace.medium.origin import facts_of, origin_of, state_origin
from iriftrace.medium.source import FieldFacts
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import WallTemperatures

NONE = Installation("", "", "", {})
CELLS = 1000

Family = tuple[tuple[FamilyMember, ...], dict[str, Case]]
"""Members, and the case of each by name."""


COARSE = SimulationOptions(wall_temperature="1100 degC", resolution="coarse")


def wind(
    speeds: Sequence[float], directions: Sequence[float], *, between: bool = False
) -> DraughtOptions:
    return DraughtOptions(draughts=speeds, draught_from=directions, between=between)


def names(members: Sequence[FamilyMember]) -> list[str]:
    return [member.name for member in members]


def test_names_sort_and_the_still_air_is_one_member() -> None:
    members = plan_family(wind((0.0, 0.05, 0.1), (180.0, 22.5)), "", "")
    assert names(members) == sorted(names(members))
    assert names(members)[:3] == ["at_0.00", "at_0.05_from_022.5", "at_0.05_from_180"]
    assert len(members) == 5


def test_planes_are_those_that_the_wind_leaves() -> None:
    """Still air is solved on the mesh of the first direction."""
    members = {m.name: m for m in plan_family(wind((0.0, 0.1), (0.0, 45.0, 90.0)), "xy", "")}
    assert {name: m.planes for name, m in members.items()} == {
        "at_0.00": "y",
        "at_0.10_from_000": "y",
        "at_0.10_from_045": "",
        "at_0.10_from_090": "x",
    }


def test_members_between_others() -> None:
    """Halfway between neighbours, not across 90 degrees; still air counts for all directions."""
    members = plan_family(wind((0.0, 0.1), (350.0, 10.0, 100.0), between=True), "", "")
    shares = {member.name: dict(member.between) for member in members if member.between}
    assert shares == {
        "at_0.05_from_000": {"at_0.00": 0.5, "at_0.10_from_350": 0.25, "at_0.10_from_010": 0.25},
        "at_0.05_from_010": {"at_0.00": 0.5, "at_0.10_from_010": 0.5},
        "at_0.05_from_100": {"at_0.00": 0.5, "at_0.10_from_100": 0.5},
        "at_0.05_from_350": {"at_0.00": 0.5, "at_0.10_from_350": 0.5},
        "at_0.10_from_000": {"at_0.10_from_350": 0.5, "at_0.10_from_010": 0.5},
    }
    solved = plan_family(wind((0.0, 0.1), (350.0, 10.0, 100.0)), "", "")
    assert [member for member in members if not member.between] == list(solved)
    with pytest.raises(InputError) as error:
        plan_family(wind((0.1,), (0.0, 90.0), between=True), "", "")
    assert (error.value.code, error.value.argument) == ("family.none_between", "between")


@pytest.mark.parametrize(
    ("directions", "symmetric", "images"),
    [
        ((0, 90, 180, 270), "xy", {180: (0, "x"), 270: (90, "y")}),
        ((0, 90, 180, 270), "x", {180: (0, "x")}),
        ((0, 90, 180, 270), "", {}),
        ((30, 150, 210, 330), "xy", {150: (30, "x"), 210: (30, "xy"), 330: (30, "y")}),
        ((30, 150, 210, 330), "y", {330: (30, "y"), 210: (150, "y")}),
        ((0, 45), "xy", {}),
    ],
)
def test_mirror_images_are_not_solved(
    directions: tuple[int, ...], symmetric: str, images: dict[int, tuple[int, str]]
) -> None:
    members = plan_family(wind((0.1,), directions), "", symmetric)
    found = {m.name: (m.image_of, m.across) for m in members if m.image_of}
    name = "at_0.10_from_{:03d}".format
    assert found == {name(d): (name(o), axes) for d, (o, axes) in images.items()}


@pytest.mark.parametrize(
    ("speeds", "directions", "code"),
    [
        ((0.0, 0.1), (), "family.no_directions"),
        ((0.0,), (0.0, 90.0), "family.still_air"),
        ((0.1, -0.1), (0.0,), "draught.speed"),
        ((0.1,), (0.0, 360.0), "family.same_direction"),
        (tuple(np.linspace(0.1, 1.0, 500)), (0.0, 90.0), "family.too_many"),
    ],
)
def test_what_is_no_family_is_refused(
    speeds: tuple[float, ...], directions: tuple[float, ...], code: str
) -> None:
    with pytest.raises(InputError) as error:
        plan_family(wind(speeds, directions), "", "")
    assert error.value.code == code


def test_symmetry_needs_the_wall_temperatures_too(cylinder: Part) -> None:
    case = natural_case(cylinder, COARSE)
    assert symmetric_case(case) == "xy"
    assert symmetric_case(evolve(case, wall=WallTemperatures(1e3, {"head +x": 723.15}))) == "y"


@pytest.fixture
def family(cylinder: Part) -> Family:
    """Still air and two speeds from two opposite sides."""
    members = plan_family(wind((0.0, 0.1, 0.2), (90.0, 270.0)), "x", "xy")
    cases = {
        m.name: natural_case(cylinder, COARSE, draught=m.draught, mirrors=m.planes) for m in members
    }
    return members, cases


class Solver:
    """Stands in for OpenFOAM: writes fields, counts them, and dies after some."""

    def __init__(self, dies_after: int = 99) -> None:
        self.solved: list[str] = []
        self.meshes: dict[str, str] = {}
        self.dies_after = dies_after

    def __call__(self, tasks: Sequence[Task]) -> Iterator[dict[str, Any]]:
        for task in tasks:
            if len(self.solved) == self.dies_after:
                raise KeyboardInterrupt
            draught = task.case.draught
            write_field(
                task.folder / task.member.file, "still" if draught is None else draught.text
            )
            self.solved.append(task.member.name)
            if task.like is not None:
                self.meshes[task.member.name] = task.like.name
            yield family_run._entry(task.member, task.case)


def write_field(file: Path, origin: str) -> None:
    """One hexahedron beside the part's centre, with wind along y."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1)]
    points = np.array([*corners, (0, 1, 1)], dtype=np.float32)
    grid = pv.UnstructuredGrid({12: np.arange(8)[None]}, points)
    grid.point_data["T"] = np.arange(8, dtype=np.float32)
    grid.point_data["U"] = np.tile(np.float32((0.1, 0.2, 0.3)), (8, 1))
    state_origin(grid, f"OpenFOAM, {origin}", FieldFacts())
    grid.save(file)


@pytest.fixture
def meshed(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Folders of the cases whose mesh was made."""
    made: list[Path] = []

    def make(case: Case, folder: Path, *_: object) -> int:
        made.append(folder)
        return CELLS

    monkeypatch.setattr(family_run, "make_mesh", make)
    return made


def run(family: Family, folder: Path, solver: Solver) -> tuple[list[str], Remaining]:
    works: list[Remaining] = []
    folder.mkdir(exist_ok=True)
    entries = run_family(*family, folder, NONE, solver, say=lambda text: None, expect=works.append)
    return [entry["name"] for entry in entries], works[0]


def test_family_is_solved_mirrored_and_listed(
    family: Family, meshed: list[Path], tmp_path: Path
) -> None:
    """Of five members three are solved, on one mesh, and the cost is that of three."""
    solver = Solver()
    done, work = run(family, tmp_path / "family", solver)
    assert solver.solved == ["at_0.00", "at_0.10_from_090", "at_0.20_from_090"]
    assert solver.meshes == dict.fromkeys(solver.solved[1:], "at_0.00")
    assert [folder.name for folder in meshed] == ["at_0.00"]
    assert (work.solved, work.mirrored, work.finished) == (3, 2, 0)
    assert work.cost is not None
    assert work.cost.cells == CELLS
    assert work.cost.seconds > 0.0
    assert sorted(done) == names(family[0])
    assert all((tmp_path / "family" / m.file).is_file() for m in family[0])
    listed = json.loads((tmp_path / "family" / FAMILY).read_text())["members"]
    assert [entry["name"] for entry in listed] == names(family[0])
    assert listed[2]["velocity_m_s"] == pytest.approx([0.0, 0.1, 0.0])
    assert listed[2]["image_of"] == "at_0.10_from_090"


def test_interrupted_family_goes_on(family: Family, meshed: list[Path], tmp_path: Path) -> None:
    """Finished members are kept, a field that its solver left unlisted is not one of them."""
    with pytest.raises(KeyboardInterrupt):
        run(family, tmp_path, Solver(dies_after=1))
    write_field(tmp_path / "at_0.10_from_090.vtu", "half done")
    record = tmp_path / "cases/at_0.20_from_090" / RECORD
    record.rename(record.with_name(UNFINISHED))
    again = Solver()
    _, work = run(family, tmp_path, again)
    assert again.solved == ["at_0.10_from_090", "at_0.20_from_090"]
    assert (work.solved, work.mirrored, work.finished) == (2, 2, 1)
    third = Solver()
    done, work = run(family, tmp_path, third)
    assert done == []
    assert work.cost is None
    assert third.solved == []
    later = {name: evolve(c, times=evolve(c.times, end=9.0)) for name, c in family[1].items()}
    assert len(run((family[0], later), tmp_path, third)[0]) == 5, "a later end is not finished"


def test_members_between_are_made_from_the_others(
    family: Family, meshed: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After all that is solved and mirrored, once; then also solved, if they are asked for."""
    members, cases = family
    middle = FamilyMember(
        "at_0.15_from_090",
        cases["at_0.10_from_090"].draught,
        "",
        between=(
            ("at_0.10_from_090", 0.5),
            ("at_0.20_from_090", 0.5),
        ),
    )
    case = cases["at_0.10_from_090"]
    made: list[tuple[list[str], list[float]]] = []

    def write(path: Path, fields: list[str], shares: list[float]) -> None:
        made.append((fields, shares))
        path.touch()

    monkeypatch.setattr(family_run, "read_field", lambda file, air: file.stem)
    monkeypatch.setattr(family_run, "write_field_between", write)
    wider = ((*members, middle), {**cases, middle.name: case})
    done, work = run(wider, tmp_path, Solver())
    assert (done[-1], work.between) == (middle.name, 1)
    assert made == [(["at_0.10_from_090", "at_0.20_from_090"], [0.5, 0.5])]
    assert run(wider, tmp_path, Solver())[0] == []
    solver = Solver()
    run(((*members, evolve(middle, between=())), wider[1]), tmp_path, solver)
    assert solver.solved == [middle.name]


def test_mirror_image_is_the_mirrored_field(family: Family, tmp_path: Path) -> None:
    """Points, velocity and cells across y = -3 mm, the part's centre; the origin says so."""
    members, cases = family
    image = next(m for m in members if m.image_of)
    wind = cases[image.image_of].draught
    assert wind is not None
    write_field(tmp_path / f"{image.image_of}.vtu", wind.text)
    write_image(image, cases[image.name], tmp_path)
    grid: Any = pv.read(tmp_path / image.file)
    original: Any = pv.read(tmp_path / f"{image.image_of}.vtu")
    assert np.asarray(grid.points)[:, 1] == pytest.approx(-6.0 - original.points[:, 1])
    assert np.asarray(grid["U"])[0] == pytest.approx((0.1, -0.2, 0.3))
    assert np.asarray(grid["T"]).tolist() == np.asarray(original["T"]).tolist()
    assert grid.compute_cell_sizes()["Volume"] == pytest.approx([1.0])
    assert "from 270 deg, mirror image of at_0.10_from_090.vtu" in origin_of(grid)
    assert grid.points.dtype == np.float32
    facts = facts_of(grid)
    assert facts is not None
    assert facts.draught_m_s == pytest.approx((0.0, 0.1, 0.0))


def test_folder_of_something_else_is_not_touched(family: Family, tmp_path: Path) -> None:
    (tmp_path / "at_0.00.vtu").write_text("somebody's")
    with pytest.raises(InputError) as error:
        run(family, tmp_path, Solver())
    assert error.value.code == "output.replaces"
    assert (tmp_path / "at_0.00.vtu").read_text() == "somebody's"
