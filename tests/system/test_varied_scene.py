"""Scenes with members that vary another one: no command's mean has them, and budgets use them."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import xarray as xr
from attrs import evolve
from failing import NINE_POSES, Failing

from iriftrace.cli import main
from iriftrace.core.files import sha256_of
from iriftrace.figures.describe_scan import describe
from iriftrace.io.exr import read_exr
from iriftrace.measuring.uncertainty.air_groups import AirGroups
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.origin import state_origin
from iriftrace.medium.source import FieldFacts, FieldKind, Variation
from iriftrace.tracing.ensemble import read_members
from iriftrace.tracing.load import load_scene
from validation.inputs import hot_block

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of this view"),
]

WALL = Variation("wall", 10.0, "")
PRESSURE = Variation("pressure", 200.0, "")
SECOND = ["--second=75,-20,70", "--system=stereo"]


def write(file: Path, share: float, kelvin: float, variation: Variation | None) -> None:
    """Air around the block that is hotter by a share of its excess, and by some K at the wall."""
    grid = hot_block.air(12)
    excess = np.asarray(grid.point_data["T"]) - hot_block.AMBIENT
    more = share + kelvin / (hot_block.WALL - hot_block.AMBIENT)
    grid.point_data["T"] = hot_block.AMBIENT + (1.0 + more) * excess
    state_origin(grid, "a formula", FieldFacts(FieldKind.STEADY, variation=variation))
    grid.save(file)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's fields: two states of the air, and two that vary the first one."""
    folder = tmp_path_factory.mktemp("varied")
    write(folder / "field.vtu", 0.0, 0.0, None)
    write(folder / "other.vtu", 0.05, 0.0, None)
    of = sha256_of(folder / "field.vtu")
    write(folder / "field_wall.vtu", 0.0, 10.0, evolve(WALL, of=of))
    # The same temperatures: twice the pressure's effect on the index alone would be 0.4 %.
    write(folder / "field_pressure.vtu", 0.0, 0.0, evolve(PRESSURE, of=of))
    hot_block.block().export(folder / "block.stl")
    return folder


def words(folder: Path, output: Path, *members: str) -> list[str]:
    more = [word for name in members for word in ("--member", str(folder / f"{name}.vtu"))]
    return [
        *("scene", str(folder / "field.vtu"), str(folder / "block.stl"), "-o", str(output)),
        *(*more, "--layers=3", *SECOND, *hot_block.CAMERA),
    ]


@pytest.fixture(scope="module")
def scenes(folder: Path) -> tuple[Path, Path]:
    """Scenes of both states, with those that vary and without them."""
    with_all, plain = folder / "all" / "scene.xml", folder / "plain" / "scene.xml"
    assert main(words(folder, with_all, "field_wall", "other", "field_pressure")) == 0
    assert main(words(folder, plain, "other")) == 0
    return with_all, plain


def test_the_table_says_what_members_vary(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And a wall that is 10 K hotter there is what was expected."""
    hot = ["--expansion=1e-12/K", f"--hot-temperature={hot_block.WALL} K"]
    assert main([*words(folder, tmp_path / "scene.xml", "field_wall"), *hot]) == 0
    said = capsys.readouterr()
    assert "varies wall by 10 K" in " ".join(said.out.split())
    assert "instead of the expected" not in said.err


def test_a_scene_keeps_what_its_members_vary(scenes: tuple[Path, Path]) -> None:
    members = read_members(scenes[0])
    assert [one.weight for one in members] == [0.5, 0.0, 0.5, 0.0]
    varied = [None if one.variation is None else one.variation.text for one in members]
    assert varied == [None, "varies wall by 10 K", None, "varies pressure by 2 hPa"]
    loaded = load_scene(scenes[0])
    assert [one.variation for one in loaded.members] == [one.variation for one in members]


def test_pictures_are_those_of_the_states(scenes: tuple[Path, Path], tmp_path: Path) -> None:
    for scene, name in zip(scenes, ("all", "plain"), strict=True):
        assert (
            main(["render", str(scene), "-o", str(tmp_path / f"{name}.exr"), "--no-figures"]) == 0
        )
    one, other = (read_exr(tmp_path / f"{name}.exr") for name in ("all", "plain"))
    for channel in ("displacement.X", "displacement.std.norm", "ensemble.members"):
        np.testing.assert_array_equal(one.channels[channel], other.channels[channel])
    # The second state has another number in each scene.
    worst = other.channels["ensemble.worst"]
    np.testing.assert_array_equal(
        one.channels["ensemble.worst"], np.where(worst == 2.0, 3.0, worst)
    )
    found, plain = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("all", "plain"))
    assert found["ensemble"] | {"worst_member": 2} == plain["ensemble"]
    assert found["ensemble"]["members"] == 2
    assert found["ensemble"]["rays_in_all"] > 1000
    assumption = found["assumptions"]["ensemble"]
    assert assumption.startswith("displacements are means over 2 fields (bias)")
    assert "2 further fields for what inputs change" in assumption
    assert "field_wall" not in found["assumptions"]["field_source"]


def test_a_sweep_is_that_of_the_states(scenes: tuple[Path, Path], tmp_path: Path) -> None:
    for scene, name in zip(scenes, ("all", "plain"), strict=True):
        swept = ["sweep", str(scene), "-o", str(tmp_path / f"{name}.nc"), "-D", "scale=0.2"]
        assert main([*swept, *NINE_POSES]) == 0
    with (
        xr.open_dataset(tmp_path / "all.nc") as one,
        xr.open_dataset(tmp_path / "plain.nc") as other,
    ):
        for name in ("displacement_median", "scatter_p95", "ensemble_members"):
            np.testing.assert_array_equal(one[name], other[name])


def test_a_measurement_is_that_of_the_states(scenes: tuple[Path, Path], tmp_path: Path) -> None:
    """Its points are those seen in both, and its worst member is one of them."""
    for scene, name in zip(scenes, ("all", "plain"), strict=True):
        assert main(["measure", str(scene), "-o", str(tmp_path / f"{name}.vtp")]) == 0
    one, other = (pv.read(tmp_path / f"{name}.vtp") for name in ("all", "plain"))
    for name in ("pixel_u", "pixel_v", "error_normal", "scatter_normal"):
        np.testing.assert_array_equal(one[name], other[name])
    assert set(np.unique(one["worst_member"])) <= {1, 3}
    values = json.loads((tmp_path / "all.json").read_text())
    assert values["worst_member"] in (1, 3)
    assert [row["number"] for row in values["members"]] == [1, 3]
    (said,) = (row.value for row in describe(values) if "means over" in row.value)
    assert said.startswith("These are means over 2 fields;")


def test_a_budget_takes_their_differences(scenes: tuple[Path, Path]) -> None:
    groups = AirGroups.of(load_scene(scenes[0]), Inputs.of("wall 5 K, pressure 1 hPa"))
    found = {name: one.change.tolist() for name, one in groups.varied.items()}
    assert found == {"wall": [-0.5, 0.5, 0.0, 0.0], "pressure": [-0.5, 0.0, 0.0, 0.5]}
    assert groups.weights.sampled == 2


@pytest.mark.parametrize("members", [("field_wall",), ("field_wall", "field_pressure")])
def test_a_variation_needs_what_it_varies(
    folder: Path, fails: Failing, tmp_path: Path, members: tuple[str, ...]
) -> None:
    made = words(folder, tmp_path / "new" / "scene.xml", *members)
    made[1] = str(folder / "other.vtu")
    message = fails(*made)
    assert message.code == "air.varies_nothing"
    assert "varies wall by 10 K of a field that is not in the scene" in message
    assert not (tmp_path / "new").exists()
