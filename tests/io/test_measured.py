"""Wall temperatures from a file: units, projection, warnings; nothing is solved."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from iriftrace.cli import main
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import FileOrigin
from iriftrace.core.mesh.triangles import polydata
from iriftrace.flow.simulate.case import Case, natural_case, symmetric_case
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.io.measured import read_measured_wall
from iriftrace.io.part_files import save_part
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import MeasuredWall, measured_wall, wall_temperature
from validation.inputs.parts import papers_cylinder

COARSE = SimulationOptions(resolution="coarse")


@pytest.fixture(scope="module")
def cylinder() -> Part:
    return papers_cylinder()


def ramp(points: np.ndarray) -> np.ndarray:
    """1000 K in the middle of the cylinder, 2 K more for each mm of x."""
    return 1000.0 + 2.0 * (points[:, 0] - 5.0)


def table(part: Part, file: Path, header: str, scale: float = 1.0, zero: float = 0.0) -> Path:
    """Temperatures at the centres of the part's faces."""
    points = part.face_centres
    rows = np.column_stack((points * scale, ramp(points) - zero))
    np.savetxt(file, rows, delimiter=",", header=header, comments="")
    return file


@pytest.mark.parametrize(
    ("header", "scale", "zero", "units"),
    [
        ("x,y,z,T", 1.0, 0.0, (None, "K")),
        ("x_mm,y_mm,z_mm,T_degC", 1.0, 273.15, (None, None)),
        ("# of a thermogram\nx (m),y (m),z (m),T (K)", 1e-3, 0.0, (None, None)),
        ("x [mm],y [mm],z [mm],T [K]", 1.0, 0.0, (None, None)),
        ("X (m), Y (m), Z (m), T (degC)", 1e-3, 273.15, (None, None)),
        ("x,y,z,Temperature", 1e-3, 273.15, ("m", "degC")),
    ],
)
def test_units_are_those_of_header_or_option(
    cylinder: Part,
    tmp_path: Path,
    header: str,
    scale: float,
    zero: float,
    units: tuple[str | None, str | None],
) -> None:
    found = read_measured_wall(table(cylinder, tmp_path / "t.csv", header, scale, zero), *units)
    assert found.points == pytest.approx(cylinder.face_centres, abs=1e-6)
    assert found.kelvins == pytest.approx(ramp(cylinder.face_centres))


def test_the_unit_in_the_name_of_a_surfaces_array_is_stated(cylinder: Part, tmp_path: Path) -> None:
    """And warned of nowhere (warnings are errors here)."""
    surface = polydata(cylinder.vertices, cylinder.faces)
    surface.point_data["T [degC]"] = np.full(len(cylinder.vertices), 900.0)
    surface.save(tmp_path / "wall.vtp")
    assert read_measured_wall(tmp_path / "wall.vtp").kelvins == pytest.approx(1173.15)


def test_table_without_header_and_with_more_columns(cylinder: Part, tmp_path: Path) -> None:
    file = tmp_path / "t.csv"
    np.savetxt(file, np.column_stack((cylinder.face_centres, ramp(cylinder.face_centres))))
    with pytest.raises(InputError, match="which no line above them names"):
        read_measured_wall(file, None, "K")
    rows = "1;0;0;0;900;0.8;a\n2;1;0;0;910;0.8;b\n"
    file.write_text("id;x;y;z;T (K);emissivity;note\n" + rows, "utf-8-sig")
    assert read_measured_wall(file).kelvins.tolist() == [900.0, 910.0]


def test_points_give_the_nearest_and_triangles_what_lies_between(cylinder: Part) -> None:
    """A ramp along x is reproduced by triangles, and by points to half of their distance."""
    places = cylinder.face_centres + 1e-3 * cylinder.face_normals
    corners = np.asarray(cylinder.vertices)
    between = MeasuredWall(FileOrigin("", ""), corners, ramp(corners), np.asarray(cylinder.faces))
    assert between.at(places) == pytest.approx(ramp(places), abs=0.01)
    nearest = MeasuredWall(FileOrigin("", ""), corners, ramp(corners))
    expected = [ramp(corners)[np.linalg.norm(corners - p, axis=1).argmin()] for p in places]
    assert nearest.at(places) == pytest.approx(expected)


@pytest.mark.parametrize("suffix", ["vtp", "vtk", "vtu"])
def test_surface_of_a_finite_element_solution(cylinder: Part, tmp_path: Path, suffix: str) -> None:
    """Of faces, means around a corner lie between theirs; each spans less than its edges."""
    faces: Any = cylinder.faces
    mesh: Any = pv.PolyData.from_regular_faces(cylinder.vertices, faces)
    mesh = mesh.cast_to_unstructured_grid() if suffix == "vtu" else mesh
    mesh.point_data["T [K]"] = ramp(np.asarray(mesh.points))
    mesh.save(tmp_path / f"t.{suffix}")
    found = read_measured_wall(tmp_path / f"t.{suffix}")
    assert found.faces is not None
    places = cylinder.face_centres
    assert found.at(places) == pytest.approx(ramp(places), abs=0.01)
    mesh.clear_data()
    mesh.cell_data["T [K]"] = ramp(places)
    mesh.save(tmp_path / f"t.{suffix}")
    along_x = np.ptp(np.asarray(cylinder.vertices)[cylinder.faces][:, :, 0], axis=1).max()
    off = read_measured_wall(tmp_path / f"t.{suffix}").kelvins - ramp(cylinder.vertices)
    assert np.abs(off).max() < 2.0 * along_x


def test_case_has_the_temperatures_of_the_file(cylinder: Part, tmp_path: Path) -> None:
    """The hottest sets the time, the ramp spoils the symmetry along x, a mirror is refused."""
    wall = measured_wall(read_measured_wall(table(cylinder, tmp_path / "t.csv", "x,y,z,T [K]")))
    case = natural_case(cylinder, COARSE, wall=wall, mirrors="y")
    assert isinstance(case, Case)
    assert case.wall.hottest == pytest.approx(ramp(cylinder.face_centres).max())
    assert wall_temperature(wall, cylinder, cylinder.face_centres) == pytest.approx(
        ramp(cylinder.face_centres)
    )
    assert symmetric_case(case) == "y"
    assert case.record()["wall_from"]["sha256"] == wall.measured.origin.sha256  # type: ignore[union-attr]
    with pytest.raises(InputError, match="not symmetric about x"):
        natural_case(cylinder, COARSE, wall=wall, mirrors="x")


def test_faces_far_from_any_point_are_named(cylinder: Part) -> None:
    points = cylinder.face_centres
    lateral = points[np.abs(points[:, 0] - 5.0) < 80.0]
    everywhere, sides, away = (
        MeasuredWall(FileOrigin("t.csv", ""), some, ramp(some))
        for some in (points, lateral, points + 1e4)
    )
    assert everywhere.far_faces(cylinder, 1.0) == ""
    # Those of the two heads, far from the lateral points.
    assert "7% of the part's surface is far from any temperature" in sides.far_faces(cylinder, 1.0)
    with pytest.raises(InputError, match="not those of its wall"):
        away.far_faces(cylinder, 1.0)


@pytest.mark.parametrize(
    ("content", "units", "message"),
    [
        ("x,y,z\n0,0,0\n1,1,1\n", (None, None), "no array named as temperature"),
        ("x,y,T\n0,0,900\n", (None, None), "columns x, y, T, of which not one each"),
        ("x,y,z,T\n", (None, None), "no row of numbers"),
        ("x,y,z,T\n0,0,0,nan\n", (None, None), "not a finite number"),
        ("x,y,z,T\n1,1,1,900\n0,0,zero,900\n", (None, None), "line 3: 'zero' is not a number"),
        ("x [m],y [m],z [m],T [K]\n0,0,0,900\n", ("mm", None), "coordinates in m, but"),
        ("x [m],y [mm],z [m],T [K]\n0,0,0,900\n", (None, None), "states m and mm for one"),
        ("x,y,z,T [K]\n0,0,0,900\n", (None, "degC"), "states that 'T' is in K"),
        ("x,y,z,T [bar]\n0,0,0,900\n", (None, None), "not a unit of temperature"),
        ("x,y,z,T (K) @ t=0,T (K) @ t=1\n0,0,0,900,950\n", (None, None), "several columns T, as"),
        ("x,y,z,T [K]\n0,0,0,900\n1,0,0,990\n0,0,0,950\n", (None, None), "different values at"),
    ],
)
def test_tables_that_cannot_be_read(
    tmp_path: Path, content: str, units: tuple[str | None, str | None], message: str
) -> None:
    file = tmp_path / "t.csv"
    file.write_text(content)
    with pytest.raises(InputError, match=message):
        read_measured_wall(file, *units)


def test_command_line(
    cylinder: Part,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    save_part(cylinder, "part.ply")
    table(cylinder, Path("t.csv"), "x,y,z,T [K]")
    words = ["field", "simulate", "part.ply", "-o", "case", "--write-only"]
    assert main([*words, "--wall-temperature-from=t.csv"]) == 0
    assert "wall from t.csv: " in " ".join(capsys.readouterr().out.split())
    for options, message in (
        ([], "the part has no temperature"),
        (["--wall-temperature-from=t.csv", "--wall-temperature=900 K"], "besides a file"),
        (["--wall-temperature=900 K", "--wall-length-unit=m"], "which is not given"),
        (["--wall-temperature=900 K", "--wall-above=400 degC"], "which is not given"),
        (["--wall-temperature-from=t.csv", "--wall-above=400"], "400 K or 400 degC"),
        (["--wall-temperature-from=t.csv", "--wall-above=1500 K"], "no wall above 1500 K"),
        (["--wall-temperature-from=part.ply"], "part.ply is not a file of wall temp"),
        (["--wall-temperature-from=none.csv"], "none.csv"),
        (["--wall-temperature-from=t.csv", "--ambient=1500 K"], "ambient"),
    ):
        assert main([*words, *options]) == 2
        assert message.lower() in " ".join(capsys.readouterr().err.split()).lower()


def test_a_unit_of_temperature_that_is_not_stated_is_warned_of(
    cylinder: Part, tmp_path: Path
) -> None:
    file = table(cylinder, tmp_path / "t.csv", "x,y,z,T")
    with pytest.warns(IriftraceWarning, match=r"read in K: \d+ to \d+ degC; state it"):
        assert read_measured_wall(file).kelvins == pytest.approx(ramp(cylinder.face_centres))


def test_points_that_a_thermogram_does_not_have_are_left_out(tmp_path: Path) -> None:
    file = tmp_path / "t.csv"
    file.write_text("x;y;z;T [°C]\n0;0;0;900,5\n1;0;0;\n2;0;0;NaN\n3;0;0;910\n", "cp1252")
    with pytest.warns(IriftraceWarning, match="no temperature at 2 of 4 points"):
        found = read_measured_wall(file)
    assert found.kelvins.tolist() == [1173.65, 1183.15]
    assert found.points[:, 0].tolist() == [0.0, 3.0]


def with_background(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a part at 900 degC, of which the end at +x shows a room of 22 degC."""
    points = np.asarray(part.vertices)
    return points, np.where(points[:, 0] > 60.0, 22.0, 900.0)


def test_a_thermograms_background_is_warned_of_and_left_out(cylinder: Part, tmp_path: Path) -> None:
    """As cool as a tenth of the way from the room to the hottest; a warm end is none."""
    points, celsius = with_background(cylinder)
    cool, count = np.count_nonzero(celsius < 30.0), len(points)
    file = tmp_path / "t.csv"
    header = {"header": "x,y,z,T [degC]", "delimiter": ",", "comments": ""}
    np.savetxt(file, np.column_stack((points, celsius)), **header)
    said = rf"{cool:,} of {count:,} points \({cool / count:.0%}\) at 22 to 108 degC next to 900"
    with pytest.warns(IriftraceWarning, match=said):
        found = read_measured_wall(file)
    ends = points[np.asarray(points[:, 0] > 80.0)]
    assert found.at(ends) == pytest.approx(295.15)
    cut = read_measured_wall(file, above_k=673.15)
    assert cut.at(ends) == pytest.approx(1173.15)
    assert len(cut.kelvins) == count - cool
    assert cut.record()["above_k"] == 673.15
    assert "above_k" not in found.record()
    with pytest.raises(InputError, match=r"no wall above 1273\.15 K, .* end at 1173\.15 K"):
        read_measured_wall(file, above_k=1273.15)
    np.savetxt(file, np.column_stack((points, np.maximum(celsius, 109.0))), **header)
    assert read_measured_wall(file).kelvins.min() == pytest.approx(382.15)


def test_triangles_of_the_background_are_left_out(cylinder: Part, tmp_path: Path) -> None:
    """Also those that are partly of it, between whose corners the temperature would fall."""
    points, celsius = with_background(cylinder)
    surface = polydata(points, cylinder.faces)
    surface.point_data["T [degC]"] = celsius
    surface.save(tmp_path / "wall.vtp")
    cut = read_measured_wall(tmp_path / "wall.vtp", above_k=673.15)
    assert cut.faces is not None
    assert len(cut.faces) < len(cylinder.faces)
    assert cut.at(points) == pytest.approx(1173.15)
