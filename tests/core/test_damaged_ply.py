"""PLY files whose header states what is not there."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from iriftrace.io.part_files import read_part
from iriftrace.io.ply import read_ply, write_ply

CORNERS = np.array(((0.0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10)))
FACES = np.array(((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)))


@pytest.mark.parametrize("element", [b"vertex", b"face"])
def test_more_than_the_file_has(tmp_path: Path, element: bytes) -> None:
    write_ply(tmp_path / "a.ply", CORNERS, FACES)
    content = (tmp_path / "a.ply").read_bytes()
    huge = content.replace(b"element " + element + b" 4", b"element " + element + b" 20000000000")
    (tmp_path / "a.ply").write_bytes(huge)
    with pytest.raises(ValueError, match="its header states at least"):
        read_ply(tmp_path / "a.ply")


def test_corners_that_do_not_exist(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", CORNERS[:3], FACES)
    with pytest.raises(ValueError, match="names vertex 3, but there are 3"):
        read_ply(tmp_path / "a.ply")


def test_a_part_beyond_the_horizon(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", np.where(CORNERS == 10.0, 1e30, CORNERS), FACES)
    with pytest.warns(match="unlikely"), pytest.raises(InputError, match="farther than any part"):
        read_part(tmp_path / "a.ply")
