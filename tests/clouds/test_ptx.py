"""PTX files of laser scanners: the pose that they state, and directions without a point."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.clouds.read import read_cloud
from iriftrace.core.errors import InputError, IriftraceWarning

TURNED = """3
2
1 2 3
0 1 0
-1 0 0
0 0 1
0 1 0 0
-1 0 0 0
0 0 1 0
1 2 3 1
"""
"""Scanner at (1, 2, 3) m, its x along the y of the points."""

ROWS = """0.1 0 0 0.5
0 0 0 0.5
0 0.2 0 0.25
0 0 0.3 0
0.1 0.2 0.3 1
-0.1 0 0 0.5
"""


@pytest.mark.filterwarnings("ignore:All coordinates in .* are rounded")
def test_the_pose_is_applied_in_metres(tmp_path: Path) -> None:
    file = tmp_path / "a.ptx"
    file.write_text(TURNED + ROWS)
    with pytest.warns(IriftraceWarning, match="1 of 6 points in a.ptx are not finite.*left out"):
        cloud = read_cloud(file)
    placed = [(1, 2.1, 3), (0.8, 2, 3), (1, 2, 3.3), (0.8, 2.1, 3.3), (1, 1.9, 3)]
    np.testing.assert_allclose(cloud.points, 1000 * np.array(placed))
    assert cloud.columns["intensity"].tolist() == [0.5, 0.5, 0.25, 0.0, 1.0, 0.5]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (2 * (TURNED + ROWS), "holds several scans.*each scan as a file"),
        (TURNED + ROWS[:-15], "states 6 points and holds 5"),
        (TURNED.replace("0 1 0 0", "0 1.1 0 0") + ROWS, "The matrix of .* is not a rigid motion"),
        (ROWS, "does not begin as a PTX file"),
        ("", "does not begin as a PTX file"),
    ],
)
def test_other_files(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "a.ptx"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        read_cloud(file)
