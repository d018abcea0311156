"""Several states of the air on the command line: time series, spans of times, several files."""

import json
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from failing import Failing, Run

from iriftrace.cli import main
from iriftrace.image.aov_image import Status
from iriftrace.io.exr import read_exr
from iriftrace.medium.air.refractivity import Air
from iriftrace.tracing.ensemble import read_members
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from validation.inputs import hot_block

pytestmark = pytest.mark.usefixtures("variant")


def write_series(file: Path, states: Mapping[float, str]) -> None:
    """A collection of files by their times."""
    sets = [f'<DataSet timestep="{time}" file="{name}"/>' for time, name in states.items()]
    file.write_text(
        f'<VTKFile type="Collection"><Collection>{"".join(sets)}</Collection></VTKFile>'
    )


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder with a series of three fields, a scene of it, and a rendering."""
    folder = tmp_path_factory.mktemp("series")
    grid = hot_block.air(12)
    refractivity = np.asarray(Air().refractivity(np.asarray(grid.point_data["T"])))
    ambient = Air().ambient_refractivity
    for number, share in enumerate((0.0, 0.05, 0.10)):
        state = pv.UnstructuredGrid()
        state.copy_structure(grid)
        state.point_data["refractivity"] = ambient + (1 + share) * (refractivity - ambient)
        state.save(folder / f"air_{number}.vtu")
    write_series(folder / "air.pvd", {0.5 * k: f"air_{k}.vtu" for k in range(3)})
    hot_block.block().export(folder / "block.stl")
    words = ["scene", str(folder / "air.pvd"), str(folder / "block.stl"), "--layers=3"]
    scene = folder / "scene" / "scene.xml"
    assert main([*words, "-o", str(scene), *hot_block.CAMERA]) == 0
    assert main(["render", str(scene), "-o", str(folder / "all.exr")]) == 0
    return folder


def words(series: Path, field: str = "air.pvd", output: str = "scene.xml") -> list[str | Path]:
    """The command that makes a scene of a field of the series."""
    of_scene = ["scene", series / field, series / "block.stl", "--layers=2", "-o", output]
    return [*of_scene, *hot_block.CAMERA]


def test_time_series_becomes_an_ensemble(series: Path) -> None:
    """Displacements are 0, 5 and 10 % larger: mean 1.05 of the first, scatter 0.05 of it."""
    scene = series / "scene" / "scene.xml"
    assert [m.time for m in read_members(scene)] == [0.0, 0.5, 1.0]
    image = read_exr(series / "all.exr")
    first = render_scene(load_scene(scene, {"member": 1})).image
    good = (image.status == Status.GOOD) & (first.channels["displacement.norm"] > 1e-5)
    alone = first.channels["displacement.norm"][good].astype(float)
    assert good.sum() > 1000
    # Contours of scaled numbers differ in the last digit, which moves a few vertices.
    ratio = image.channels["displacement.norm"][good] / alone
    assert np.median(ratio) == pytest.approx(1.05, rel=1e-3)
    ratio = image.channels["displacement.std.norm"][good] / alone
    assert np.median(ratio) == pytest.approx(0.05, rel=1e-2)
    assert (series / "all_scatter.png").is_file()
    metrics = json.loads((series / "all.json").read_text())
    assert metrics["ensemble"]["members"] == 3


def test_continuous_engine_takes_the_members_fields(series: Path) -> None:
    scene = load_scene(series / "scene" / "scene.xml", {"scale": 0.3}, engine="cells")
    image = render_scene(scene).image
    good = (image.status == Status.GOOD) & (image.channels["displacement.norm"] > 1e-5)
    scatter, mean = (image.channels[f"displacement.{n}"][good] for n in ("std.norm", "norm"))
    assert np.median(scatter / mean) == pytest.approx(0.05 / 1.05, rel=1e-2)


@pytest.mark.parametrize("time", ["0.5", "0.4:0.6"])
def test_one_time_makes_an_ordinary_scene(series: Path, time: str, run: Run) -> None:
    run(*words(series), f"--time={time}")
    assert not load_scene("scene.xml").members


def test_a_span_of_times_makes_an_ensemble_of_these(series: Path, run: Run, fails: Failing) -> None:
    run(*words(series), "--time=0.4:1")
    assert [m.time for m in read_members(Path("scene.xml"))] == [0.5, 1.0]
    error = fails(*words(series), "--time=2:3")
    assert re.search(r"air\.pvd .* 2 to 3; .*t = 0; t = 0\.5; t = 1 \(--time\)", error)
    assert error.code == "field.no_state"


def test_states_that_nobody_chose_are_averaged_with_a_word(series: Path, run: Run) -> None:
    said = "All 3 states are averaged as an ensemble, t = 0 to t = 1; choose one with --time latest"
    run(*words(series), warns=said)
    # A further field counts by itself, and may be a variation.
    said = "All 3 states are averaged as an ensemble, air.pvd, t = 0 to air.pvd, t = 1; choose"
    run(*words(series), f"--member={series / 'air_1.vtu'}", warns=said)
    run(*words(series), "--time=all")


def test_an_initial_state_without_hot_air_names_the_choice_of_a_time(
    tmp_path: Path, run: Run, fails: Failing
) -> None:
    """Time-dependent solutions begin with all air at ambient."""
    field, _ = hot_block.save(tmp_path)
    still = hot_block.air()
    still.point_data["T"][:] = hot_block.AMBIENT
    still.save(tmp_path / "still.vtu")
    write_series(tmp_path / "air.pvd", {0: "still.vtu", 1: field.name})
    error = fails(*words(tmp_path))
    assert re.search("member t = 0 .*--time", error)
    assert error.code == "shells.no_hot_air"
    run(*words(tmp_path), "--time=latest")


def test_several_files_become_an_ensemble(series: Path, run: Run, fails: Failing) -> None:
    first, second, other_way = (
        f"--member={series / name}" for name in ("air_1.vtu", "air_2.vtu", "scene/../air_0.vtu")
    )
    run(*words(series, "air_0.vtu"), first, second)
    labels = [m.label for m in read_members(Path("scene.xml"))]
    assert labels == ["air_0.vtu", "air_1.vtu", "air_2.vtu"]
    for name, twice in (("air_1.vtu", (first, first)), ("air_0.vtu", (other_way,))):
        refusal = fails(*words(series, "air_0.vtu"), *twice)
        assert name in refusal
        assert refusal.code == "file.twice"


def test_members_elsewhere_or_without_hot_air_are_refused(tmp_path: Path, fails: Failing) -> None:
    """The message names the member."""
    grid = hot_block.air(4)
    grid.save(tmp_path / "air.vtu")
    grid.translate((500.0, 0.0, 0.0), inplace=False).save(tmp_path / "far.vtu")
    grid.point_data["T"] = np.full(grid.n_points, hot_block.AMBIENT)
    grid.save(tmp_path / "cold.vtu")
    hot_block.block().export(tmp_path / "block.stl")
    command = words(Path(), "air.vtu", "out/scene.xml")
    for name, code in (("far", "field.not_at_part"), ("cold", "shells.no_hot_air")):
        error = fails(*command, f"--member={name}.vtu")
        assert f"{name}.vtu" in error
        assert error.code == code
    for span in ("a:b", "2:1", "1:"):
        error = fails(*command, f"--time={span}")
        assert f"'{span}'" in error
        assert "--time" in error
        assert error.code == "field.time_span"
