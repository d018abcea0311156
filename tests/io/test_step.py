"""Parts in STEP files: a block with a bore, whose wall is two faces of one cylinder."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io import step
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart
from iriftrace.part.part import Part
from validation.inputs.step_files import RADIUS_MM, SIDES_MM, bored_block

BORE = "hole 1 (x 0, y 0, r 7.5)"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "block.step"
    path.write_text(bored_block())
    return path


def bore_corners(part: Part) -> np.ndarray:
    """Corners (n, 3, 3), mm, of the bore's triangles."""
    return part.vertices[part.faces[part.region_of_face == part.region_names.index(BORE)]]


def test_faces_are_regions_with_their_kinds(file: Path) -> None:
    """Six planes and one hole; the mesh is closed and has the volume of the solid."""
    part = read_part(file)
    planes = {f"plane {sign}{axis}" for sign in "+-" for axis in "xyz"}
    assert set(part.region_names) == {*planes, BORE}
    assert part.closed
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), SIDES_MM, rtol=1e-6)
    width, depth, height = SIDES_MM
    corners = part.vertices[part.faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    # The wall's triangles are up to 2 um inside a circle of 47 mm, 20 mm high.
    expected = height * (width * depth - np.pi * RADIUS_MM**2)
    assert expected < volume < expected + 2.0 * np.pi * RADIUS_MM * height * 0.002


@pytest.mark.parametrize("chord_mm", [0.002, 0.05])
def test_triangles_are_within_the_chord_error(file: Path, chord_mm: float) -> None:
    """Corners lie on the bore, middles of edges inside it by at most that, and not much less."""
    corners = bore_corners(read_part(file, ReadPart(chord_error=chord_mm)))
    middles = 0.5 * (corners + np.roll(corners, 1, axis=1))
    np.testing.assert_allclose(np.hypot(*corners.T[:2]), RADIUS_MM, rtol=1e-6)
    inside = RADIUS_MM - np.hypot(*middles.T[:2]).min()
    assert 0.2 * chord_mm < inside <= chord_mm


def test_the_unit_is_that_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / 'Kern\'s "heißer" blöck.STP'
    path.write_text(bored_block("m"))
    part = read_part(path)
    np.testing.assert_allclose(np.ptp(part.bounds, axis=0), SIDES_MM, rtol=1e-6)
    assert part.length_unit == "mm"
    with pytest.warns(match="declares its unit as mm but is read as inch"):
        read_part(path, ReadPart(length_unit="inch"))


def test_small_faces_are_regions_too(file: Path) -> None:
    """The same mesh as an STL has a region for what is less than a hundredth of the area."""
    text = file.read_text().replace(f",{RADIUS_MM:.9f})", ",0.200000000)")
    file.write_text(text.replace(f"{RADIUS_MM:.9f},0.000000000", "0.200000000,0.000000000"))
    assert "hole 1 (x 0, y 0, r 0.2)" in read_part(file).region_names


def test_commands_read_it(file: Path, tmp_path: Path) -> None:
    """The written mesh keeps the regions."""
    fine = tmp_path / "fine.ply"
    words = ["part", "subdivide", str(file), "-o", str(fine), "--edge=10 mm"]
    assert main([*words, "--chord-error=0.02 mm"]) == 0
    assert BORE in read_part(fine).region_names


def test_what_cannot_be_meshed_is_refused(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for error in (0.0, -1.0):
        with pytest.raises(InputError, match="chord error") as refused:
            read_part(file, ReadPart(chord_error=error))
        assert refused.value.code == "part.chord_error"
    damaged = tmp_path / "damaged.stp"
    damaged.write_text(file.read_text()[:4000])
    with pytest.raises(InputError, match="cannot be read") as refused:
        read_part(damaged)
    assert refused.value.code == "file.damaged"
    monkeypatch.setattr(step, "find_spec", lambda name: None)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as refused:
        read_part("block.step")
    said = str(refused.value)
    assert refused.value.code == "file.no_library"
    for words in ("iriftrace[cad]", "chord error of 0.002 mm", "gmsh -2", "FreeCAD's console"):
        assert words in said
    assert len(said) < 400
