"""The EXR must give back every bit and every header value, and refuse what would mislead."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import CHANNELS, SCHEMA, AovImage
from iriftrace.io.exr import read_exr, write_exr

HEADER = {
    "schema": SCHEMA,
    "engine": "first_hit",
    "pose": {"origin_mm": [1.5, -2.0, 1e-17], "matrix": np.eye(4).tolist()},
    "field": None,
    "wavelength_nm": 633.0,
    "normals": "gradient",
    "note": "",
    "counts": {"open_boundary": 12},
}


def random_image(seed: int = 1, shape: tuple[int, int] = (7, 11)) -> AovImage:
    rng = np.random.default_rng(seed)
    # Random bits give every exponent; those of NaN and infinity are replaced by 0.
    bits = rng.integers(0, 2**32, size=(len(CHANNELS), *shape), dtype=np.uint32)
    pixels = bits.view(np.float32)
    pixels = np.where(np.isfinite(pixels), pixels, np.float32(0))
    return AovImage(dict(zip(CHANNELS, pixels, strict=True)), dict(HEADER))


def test_pixels_and_header_survive_bit_for_bit(tmp_path: Path) -> None:
    image = random_image()
    write_exr(tmp_path / "a.exr", image)
    back = read_exr(tmp_path / "a.exr")
    assert back.header == image.header
    assert tuple(back.channels) == CHANNELS
    for name in CHANNELS:
        assert back.channels[name].tobytes() == image.channels[name].tobytes()


@settings(max_examples=50, deadline=None)
@given(
    value=st.recursive(
        st.none()
        | st.booleans()
        | st.integers()
        | st.floats(allow_nan=False, allow_infinity=False)
        # OpenEXR keeps strings as UTF-8 without the character 0.
        | st.text(st.characters(codec="utf-8", exclude_characters="\0")),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc"), inner),
        max_leaves=6,
    )
)
def test_header_values_keep_value_and_type(
    value: object, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A string that looks like a number must come back as string, not as number."""
    path = tmp_path_factory.mktemp("exr") / "a.exr"
    image = random_image(shape=(1, 1))
    write_exr(path, AovImage(image.channels, {"schema": SCHEMA, "entry": value}))
    back = read_exr(path).header["entry"]
    assert back == value
    assert type(back) is type(value)


def test_file_is_readable_by_openexr_alone(tmp_path: Path) -> None:
    """Other programs see the channel names, float32, and readable attributes."""
    image = random_image()
    write_exr(tmp_path / "a.exr", image)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        channels, header = file.channels(), dict(file.header())
        assert sorted(channels) == sorted(CHANNELS)
        assert {channel.pixels.dtype for channel in channels.values()} == {np.dtype(np.float32)}
    assert header["iriftrace.engine"] == "first_hit"
    assert json.loads(header["iriftrace.pose"])["origin_mm"] == [1.5, -2.0, 1e-17]


@pytest.mark.parametrize("rgb", ["displacement", "shift", "refracted"])
def test_programs_that_know_colours_find_the_numbers_under_r_g_b(rgb: str, tmp_path: Path) -> None:
    """As OpenEXR finds the colours of any picture; OpenCV too where it was built with OpenEXR."""
    image = random_image()
    write_exr(tmp_path / "a.exr", image, rgb=rgb)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        colours = file.channels()["RGB"].pixels.copy()
        said = file.header()["iriftrace.rgb"]
    names = [f"{rgb}.{axis}" for axis in "XYZ"] if rgb != "shift" else ["shift.px.X", "shift.px.Y"]
    assert said == "R, G, B repeat " + ", ".join(names)
    for place in range(3):
        expected = image.channels[names[place]] if place < len(names) else 0.0 * colours[..., 0]
        np.testing.assert_array_equal(colours[..., place], expected)
    back = read_exr(tmp_path / "a.exr")
    assert back.header == image.header
    assert tuple(back.channels) == CHANNELS
    code = (
        "import os; os.environ['OPENCV_IO_ENABLE_OPENEXR'] = '1'\n"
        "import cv2, numpy, re\n"
        "if not re.search('OpenEXR: *NO', cv2.getBuildInformation()):\n"
        "    numpy.save('cv.npy', cv2.imread('a.exr', cv2.IMREAD_UNCHANGED))"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    if (tmp_path / "cv.npy").is_file():
        np.testing.assert_array_equal(np.load(tmp_path / "cv.npy")[..., ::-1], colours)


def test_colours_of_something_else_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="but not 'depth'"):
        write_exr(tmp_path / "a.exr", random_image(), rgb="depth")
    assert not list(tmp_path.iterdir())


def test_file_does_not_depend_on_the_thread_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = random_image(shape=(300, 40))
    files = []
    for threads in (0, 1, 4):
        monkeypatch.setattr("iriftrace.io.exr.THREADS", threads)
        write_exr(tmp_path / "a.exr", image)
        files.append((tmp_path / "a.exr").read_bytes())
    assert files[0] == files[1] == files[2]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_not_finite_pixels_are_refused_and_nothing_is_left(tmp_path: Path, bad: float) -> None:
    image = random_image()
    image.channels["displacement.norm"][3, 4] = bad
    with pytest.raises(InputError, match=r"displacement\.norm.*1 of its pixels"):
        write_exr(tmp_path / "a.exr", image)
    assert list(tmp_path.iterdir()) == []


def test_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    write_exr(path, random_image())
    before = path.read_bytes()
    unfit = AovImage(random_image().channels, {"schema": SCHEMA, "camera": object()})
    with pytest.raises(InputError, match="camera"):
        write_exr(path, unfit)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_wrong_channel_sets_are_refused() -> None:
    channels = random_image().channels
    with pytest.raises(InputError, match=r"missing: straight\.X"):
        AovImage({name: channels[name] for name in CHANNELS[1:]})
    with pytest.raises(InputError, match="unknown: Y"):
        AovImage({**channels, "Y": channels["straight.X"]})
    with pytest.raises(InputError, match="float64"):
        AovImage({**channels, "straight.X": channels["straight.X"].astype(np.float64)})
    with pytest.raises(InputError, match="empty"):
        AovImage({name: np.zeros((0, 3), np.float32) for name in CHANNELS})


def test_files_that_are_not_ours_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no file"):
        read_exr(tmp_path / "missing.exr")
    (tmp_path / "text.exr").write_text("hello")
    with pytest.raises(InputError, match="not an OpenEXR"):
        read_exr(tmp_path / "text.exr")
    pixels = np.zeros((2, 3), np.float32)
    OpenEXR.File({}, {"Y": pixels}).write(str(tmp_path / "foreign.exr"))
    with pytest.raises(InputError, match="schema None"):
        read_exr(tmp_path / "foreign.exr")
    write_exr(tmp_path / "whole.exr", random_image())
    (tmp_path / "cut.exr").write_bytes((tmp_path / "whole.exr").read_bytes()[:-200])
    with pytest.raises(InputError) as error:
        read_exr(tmp_path / "cut.exr")
    assert error.value.code == "file.damaged"
    with pytest.raises(InputError, match="does not exist"):
        write_exr(tmp_path / "nowhere" / "a.exr", random_image())


def test_vectors_status_and_resolution() -> None:
    channels = {name: np.full((2, 5), index, np.float32) for index, name in enumerate(CHANNELS)}
    channels["status.code"] = np.array([[0, 1, 2, 3, 4], [5, 6, 7, 0, 0]], np.float32)
    image = AovImage(channels)
    assert image.resolution == (5, 2)
    assert image.status.tolist() == [[0, 1, 2, 3, 4], [5, 6, 7, 0, 0]]
    assert image.vector("refracted")[1, 4].tolist() == [3.0, 4.0, 5.0]
    assert image.vector("shift.px")[0, 0].tolist() == [10.0, 11.0]
    with pytest.raises(InputError, match="no vector 'path'"):
        image.vector("path")
