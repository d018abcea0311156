"""Child processes: what they hand over, how they end, and that they run nothing of the folder."""

import io
import json
import os
import pickle
import signal
import subprocess
import sys
from pathlib import Path

import h5netcdf
import numpy as np
import pytest
import pyvista as pv

from iriftrace.core import isolated
from iriftrace.core.isolated import ChildError, read_in_child
from iriftrace.io.netcdf import check_netcdf
from iriftrace.io.vtk_check import read_file

COMMAND = [sys.executable, "-P", "-m", "iriftrace.core.isolated"]


def test_values_and_arrays_come_back_as_they_were() -> None:
    rows = read_in_child("numpy:eye", 0, 2, 3)
    np.testing.assert_array_equal(rows, np.eye(2, 3))
    assert rows.dtype == np.float64
    assert read_in_child("numpy:zeros", 0, [0, 3], "i4").shape == (0, 3)
    # Not contiguous, and two in a list.
    parts = read_in_child("numpy:unravel_index", 0, [22, 41], [7, 6])
    np.testing.assert_array_equal(parts, np.unravel_index([22, 41], (7, 6)))
    np.testing.assert_array_equal(read_in_child("numpy:transpose", 0, [[1, 2]]), [[1], [2]])
    values = {"a": [None, "b", 1.5, True], "\N{GREEK SMALL LETTER MU}": {}}
    assert read_in_child("copy:copy", 0, values) == values


@pytest.mark.parametrize(
    ("function", "argument", "reason"),
    [
        ("json:loads", "{", "Expecting property name"),
        ("builtins:bytearray", 1 << 40, "more memory than it may take"),
        ("numpy:ones", [1 << 27], "more memory than it may take"),  # 1 GB
        ("math:factorial", 10**8, "still busy with it after 1 s"),
        ("os:_exit", 0, "broke down, exit status 0"),
        ("signal:raise_signal", signal.SIGABRT, "broke down, SIGABRT"),
    ],
)
def test_each_end_has_its_reason(
    function: str, argument: object, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(isolated, "_SECONDS", 1)
    monkeypatch.setattr(isolated, "_MEMORY", 1 << 27)
    monkeypatch.setattr(isolated, "_POLL", 0.005)
    with pytest.raises(ChildError, match=reason):
        read_in_child(function, 0, argument)
    assert read_in_child("builtins:abs", 0, -1) == 1


def _sent(function: str, *arguments: object) -> bytes:
    """What a process writes for one request, behind the line that says it is ready."""
    request = json.dumps([function, arguments, 5, "."]).encode() + b"\n"
    ended = subprocess.run(COMMAND, input=request, stdout=subprocess.PIPE, check=True)
    ready, end, answer = ended.stdout.partition(b"\n")
    assert (ready, end) == (b"", b"\n")
    return answer


def test_an_answer_that_is_cut_short_is_none() -> None:
    """As from a process that a library ends while it writes."""
    whole = _sent("numpy:unravel_index", [22, 41], [7, 6])
    value, error = isolated._received(io.BytesIO(whole)) or ((), "none")
    np.testing.assert_array_equal(value, np.unravel_index([22, 41], (7, 6)))
    assert not error
    for length in range(len(whole)):
        assert isolated._received(io.BytesIO(whole[:length])) is None


@pytest.mark.parametrize(
    "answer",
    [
        b"\xff\xfe\n",
        b"{}\n",
        b"[1]\n",
        b'[{"\\u0000": ["<f8", [-1]]}, ""]\n',
        b'[{"\\u0000": ["x8", [1]]}, ""]\n12345678',
        b'[{"\\u0000": 1}, ""]\n',
        # Numbers must not become addresses of objects.
        b'[{"\\u0000": ["|O", [1]]}, ""]\n12345678',
        b"[" * 100_000 + b"\n",
        pickle.dumps(([1], "")),
    ],
)
def test_a_damaged_answer_is_none(answer: bytes) -> None:
    assert isolated._received(io.BytesIO(answer)) is None


def test_an_answer_that_states_too_much_is_refused() -> None:
    with pytest.raises(ChildError, match="more memory than it may take"):
        isolated._received(io.BytesIO(b'[{"\\u0000": ["<f8", [1000000000000000]]}, ""]\n'))


def test_a_fork_starts_a_process_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two that read from one pipe would get each other's answers."""
    of_parent = read_in_child("os:getpid", 0)
    monkeypatch.setattr(os, "getpid", lambda: -1)
    assert read_in_child("os:getpid", 0) != of_parent
    isolated._stop()
    monkeypatch.undo()
    assert read_in_child("os:getpid", 0) == of_parent


def test_relative_paths_are_of_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after it has changed, as in a notebook."""
    read_in_child("os:getcwd", 0)
    monkeypatch.chdir(tmp_path)
    assert read_in_child("os:getcwd", 0) == str(tmp_path)


def test_a_killed_process_is_started_again() -> None:
    read_in_child("builtins:abs", 0, -1)
    process = isolated._children[os.getpid()]
    process.kill()
    process.wait()
    assert read_in_child("builtins:abs", 0, -2) == 2


def test_a_process_that_an_earlier_file_has_damaged_is_replaced() -> None:
    """Its death is not said of the file that it reads then."""
    read_in_child("faulthandler:dump_traceback_later", 0, 0.2, False, 2, True)  # and ends it
    assert read_in_child("time:sleep", 0, 0.5) is None


def test_a_process_whose_parent_was_killed_ends() -> None:
    """Even in a library that never returns to Python."""
    with subprocess.Popen(
        COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdin is not None
        process.stdin.write(b'["math:factorial", [100000000], 0.1, "."]\n')
        process.stdin.flush()
        assert process.wait(60) == 1


def test_modules_of_the_working_folder_are_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a package of our name nor one that we import."""
    marker = tmp_path / "ran"
    for name in ("iriftrace", "numpy", "vtkmodules", "h5netcdf"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"open({str(marker)!r}, 'w')\n1 / 0\n")
    with h5netcdf.File(tmp_path / "good.nc", "w") as file:
        file.dimensions = {"x": 1}
        file.create_variable("v", ("x",), data=[1.0])
    pv.Sphere().save(tmp_path / "good.vtp")
    monkeypatch.chdir(tmp_path)
    isolated._stop()
    check_netcdf(tmp_path / "good.nc")
    assert read_file(tmp_path / "good.vtp").n_points > 0
    assert not marker.exists()
