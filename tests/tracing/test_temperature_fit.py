"""Weights of members from thermocouples in the air, and from marks on the part."""

from pathlib import Path

import attrs
import numpy as np
import pytest

import iriftrace
from iriftrace.cli import main
from iriftrace.cli.fit import _print_fit
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin
from iriftrace.core.mesh.transform import parse_transform
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from validation.inputs.hot_block import AMBIENT, HALF
from validation.inputs.leaning_air import BOARD_CAMERA, hot_block_part, leaning

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Hits of this view"),
]

LEANS = (0.0, 0.2, 0.4, 0.6)
LEAN = 0.3
NOISE = 0.05


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> iriftrace.Scene:
    """The block seen by a camera, in the air of the members."""
    folder = tmp_path_factory.mktemp("fields")
    air = iriftrace.HotAir([leaning(lean, folder) for lean in LEANS], layers=9)
    return iriftrace.Scene(hot_block_part(), air, BOARD_CAMERA, engine="cells")


def plume(points: np.ndarray, lean: float) -> np.ndarray:
    """Temperatures of `leaning`, K, well above the layer around the block."""
    x, y, z = points.T
    height = z - HALF
    radius = 4.0 + 0.05 * height
    shape = height / (height + 4.0) * np.exp(-((x - lean * height) ** 2 + y**2) / (2 * radius**2))
    return AMBIENT + 450.0 * shape * (1.0 - (height / 34.0) ** 2)


PLACES = np.array([(x, y, z) for x in range(-8, 17, 4) for y in (-3, 3) for z in (22.0, 28.0)])


def write(
    path: Path, places: np.ndarray, kelvins: np.ndarray, header: str = "x,y,z,T (K),U"
) -> Path:
    rows = np.column_stack((places, kelvins, np.full(len(places), 20.0)))
    np.savetxt(
        path, rows[:, : header.count(",") + 1], delimiter=",", header=header, comments="", fmt="%g"
    )
    return path


def test_thermocouples_find_the_lean(scene: iriftrace.Scene, tmp_path: Path) -> None:
    """Temperatures by the formula of the plume, not by the grid that interpolates it."""
    noise = np.random.default_rng(1).normal(0.0, 10.0, len(PLACES))
    file = write(tmp_path / "t.csv", PLACES, plume(PLACES, LEAN) + noise)
    fit = iriftrace.fit_temperatures(scene, iriftrace.read_air_temperatures(file))
    assert fit.contained
    assert fit.unit == "K"
    assert fit.noise == pytest.approx(10.0)
    assert fit.weights.weights @ LEANS == pytest.approx(LEAN, abs=0.03)
    far = write(tmp_path / "far.csv", PLACES, plume(PLACES, -0.4))
    outside = iriftrace.fit_temperatures(scene, iriftrace.read_air_temperatures(far))
    assert outside.verdict.startswith("Air outside the members: the residual")
    assert "temperatures rise higher" in outside.verdict


def test_table_of_temperatures(tmp_path: Path) -> None:
    """Units of the header; without U the tolerance of IEC 60584-1, 0.75 % of 600 degC is 4.5 K."""
    file = tmp_path / "t.csv"
    file.write_text("x [m];y [m];z [m];T (degC)\n0,01;0;0,02;600\n0;0;0,03;100\n")
    read = iriftrace.read_air_temperatures(file)
    np.testing.assert_allclose(read.places, [[10.0, 0, 20.0], [0, 0, 30.0]])
    np.testing.assert_allclose(read.kelvins, [873.15, 373.15])
    np.testing.assert_allclose(read.deviations, np.array((4.5, 2.5)) / np.sqrt(3.0))
    for text, words in (
        ("x,y,z\n1,2,3\n", "no column T"),
        ("x,y,z,T\n", "no row of numbers"),
        ("x,y,z,T (K)\n1,2,3\n", "rows of 3 columns, which no line above them names"),
        ("x,y,z,T (K),U\n1,2,3,400,0\n", "uncertainties U of 0 K"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=words):
            iriftrace.read_air_temperatures(file)


def test_thermocouples_that_cannot_be_fitted(scene: iriftrace.Scene, tmp_path: Path) -> None:
    def refused(words: str, places: np.ndarray, air: iriftrace.Scene = scene) -> None:
        file = write(tmp_path / "t.csv", places, np.full(len(places), 400.0))
        with pytest.raises(InputError, match=words):
            iriftrace.fit_temperatures(air, iriftrace.read_air_temperatures(file))

    refused("fewer than the 4 members", PLACES[:3])
    refused("inside the part", np.vstack((PLACES, (0.0, 0.0, 0.0))))
    refused("in the plume", PLACES + np.array((0.0, 500.0, 0.0)))
    state = scene.air.states[0].field
    refused("has one field", PLACES, attrs.evolve(scene, air=iriftrace.HotAir(state)))


@pytest.mark.slow
def test_command(
    scene: iriftrace.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The scene of the part gets the same weights from its files as in memory.

    The part stays what it is, though a support blocks the view.
    """
    support = hot_block_part().transformed(parse_transform("translate 0 0 -60"))
    supported = attrs.evolve(scene, blockers=(support,))
    xml = supported.save(tmp_path / "part" / "scene.xml", scale=0.1).path
    file = write(tmp_path / "t.csv", PLACES, plume(PLACES, LEAN))
    words = ["fit", str(xml), str(file), "-o", str(tmp_path / "fitted" / "scene.xml")]
    assert main(words) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "28 of 28 temperatures were used" in printed
    assert "degrees of freedom" not in printed
    assert "first blocker" not in printed
    written = load_scene(tmp_path / "fitted" / "scene.xml")
    np.testing.assert_allclose(written.part.bounds, scene.part.bounds, atol=1e-5)
    assert written.compiled.stated.part.source == "block"
    in_memory = iriftrace.fit_temperatures(scene, iriftrace.read_air_temperatures(file))
    assert written.weights.weights == pytest.approx(in_memory.weights.weights, abs=1e-6)
    _print_fit(attrs.evolve(in_memory, residual=1.01 * in_memory.single.min()))
    assert "by its degrees of freedom, so it can exceed" in capsys.readouterr().out
    assert main([*words, "--noise", "0.1"]) == 2
    assert "--noise is about shifts" in " ".join(capsys.readouterr().err.split())


def test_marks_on_the_part_find_the_lean(scene: iriftrace.Scene, tmp_path: Path) -> None:
    """Marks on the block's face that the camera sees, the air blown away and not."""
    camera = BOARD_CAMERA.at(iriftrace.look_at((40.0, -30.0, 110.0), (0.0, 0.0, HALF)))
    along = np.linspace(-0.9 * HALF, 0.9 * HALF, 30)
    top = np.array([(x, y, HALF) for x in along for y in along])
    truth = attrs.evolve(scene, camera=camera, air=iriftrace.HotAir(leaning(LEAN, tmp_path)))
    cold = camera.project(top)
    hot = cold.copy()
    for _ in range(6):
        hot += cold - camera.project(trace_rays(truth, *camera.rays(hot)).refracted)
    shifts = hot - cold + np.random.default_rng(2).normal(0.0, NOISE, cold.shape)
    marks = iriftrace.MeasuredShift(cold, shifts, None, FileOrigin("marks", ""))
    fit = iriftrace.fit_members(attrs.evolve(scene, camera=camera), marks)
    assert fit.contained
    assert fit.weights.weights @ LEANS == pytest.approx(LEAN, abs=0.05)
