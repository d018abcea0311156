"""The files of tests/data: each has a line on its source, and is read as it was made."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.io.clouds import read_cloud
from iriftrace.io.field import read_field
from iriftrace.io.reading import ReadField

DATA = Path(__file__).parents[1] / "data"

POINTS = np.array(
    [
        (-82.272833, 0.546886, 13.470262),
        (-36.820493, 0.540732, 13.470415),
        (8.749396, 0.615312, 13.466495),
        (59.274033, -9.646149, -9.416692),
        (77.789518, -9.611120, -9.451615),
    ]
)
RED = (200, 10, 0, 7, 120)


def test_each_file_has_a_line_on_source_and_licence() -> None:
    folders = [folder for folder in DATA.iterdir() if folder.is_dir()]
    assert len(folders) >= 9
    for folder in folders:
        text = (folder / "README.md").read_text(encoding="utf-8")
        assert "licence" in text or "BSD-3-Clause" in text
        for file in folder.iterdir():
            assert file.name == "README.md" or f"`{file.name}`" in text


@pytest.mark.parametrize(
    ("name", "origin", "options"),
    [
        *(
            (f"comsol/{name}", "COMSOL 6.2.0.415, model part.mph", {})
            for name in ("spreadsheet.txt", "spreadsheet.csv", "sectionwise.txt", "grid.txt")
        ),
        ("comsol/german.csv", "COMSOL 6.2.0.415, model teil.mph", {}),
        ("cfd_post/volume.csv", "", {}),
        ("star_ccm/table.csv", "", {}),
        ("fluent/ascii.txt", "", {"length_unit": "m", "temperature_unit": "K"}),
    ],
)
def test_fields(name: str, origin: str, options: dict[str, str]) -> None:
    """T = 300 K + (x + 2 y + 3 z) K/mm in a box of 10 mm; only COMSOL is called so."""
    with pytest.warns(UserWarning, match="coolest air"):
        field = read_field(DATA / name, ReadField(**options))
    x, y, z = np.asarray(field.grid.points).T
    assert_allclose(field.temperature_k, 300.0 + x + 2.0 * y + 3.0 * z, rtol=1e-12)
    assert field.grid.volume == pytest.approx(1000.0)
    assert field.source.origin == origin


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("xyz/plain.xyz", ()),
        ("xyz/cloudcompare.asc", ("R", "G", "B", "Nx", "Ny", "Nz")),
        ("xyz/paraview.csv", ("intensity",)),
        ("xyz/spreadsheet.csv", ("Point ID",)),
        ("pts/leica.pts", ("column_4", "column_5", "column_6", "column_7")),
        ("ply/points.ply", ("red", "green", "blue")),
        ("pcd/ascii.pcd", ("intensity",)),
        ("pcd/binary.pcd", ("intensity",)),
        ("e57/scan.e57", ("intensity",)),
    ],
)
def test_clouds(name: str, columns: tuple[str, ...]) -> None:
    cloud = read_cloud(DATA / name)
    # E57's library writes single precision, in m.
    assert_allclose(cloud.points, POINTS, rtol=0.0, atol=8e-6 if name.endswith("e57") else 1e-12)
    assert tuple(cloud.columns) == columns
    for red in cloud.columns.keys() & {"R", "red", "column_5"}:
        np.testing.assert_array_equal(cloud.columns[red], RED)
