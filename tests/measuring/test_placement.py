"""Units and motions that would put a cloud on the part are named."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from iriftrace.core.mesh.transform import apply
from iriftrace.io.part_files import read_part
from iriftrace.measuring.two_devices.placement import remedy
from iriftrace.part.part import Part

MOTION = np.eye(4)
MOTION[:3, :3] = Rotation.from_euler("xyz", (20, -35, 50), degrees=True).as_matrix()
MOTION[:3, 3] = (120.0, -60.0, 300.0)
IN_METRES = MOTION * np.array((1, 1, 1, 1e-3))
IN_METRES[3, 3] = 1.0
BACK = np.linalg.inv(MOTION)
NUDGE = np.eye(4)
NUDGE[:3, 3] = 0.3


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    """A block of which a corner is the origin."""
    mesh = trimesh.creation.box(extents=(100, 60, 40))
    mesh.apply_translation((50, 30, 20))
    path = tmp_path_factory.mktemp("part") / "block.stl"
    mesh.export(path)
    return read_part(path)


@pytest.fixture(scope="module")
def points(part: Part) -> np.ndarray:
    places, _ = part.surface.even_places(2000)
    return np.asarray(places)


CASES = [
    (np.eye(4), "mm", None, ""),
    (BACK, "mm", MOTION, ""),
    (BACK, "mm", BACK, "the inverse of `cloud_to_part`"),
    (BACK, "mm", IN_METRES, "the translation of `cloud_to_part` in m (write it in mm)"),
    (np.eye(4), "mm", MOTION, "no `cloud_to_part`"),
    (np.diag((1e-3, 1e-3, 1e-3, 1)), "mm", None, "`length_unit` m"),
    (np.diag((1e3, 1e3, 1e3, 1)), "m", None, "`length_unit` mm"),
    (np.diag((1 / 25.4, 1 / 25.4, 1 / 25.4, 1)), "mm", None, "`length_unit` inch"),
    (MOTION, "mm", None, ""),
    (np.eye(4), "mm", NUDGE, ""),  # lies on it as given
]


@pytest.mark.parametrize(("moved", "unit", "motion", "said"), CASES)
def test_what_would_put_the_cloud_on_the_part(
    part: Part,
    points: np.ndarray,
    moved: np.ndarray,
    unit: str,
    motion: np.ndarray | None,
    said: str,
) -> None:
    assert remedy(apply(moved, points), unit, motion, part) == said
