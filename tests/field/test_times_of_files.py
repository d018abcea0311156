"""Files of several states, in the formats that VTK alone reads: CGNS and Exodus."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.field.read import read_field
from iriftrace.field.readers.members import member_at, members
from validation.field_files import cgns, exodus
from validation.inputs import hot_block

FORMATS = pytest.mark.parametrize(("kind", "name"), [(cgns, "air.cgns"), (exodus, "air.e")])


@FORMATS
@pytest.mark.filterwarnings("ignore:The coolest air")
def test_a_file_with_several_times(tmp_path: Path, kind: Any, name: str) -> None:
    grid = hot_block.air(6)
    later = [(0.5, np.asarray(grid["T"]) + 10.0), (2.0, np.asarray(grid["T"]) + 20.0)]
    path = kind.write(tmp_path / name, grid, later)
    assert [member.time for member in members(path)] == [0.0, 0.5, 2.0]
    chosen = read_field(path, member=member_at(path, "0.5").index)
    assert chosen.temperature_k.max() == pytest.approx(hot_block.WALL + 10.0)
    with pytest.warns(IriftraceWarning, match=r"3 states; the last one, t = 2\.0, is used"):
        assert read_field(path).temperature_k.min() == pytest.approx(hot_block.AMBIENT + 20.0)


@FORMATS
def test_damaged_files_are_refused(tmp_path: Path, kind: Any, name: str) -> None:
    path = kind.write(tmp_path / name, hot_block.air(6))
    content = path.read_bytes()
    for damaged in (content[: len(content) // 3], b"something else", b""):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"cannot be read|no volume cells"):
            read_field(path)
