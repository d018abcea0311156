"""Distances and angles of planes, and rows by region, of points in known places."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from iriftrace.core.errors import IriftraceWarning
from iriftrace.features.relations import relations, value_key
from iriftrace.features.table import feature_table
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.triangulation.statistics import region_table


def box() -> Part:
    """20 x 30 x 40 mm."""
    import trimesh

    mesh = trimesh.creation.box((20.0, 30.0, 40.0))
    return part_of_mesh(mesh.vertices, mesh.faces, name="box")


def test_widths_and_squareness_of_a_box() -> None:
    """One side moved out by 10 um and another turned by 0.1 degrees, wherever the box stands."""
    part = box()
    points, face = part.surface.even_places(6000)
    names = np.array(part.region_names)[part.region_of_face[face]]
    hot = points.copy()
    hot[names == "plane +x"] += (0.01, 0.0, 0.0)
    turn = Rotation.from_euler("z", 0.1, degrees=True)
    hot[names == "plane +y"] = turn.apply(hot[names == "plane +y"])
    place = Rotation.from_rotvec((0.3, -0.2, 0.5))
    clouds = {"cold": place.apply(points), "measured": place.apply(hot)}
    rows = relations(feature_table(clouds, face, part, ["plane"], gate=None))
    sizes = {"".join(row["regions"]).replace("plane ", ""): row for row in rows}
    assert sum(row["kind"] == "distance" for row in rows) == 3
    assert len(rows) == 15
    width = next(row for name, row in sizes.items() if set(name) == set("+x-x"))["size_mm"]
    assert width["cold"] == pytest.approx(20.0, abs=1e-9)
    assert width["measured"] == pytest.approx(20.01, abs=1e-9)
    angle = next(row for name, row in sizes.items() if set(name) == set("+x+y"))["angle_deg"]
    assert angle["cold"] == pytest.approx(90.0, abs=1e-9)
    assert abs(angle["measured"] - 90.0) == pytest.approx(0.1, abs=1e-9)


def test_uncertainties_are_those_of_repeated_measurements() -> None:
    """Noise of 10 um on two faces of which different ends were seen: 300 draws, to a tenth."""
    part = box()
    points, face = part.surface.even_places(1500)
    names = np.array(part.region_names)[part.region_of_face[face]]
    seen = (names == "plane +x") & (points[:, 2] > 5.0)
    seen |= (names == "plane -x") & (points[:, 2] < -5.0)
    seen |= (names == "plane +y") & (points[:, 0] > 0.0)
    points, face = points[seen], face[seen]
    rng = np.random.default_rng(3)
    drawn: dict[str, list[tuple[float, float]]] = {"size_mm": [], "angle_deg": []}
    for _ in range(300):
        clouds = {"measured": points + 0.01 * rng.normal(size=points.shape)}
        for row in relations(feature_table(clouds, face, part, ["plane"], gate=None)):
            key = value_key(row)
            drawn[key].append((row[key]["measured"], row[f"u_{key}"]["measured"]))
    distance, angle = np.array(drawn["size_mm"]), np.array(drawn["angle_deg"])[::2]
    for values in (distance, angle):
        assert values[:, 1].mean() == pytest.approx(values[:, 0].std(ddof=1), rel=0.1)


def test_rows_by_region_count_points_area_and_values() -> None:
    part = box()
    _, face = part.surface.even_places(600)
    top = part.region_names.index("plane +z")
    one = np.flatnonzero(part.region_of_face == top)[0]
    kept = (part.region_of_face[face] != top) | (face == one)
    values = np.where(part.region_of_face[face] == top, -2e-3, 1e-3)[kept]
    rows = region_table(part, face[kept], values)
    assert [row["region"] for row in rows] == list(part.region_names)
    assert sum(row["points"] for row in rows) == kept.sum()
    assert rows[top]["measured"] == pytest.approx(0.5)
    assert rows[top]["along_normal_mm"]["median"] == -2e-3
    assert rows[top]["size_p95_mm"] == 2e-3
    assert rows[top - 1]["measured"] == pytest.approx(1.0)
    assert region_table(part, face[:0], values[:0])[top]["along_normal_mm"] is None


def test_too_few_points_are_one_clean_sentence() -> None:
    part = box()
    points, face = part.surface.even_places(600)
    top = part.region_of_face[face] == part.region_names.index("plane +z")
    kept = ~top | (np.cumsum(top) == 1) & top
    said = r"plane:plane \+z is left out: 1 point was measured on it, and a plane needs at least 3;"
    with pytest.warns(IriftraceWarning, match=said):
        rows = feature_table(
            {"cold": points[kept]}, face[kept], part, ["plane:plane +z"], gate=None
        )
    assert rows == []
