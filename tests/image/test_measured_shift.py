"""Measured shifts as maps and as markers."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.measured_shift import read_measured_shift

FIELD = np.arange(24, dtype=np.float32).reshape(3, 4, 2) / 7
FIELD[1, 2] = np.nan
MEASURED = np.isfinite(FIELD).all(axis=2)


def exr(path: Path, **channels: np.ndarray) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: np.ascontiguousarray(values) for name, values in channels.items()}
    OpenEXR.File(header, planes).write(str(path))
    return path


def check_map(path: Path) -> None:
    """Pixel (row, column) has its centre at (column, row); NaN was not measured."""
    found = read_measured_shift(path)
    assert found.resolution == (4, 3)
    row, column = np.nonzero(MEASURED)
    np.testing.assert_array_equal(found.places, np.stack((column, row), axis=1))
    np.testing.assert_array_equal(found.shifts, FIELD[MEASURED])


@pytest.mark.parametrize("names", [("X", "Y"), ("du", "dv"), ("flow.U", "flow.V"), ("R", "G")])
def test_two_channel_exr(tmp_path: Path, names: tuple[str, str]) -> None:
    across, down = names
    check_map(exr(tmp_path / "map.exr", **{across: FIELD[..., 0], down: FIELD[..., 1]}))


def test_a_part_of_a_picture_is_refused(tmp_path: Path) -> None:
    """The places of its pixels would be counted from the part's corner."""
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "dataWindow": (np.array((5, 2), np.int32), np.array((8, 4), np.int32)),
        "displayWindow": (np.array((0, 0), np.int32), np.array((9, 9), np.int32)),
    }
    planes = {"X": FIELD[..., 0].copy(), "Y": FIELD[..., 1].copy()}
    OpenEXR.File(header, planes).write(str(tmp_path / "map.exr"))
    with pytest.raises(InputError, match=r"data window \[\[5, 2\], \[8, 4\]\] .* without a crop"):
        read_measured_shift(tmp_path / "map.exr")


def test_aov_image_serves_as_a_map(tmp_path: Path) -> None:
    """Its good pixels: another rendering can be compared with."""
    status = np.where(MEASURED, 0, 1).astype(np.float32)
    filled = np.nan_to_num(FIELD)
    check_map(
        exr(
            tmp_path / "map.exr",
            **{
                "shift.px.X": filled[..., 0],
                "shift.px.Y": filled[..., 1],
                "status.code": status,
                "path.length": status,
            },
        )
    )


def test_numpy_arrays_in_both_orders(tmp_path: Path) -> None:
    for field in (FIELD, np.moveaxis(FIELD, 2, 0)):
        np.save(tmp_path / "map.npy", field)
        check_map(tmp_path / "map.npy")


@pytest.mark.parametrize(
    "text",
    [
        "u,v,du,dv\n10,20,0.5,-0.25\n0,1.5,0,1e-3\n",
        "# markers\nname; DV ;U;V;dU\na;-0,25;10;20;0,5\nb;1e-3;0;1,5;0\n",
        "u v du dv\n10 20 0.5 -0.25\n0 1.5 0 1e-3\n5 5 nan nan\n",
        "du,dv,u,v\n0.5,-0.25,10,20\n\n0,1e-3,0,1.5\n,,9,9\n",
        "u [px],v [px],du [px],dv [px]\n10,20,0.5,-0.25\n0,1.5,0,1e-3\n",
        "u (px),v (px),du (px),dv (px)\n10,20,0.5,-0.25\n0,1.5,0,1e-3\n",
        '"u [px]";"v [px]";"du [px]";"dv [px]"\n"10";"20";"0,5";"-0,25"\n"0";"1,5";"0";"1e-3"\n',
    ],
)
def test_markers(tmp_path: Path, text: str) -> None:
    """(0, 0) is the centre of the first pixel."""
    (tmp_path / "markers.csv").write_text(text)
    found = read_measured_shift(tmp_path / "markers.csv")
    assert found.resolution is None
    np.testing.assert_allclose(found.places, ((10, 20), (0, 1.5)))
    np.testing.assert_allclose(found.shifts, ((0.5, -0.25), (0.0, 1e-3)))


@pytest.mark.parametrize(
    ("column", "good", "bad"),
    [
        ("valid", "1", "0"),
        ("Valid", "True", "False"),
        ("flags", "0", "1"),
        ("Flags", "0.0", "2"),
        ("sigma", "0.004", "-1"),
        ("sigma", "0", "-1.0"),
    ],
)
def test_marked_markers_were_not_measured(tmp_path: Path, column: str, good: str, bad: str) -> None:
    """Whatever stands in their shift, also words."""
    rows = [f"10,20,0.5,-0.25,{good}", f"11,20,99,99,{bad}", f"12,20,-,-,{bad}"]
    (tmp_path / "m.csv").write_text("\n".join((f"u,v,du,dv,{column}", *rows)))
    found = read_measured_shift(tmp_path / "m.csv")
    np.testing.assert_allclose(found.places, [(10, 20)])
    np.testing.assert_allclose(found.shifts, [(0.5, -0.25)])
    assert (found.failed, found.zeros) == (2, 0)


def test_other_marks_are_refused_or_no_marks(tmp_path: Path) -> None:
    file = tmp_path / "m.csv"
    file.write_text("u,v,du,dv,valid\n1,2,3,4,perhaps\n")
    with pytest.raises(InputError, match=r"line 2: 'perhaps' is not a number"):
        read_measured_shift(file)
    file.write_text("u,v,du,dv,valid\n1,2,3,4,0\n")
    with pytest.raises(InputError, match=r"no measured shift.* 1 rows are marked"):
        read_measured_shift(file)
    file.write_text("u,v,du,dv,quality\n1,2,3,4,0\n")
    assert len(read_measured_shift(file).shifts) == 1


def test_many_exact_zeros_are_told_and_can_be_left_out(tmp_path: Path) -> None:
    """Of 100 shifts 2 are no reason, 3 are; one component of 0 is none."""
    field = np.ones((10, 10, 2))
    field[0, :2], field[1, :, 0] = 0.0, 0.0
    np.save(tmp_path / "m.npy", field)
    assert read_measured_shift(tmp_path / "m.npy").doubt == ""
    field[0, 2] = 0.0
    np.save(tmp_path / "m.npy", field)
    with pytest.warns(IriftraceWarning, match="3 of 100 shifts .* without_zeros=True"):
        found = read_measured_shift(tmp_path / "m.npy")
    assert (len(found.shifts), found.zeros) == (100, 0)
    assert read_measured_shift(tmp_path / "m.npy", without_zeros=False).doubt != ""
    found = read_measured_shift(tmp_path / "m.npy", without_zeros=True)
    assert (len(found.shifts), found.zeros) == (97, 3)
    np.save(tmp_path / "m.npy", np.zeros((10, 10, 2)))
    with pytest.raises(InputError, match="All 100 shifts"):
        read_measured_shift(tmp_path / "m.npy", without_zeros=True)


def test_zeros_of_a_rendering_are_no_doubt(tmp_path: Path) -> None:
    """Where there is no hot air nothing is shifted."""
    none = np.zeros((4, 4), dtype=np.float32)
    planes = {"shift.px.X": none, "shift.px.Y": none, "status.code": none}
    assert read_measured_shift(exr(tmp_path / "map.exr", **planes)).doubt == ""


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "x,y\n1,2\n", "has the columns x, y, so it is not read"),
        ("a.csv", "", "no row of numbers"),
        ("a.csv", "u,v,du,dv\n", "no row of numbers"),
        ("a.csv", "u,v,du,dv\n1,2,,\n", "has no measured shift"),
        ("a.csv", "u,v,du,dv\n1,2,3\n", "has rows of 3 columns"),
        ("a.csv", "u,v,du,dv\n1,2,3,4\n1,2,3,far\n", "line 3: 'far' is not a number"),
        ("a.exr", "no picture", "not an OpenEXR file"),
        ("a.npy", "no array", "give a NumPy array"),
        ("a.tif", "", "is not a file of measured shifts"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_measured_shift(tmp_path / name)


def test_wrong_maps_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="There is no file"):
        read_measured_shift(tmp_path / "gone.csv")
    np.save(tmp_path / "a.npy", np.zeros((4, 3)))
    with pytest.raises(InputError, match=r"an array of the shape \(4, 3\)"):
        read_measured_shift(tmp_path / "a.npy")
    np.save(tmp_path / "a.npy", np.full((4, 3, 2), np.nan))
    with pytest.raises(InputError, match="has no measured shift"):
        read_measured_shift(tmp_path / "a.npy")
    three = {name: FIELD[..., 0] for name in "RGB"}
    with pytest.raises(InputError, match="has the channels B, G, R, so it is not read"):
        read_measured_shift(exr(tmp_path / "a.exr", **three))
    whole = exr(tmp_path / "b.exr", X=FIELD[..., 0], Y=FIELD[..., 1]).read_bytes()
    (tmp_path / "b.exr").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"cannot be read .*; write the map again"):
        read_measured_shift(tmp_path / "b.exr")
