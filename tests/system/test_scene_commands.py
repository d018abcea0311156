"""The commands shells and scene as a user runs them: tables, files and what is printed."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from failing import Run, metrics_of

import iriftrace
from iriftrace.cli import main
from iriftrace.core.arrays import FloatArray
from iriftrace.io.shells import load_shells
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock

AIR = iriftrace.Air()


def table_of(folder: str | Path) -> dict[str, Any]:
    table: dict[str, Any] = json.loads((Path(folder) / "shells.json").read_text())
    return table


def column(table: dict[str, Any], key: str) -> np.ndarray:
    return np.array([row[key] for row in table["shells"]])


def default_levels(hottest: float, layers: int) -> FloatArray:
    """Each shell midway in equal steps from ambient air, and one at a tenth of the outermost."""
    e = np.linspace(AIR.ambient_refractivity, hottest, layers)
    return np.concatenate(([0.9 * e[0] + 0.1 * e[1]], (e[1:] + e[:-1]) / 2))


def test_shells_with_a_part(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    printed = run("shells", hot.field, "-o", "shells", "--part", hot.part)
    # A path stands on one line, however long.
    assert max(len(line) for line in printed.splitlines() if str(hot.part) not in line) <= 80
    flat = " ".join(printed.split())
    assert "13 shells" in printed
    assert "within 0.000 mm of the part, 100.0% of the part within 0.2 mm of the wall; wall" in flat
    assert "field read in mm" in flat
    names = {path.name for path in (tmp_path / "shells").iterdir()}
    assert names == {
        *(f"shell_{k:02d}.ply" for k in range(1, 14)),
        *("shells", "shells.vtm", "shells.json"),
    }
    assert pv.read(tmp_path / "shells" / "shells.vtm").n_blocks == 13
    table = table_of("shells")
    assert column(table, "closed").all()
    # T falls linearly with the distance to the block. The distance is convex, so that between the
    # grid's points it is overestimated and each shell lies nearer: most in the middle of three
    # points that lie one cell of 2 mm beside the block's corner, by 1 - 1 / sqrt(3) of a cell.
    share = (column(table, "temperature_k") - hot_block.AMBIENT) / (
        hot_block.WALL - hot_block.AMBIENT
    )
    nearer = 9.0 * (1.0 - share) - column(table, "gap_part_mm")
    # The outermost lies in the cell in which T stops falling, which moves it outwards instead.
    assert nearer[1:].min() > 0.0
    assert nearer[0] > -1.0
    assert nearer.max() < 2.0 * (1.0 - 3.0**-0.5)
    assert not column(table, "part_cut_share").any()


def test_levels_of_shells(run: Run, hot: HotBlock) -> None:
    # A false step at the edge of the data is worth a warning, and the work continues.
    room = r"coolest air .* \(--ambient\)"
    run("shells", hot.field, "-o", "one", "--layers=1", "--ambient=30 degC", warns=room)
    run("shells", hot.field, "-o", "own", "--levels=1e-4,2.5e-4,2e-4")
    own = table_of("own")
    np.testing.assert_allclose(column(own, "refractivity"), (2.5e-4, 2e-4, 1e-4))
    assert own["rule"] == "custom"


def test_index_range_in_both_units(run: Run, hot: HotBlock) -> None:
    """Studies over several fields use the same levels, given as temperatures or as n - 1."""
    hottest = float(AIR.refractivity(1000.0 + 273.15))
    ambient = AIR.ambient_refractivity
    ranges = ("20 degC:1000 degC", f"{ambient!r}:{hottest!r}", f"{ambient!r}:1000 degC")
    for folder, ends in zip("abc", ranges, strict=True):
        run("shells", hot.field, "-o", folder, "--layers=3", f"--index-range={ends}")
        levels = column(table_of(folder), "refractivity")
        np.testing.assert_allclose(levels, default_levels(hottest, 3), rtol=1e-12)


def test_isosurfaces_of_its_own_come_back(run: Run, hot: HotBlock) -> None:
    """What ParaView shows can be read again: same surfaces, and the same layers between them."""
    run("shells", hot.field, "-o", "made", "--layers=4")
    surfaces = ("made/shells.vtm", "--isosurfaces", "--array=refractivity")
    run("shells", *surfaces, "-o", "read", "--part", hot.part)
    made, read = table_of("made"), table_of("read")
    assert read["rule"] == "imported"
    for key in ("refractivity", "ext", "area_mm2", "temperature_k"):
        np.testing.assert_allclose(column(read, key), column(made, key), rtol=1e-6)
    assert (column(read, "triangles") == column(made, "triangles")).all()
    moved = ("--field-transform=translate 0 0 100", "--min-size=1 um")
    run("shells", *surfaces, "-o", "moved", *moved)
    outermost = load_shells("moved").shells[0]
    np.testing.assert_allclose(outermost.vertices.mean(axis=0) - (0, 0, 100), 0.0, atol=1e-3)
    assert load_shells("made").shells[0].derivatives is not None
    assert outermost.derivatives is None


def test_units_and_axes_of_field_and_part(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    """The same block, drawn in other units and axes, gives the same shells and fits as well."""
    field, part = hot_block.air(), hot_block.block()
    field.points = np.asarray(field.points)[:, [0, 2, 1]] * (1e-3, -1e-3, 1e-3)
    field.point_data["T"] -= 273.15
    field.save(tmp_path / "metres.vtu")
    part.apply_scale(1 / 25.4)
    part.apply_translation((0.0, 0.0, 5.0))
    part.export(tmp_path / "inches.stl")
    printed = run(
        *("shells", "metres.vtu", "-o", "other", "--layers=3", "--temperature-unit=degC"),
        *("--field-length-unit=m", "--field-transform=rotate x 90"),
        *("--part=inches.stl", "--length-unit=inch", "--part-transform=translate 0 0 -127"),
    )
    assert "field read in m" in " ".join(printed.split())
    assert "95 % of the wall is within 0.000 mm of the part" in " ".join(printed.split())
    run("shells", hot.field, "-o", "usual", "--layers=3", "--part", hot.part)
    for key in ("refractivity", "area_mm2", "gap_part_mm"):
        usual, other = column(table_of("usual"), key), column(table_of("other"), key)
        np.testing.assert_allclose(other, usual, rtol=2e-3)


def test_other_quantities(run: Run, hot: HotBlock, tmp_path: Path) -> None:
    field = hot_block.air()
    field.point_data["ior"] = AIR.refractivity(np.asarray(field.point_data.pop("T"))) + 1.0
    field.save(tmp_path / "index.vtu")
    run("shells", "index.vtu", "-o", "index", "--layers=2", "--quantity=index", "--array=ior")
    run("shells", hot.field, "-o", "plain", "--layers=2")
    index, plain = table_of("index"), table_of("plain")
    np.testing.assert_allclose(column(index, "area_mm2"), column(plain, "area_mm2"), rtol=1e-4)


def test_the_camera_of_isosurfaces_stands_outside_them(run: Run, hot: HotBlock) -> None:
    """Without a field, the shells themselves tell where the air is hot."""
    surfaces = hot.scene.parent / "shells" / "shells.vtm"
    options = ("--isosurfaces", "--array=refractivity", "--focus=0:inf", "--resolution=60,50")
    options += ("--scale=1",)
    run("scene", surfaces, hot.part, "-o", "made/scene.xml", *options)
    run("render", "made/scene.xml", "--no-figures")
    metrics = metrics_of("made/scene.json")
    outermost = np.abs(load_shells("made/shells").shells[0].vertices).max()
    assert np.abs(metrics["pose"]["origin_mm"]).max() > outermost
    assert metrics["camera"]["focus_mm"] == [0.0, None]
    assert main(["scene", str(surfaces), str(hot.part), "-o", "in.xml", *options,
                 "--origin=9,0,0", "--target=0,0,0"]) == 2  # fmt: skip


def test_the_given_camera_comes_back(run: Run, hot: HotBlock) -> None:
    run(
        *("scene", hot.field, hot.part, "-o", "made/scene.xml", "--layers=2"),
        *("--origin=60,-45,70", "--target=1,2,3", "--up=0,1,0", "--focal-length=2 cm"),
        *("--sensor=6,5 mm", "--resolution=120,80", "--principal-point=61.5,38", "--scale=0.5"),
        *("--normals=facet", "--focus=50:250"),
    )
    run("render", "made/scene.xml", "-D", "scale=1", "--no-figures")
    metrics = metrics_of("made/scene.json")
    camera = metrics["camera"]
    assert camera["focal_length_mm"] == 20.0
    assert camera["sensor_mm"] == [6.0, 5.0]
    assert camera["resolution"] == [120, 80]
    assert camera["principal_point_px"] == [61.5, 38.0]
    assert camera["focus_mm"] == [50.0, 250.0]
    assert metrics["assumptions"]["normals"] == "facet"
    matrix = np.array(metrics["pose"]["matrix"])
    origin, target = np.array((60.0, -45.0, 70.0)), np.array((1.0, 2.0, 3.0))
    np.testing.assert_allclose(matrix[:3, 3], origin, atol=1e-9)
    axis = (target - origin) / np.linalg.norm(target - origin)
    np.testing.assert_allclose(matrix[:3, 2], axis, atol=1e-9)
    assert matrix[1, 1] < 0  # y is down in the picture, and up is +y
    assert abs(matrix[1, 0]) < 1e-9
