"""Profiles that a person copies in, and those measured in a tall cavity, against computed ones."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError, SetupError
from iriftrace.flow.simulate.programs import Installation
from iriftrace.medium.air.refractivity import Air
from validation.flow import __main__ as page
from validation.flow import betts_bokhari as cavity
from validation.flow.measured import DEFLECTIONS, FOLDER, TEMPERATURES, read_table, table
from validation.oracles.hot_plate import profile

HOT_C, AMBIENT_C, HEIGHT_MM, WIDTH_MM = 60.0, 20.0, 100.0, 300.0
AWAY_MM = np.array((0.5, 1.0, 2.0, 3.0, 4.0, 6.0))
TRUTH = profile(HOT_C + 273.15, HEIGHT_MM, Air(pressure_pa=90_000.0))


def filled(file: Path, *, off: float = 0.0, height_mm: float = HEIGHT_MM) -> None:
    """A table with the solution's values, noise of a standard deviation of U / 2, and an error."""
    noise = np.random.default_rng(3).normal(size=len(AWAY_MM))
    if "temperature_C" in file.read_text():
        plate, values, expanded = "", TRUTH.kelvin(AWAY_MM) - 273.15, 0.4
    else:
        plate, expanded = f"{WIDTH_MM:g},633,", 0.02
        values = np.array([1e3 * TRUTH.bending(start, WIDTH_MM) for start in AWAY_MM])
    values = values * (1.0 + off) + 0.5 * expanded * noise
    with file.open("a") as lines:
        for away, value in zip(AWAY_MM, values, strict=True):
            lines.write(
                f"{height_mm:g},{HOT_C:g},{AMBIENT_C:g},900,{plate}{away:g},{value:.9g},{expanded}\n"
            )


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    return Path(shutil.copytree(FOLDER, tmp_path / "measured"))


def test_the_tables_in_the_repository_are_not_filled() -> None:
    found = table()
    assert len(found.rows) == 4
    assert found.text in page.PAGE.read_text(encoding="utf-8")
    assert all("| not filled |" in row for row in found.rows)
    for file in FOLDER.glob("*.csv"):
        assert "# The numbers are not here because" in file.read_text()
        assert "U_" in file.read_text().splitlines()[-1]


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("name", ["zhang_petit_taine_1989", "hargather_settles_2012"])
def test_true_values_with_noise_are_within_their_uncertainty(tables: Path, name: str) -> None:
    """Noise of U / 2 has a root mean square of about half of U; 6 % of the value is beyond U."""
    filled(tables / f"{name}.csv")
    good = table(tables)
    assert good.beyond == []
    (row,) = (row for row in good.rows if f"{name}:" in row)
    over = [float(word) for word in re.findall(r"\| (\d\.\d\d)(?= )", row)]
    assert len(over) == (2 if "hargather" in name else 1)
    assert 0.2 < over[0] < 0.8
    np.testing.assert_allclose(over, over[0], atol=0.05)


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("name", ["zhang_petit_taine_1989", "hargather_settles_2012"])
def test_wrong_values_are_beyond_their_uncertainty(tables: Path, name: str) -> None:
    filled(tables / f"{name}.csv", off=0.06)
    found = table(tables)
    assert found.beyond
    assert all(line.startswith(f"{name}: 60 °C, height 100 mm") for line in found.beyond)


def test_a_turbulent_layer_has_no_bound(tables: Path) -> None:
    """Gr = g dT / T x^3 / nu^2 = 9.81 x 40 / 313 x 27 / (1.91e-5)^2 = 9e10 at 3 m."""
    filled(tables / "tsuji_nagano_1988.csv", off=0.2, height_mm=3000.0)
    found = table(tables)
    assert found.beyond == []
    assert "(turbulent)" in found.rows[2]
    (measured,) = read_table(tables / "tsuji_nagano_1988.csv")
    assert measured.grashof == pytest.approx(9.81 * 40 / 313 * 27 / 1.91e-5**2, rel=0.02)


@pytest.mark.parametrize(
    ("columns", "row", "said"),
    [
        (TEMPERATURES, "100,60,20,900,1,fifty,0.3", "is not 7 numbers"),
        (TEMPERATURES, "100,60,20,900,1,50", "is not 7 numbers"),
        (TEMPERATURES, "100,60,20,900,1,50,0", "U_K is 0"),
        (DEFLECTIONS, "0,60,20,900,300,633,1,1.4,0.1", "height_mm is 0"),
        (TEMPERATURES[1:], "60,20,900,1,50,0.3", "not those of a measured profile"),
    ],
)
def test_rows_that_are_no_measurement_are_refused(
    tmp_path: Path, columns: tuple[str, ...], row: str, said: str
) -> None:
    file = tmp_path / "some.csv"
    file.write_text(f"# of a paper\n{','.join(columns)}\n{row}\n")
    with pytest.raises(InputError, match=said):
        read_table(file)


def test_a_section_without_the_measured_data_keeps_its_text(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def missing(_: Installation) -> Path:
        raise SetupError(f"the temperatures are missing; {cavity.GET}.", code="test")

    copy = tmp_path / "validation.md"
    copy.write_bytes(page.PAGE.read_bytes())
    monkeypatch.setattr(page, "PAGE", copy)
    monkeypatch.setattr(cavity, "find_openfoam", lambda: None)
    monkeypatch.setattr(cavity, "tutorial", missing)
    monkeypatch.setattr("sys.argv", ["flow", "betts_bokhari", "--simulations", str(tmp_path)])
    assert page.main() == 1
    assert copy.read_bytes() == page.PAGE.read_bytes()
    assert "apt-get install openfoam-examples" in capsys.readouterr().err


def test_the_tutorial_is_found_in_an_unpacked_package(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    case = tmp_path / "heatTransfer" / "buoyantSimpleFoam" / "buoyantCavity"
    case.mkdir(parents=True)
    installation = Installation(str(tmp_path / "none"), "", "", {})
    monkeypatch.setenv("FOAM_TUTORIALS", str(tmp_path))
    assert cavity.tutorial(installation) == case
    monkeypatch.setattr(cavity, "TUTORIAL", "heatTransfer/*/noCavity")
    with pytest.raises(SetupError, match="apt-get"):
        cavity.tutorial(installation)


@pytest.mark.usefixtures("variant")
def test_rays_through_a_straight_profile_are_bent_by_its_line(tmp_path: Path) -> None:
    """Points on a line at either wall: the line's deflection, and the one of Gladstone and Dale."""
    away = np.array((0.3, 0.6, 0.9, 1.2, 1.6, 2.1, 2.6, 3.0, 4.0, 6.0))
    x = np.concatenate((away, cavity.WIDTH_MM - away[::-1]))
    celsius = np.concatenate((15.0 + 1.6 * away, 34.6 - 1.6 * away[::-1]))
    points = np.column_stack((x, celsius))
    air = Air(temperature_k=288.15)
    found = cavity.traced(points, tmp_path / "field.vtu", air)
    lines = cavity.walls(points)
    assert [line.celsius for line in lines] == pytest.approx([15.0, 34.6])
    np.testing.assert_allclose(found, [line.deflection(air) for line in lines], rtol=0.01)
    # n - 1 = 2.718e-4 x 293.15 / T at 101325 Pa and 633 nm; mean temperatures along the rays.
    steep = 2.718e-4 * 293.15 * 1.6 * 520e3 / np.array((290.15, 305.75)) ** 2
    np.testing.assert_allclose(found, steep * (-1.0, 1.0), rtol=0.02)
