"""LLVM libraries: found, opened in a process of their own, and judged."""

import sys
from pathlib import Path
from typing import Any

import pytest

from iriftrace.core.errors import SetupError
from iriftrace.core.runtime import llvm
from iriftrace.core.runtime import variant as runtime


def library(major: int) -> dict[str, Any]:
    """What the probe answers for a sound LLVM of that version."""
    return {"version": [major, 0, 0], "missing": [], "error": ""}


@pytest.fixture
def fake_machine(monkeypatch: pytest.MonkeyPatch):
    """A machine with just these LLVM libraries: {path: what the probe answers}."""

    def install(answers: dict[str, dict[str, Any]]) -> None:
        monkeypatch.delenv(llvm.PATH_VARIABLE, raising=False)
        monkeypatch.setattr(llvm, "candidate_paths", lambda: list(answers))
        monkeypatch.setattr(llvm, "run_probe", lambda kind, path: answers[path])

    return install


def test_this_machine_has_a_usable_llvm_and_it_comes_first() -> None:
    libraries = llvm.llvm_libraries()
    assert libraries[0].ok
    assert libraries[0].version is not None
    assert libraries[0].version >= (17, 0, 0)
    assert len({Path(found.path).resolve() for found in libraries}) == len(libraries)


def test_the_newest_usable_library_is_taken(fake_machine) -> None:
    fake_machine({"a-14": library(14), "b-17": library(17), "c-19": library(19)})
    assert [found.path for found in llvm.llvm_libraries()] == ["c-19", "b-17", "a-14"]
    assert [found.ok for found in llvm.llvm_libraries()] == [True, True, False]


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        *(
            ({"/libLLVM.so": library(major)}, rf"libLLVM\.so is LLVM {major}\.0\.0.*17 or newer")
            for major in (11, 14, 15, 16)
        ),
        ({}, r"No LLVM.*apt-get install -y libllvm19"),
        # llvmlite and libclang bring LLVM without the functions that Dr.Jit calls.
        (
            {"x": {"version": None, "missing": ["LLVMRunPasses"], "error": ""}},
            r"not a complete LLVM library \(LLVMRunPasses missing\)",
        ),
    ],
)
def test_old_and_incomplete_libraries_are_as_bad_as_none(
    fake_machine, monkeypatch, answers: dict[str, Any], message: str
) -> None:
    fake_machine(answers)
    monkeypatch.setattr(llvm, "current_platform", lambda: "debian")
    with pytest.raises(SetupError, match=message):
        runtime.require_llvm()


def test_the_variable_is_obeyed_even_when_it_is_wrong(fake_machine, monkeypatch) -> None:
    """Dr.Jit would look nowhere else, so falling back silently is not possible."""
    fake_machine({"/new/libLLVM.so": library(19), "/old/libLLVM.so": library(15)})
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/old/libLLVM.so")
    first, second = llvm.llvm_libraries()
    assert (first.path, first.ok, second.ok) == ("/old/libLLVM.so", False, True)
    with pytest.raises(SetupError, match=r"DRJIT_LIBLLVM_PATH names '/old/libLLVM\.so'.*unset it"):
        runtime.require_llvm()


def test_a_file_that_is_no_library_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "libLLVM.so"
    path.write_text("not a library")
    found = llvm.inspect_llvm(str(path))
    assert not found.ok
    assert found.version is None
    assert found.why.startswith("cannot be loaded")


def test_a_library_that_is_not_llvm_is_refused() -> None:
    import _ctypes

    found = llvm.inspect_llvm(_ctypes.__file__)
    assert not found.ok
    assert "LLVMRunPasses" in found.why


def test_a_probe_that_dies_is_an_answer() -> None:
    """Some libraries abort when they are opened; that must not reach the user's process."""
    answer = llvm.run_probe("llvm")  # no path: the probe ends with an IndexError
    assert answer["error"].startswith("the process that opened it died: IndexError")


def test_candidates_prefer_the_newest_name_and_list_each_file_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.0.6.so.1", "libLLVM.so.19.1", "libLLVM-9.so", "libLLVMCore.so.19"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")
    monkeypatch.setattr(llvm, "current_platform", lambda: "debian")
    monkeypatch.setattr(llvm, "_LINUX_FOLDERS", ())
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "nowhere"))
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    names = [Path(path).resolve().name for path in llvm.candidate_paths()]
    assert names == ["libLLVM.so.19.1", "libLLVM-14.0.6.so.1", "libLLVM-9.so"]
