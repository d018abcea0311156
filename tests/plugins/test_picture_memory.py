"""Pictures larger than memory are refused before anything is allocated."""

import resource
from pathlib import Path

import pytest

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.core.runtime.variant import CudaState
from iriftrace.plugins import film as picture_memory
from iriftrace.plugins.film import BYTES_PER_PIXEL, check_picture_size, memory_bytes
from iriftrace.scenes import folder_of


def test_memory_of_this_machine_is_known() -> None:
    assert 2**28 < memory_bytes() < 2**50


def test_a_picture_that_just_fits_is_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_memory, "memory_bytes", lambda: BYTES_PER_PIXEL * 200.0 * 100)
    check_picture_size(200, 100, 17)
    with pytest.raises(InputError, match=r"201 x 100 pixels needs at least 3,417,000 bytes"):
        check_picture_size(201, 100, 17)


def test_more_values_than_an_array_holds_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_memory, "memory_bytes", lambda: float("inf"))
    check_picture_size(16_000, 15_000, 17)
    with pytest.raises(InputError, match="one array holds at most 4,294,967,295"):
        check_picture_size(16_000, 16_000, 17)


@pytest.mark.usefixtures("variant")
def test_a_scene_scaled_up_too_far_ends_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """2 million by 2 million pixels; nothing is written and hardly any memory taken."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    scene = folder_of("cylinder") / "scene.xml"
    assert main(["render", str(scene), "-o", str(tmp_path / "out.exr"), "-D", "scale=800"]) == 2
    said = capsys.readouterr().err
    assert "1958400 x 1638400 pixels needs at least 545,4" in said
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**20


def test_on_cuda_the_gpus_memory_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_memory, "current_variant", lambda: "cuda_ad_mono")
    state = CudaState(("a GPU",), "", memory_bytes=12 * 2**30)
    monkeypatch.setattr(picture_memory, "cuda_state", lambda: state)
    assert memory_bytes() == 12 * 2**30
