"""The doctor's lines: what is there, what is wrong, and the very command that mends it."""

import platform
import sys
from importlib.metadata import PackageNotFoundError

import pytest
from packaging.requirements import Requirement

from iriftrace.core.errors import SetupError
from iriftrace.core.runtime import doctor, llvm
from iriftrace.core.runtime.doctor import DiagnosisLine, diagnose
from iriftrace.core.runtime.llvm import LlvmLibrary
from iriftrace.core.runtime.variant import CudaState

GOOD = LlvmLibrary("/usr/lib/libLLVM.so.19.1", (19, 1, 7), "")
OLD = LlvmLibrary("/usr/lib/libLLVM-15.so.1", (15, 0, 6), "is LLVM 15.0.6")
NO_CUDA = CudaState(devices=(), why="libcuda.so.1 is not there")


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch):
    """Pretend to be a machine with these libraries and devices; nothing is run or drawn."""

    def pretend(libraries=(GOOD,), cuda: CudaState = NO_CUDA, system: str = "debian") -> None:
        monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
        monkeypatch.setattr(doctor, "llvm_libraries", lambda: tuple(libraries))
        monkeypatch.setattr(doctor, "cuda_state", lambda: cuda)
        monkeypatch.setattr(doctor, "run_trial", lambda variant: None)
        monkeypatch.setattr(doctor, "drawing_trouble", lambda: "")
        monkeypatch.setattr(llvm, "current_platform", lambda: system)

    return pretend


def lines(name: str) -> list[DiagnosisLine]:
    return [finding for finding in diagnose().findings if finding.name == name]


def test_this_machine_is_well() -> None:
    """Nothing faked: the kernel really runs, in another process."""
    diagnosis = diagnose()
    assert diagnosis.ok, [finding for finding in diagnosis.findings if finding.state != "ok"]
    (variant,) = [finding for finding in diagnosis.findings if finding.name == "variant"]
    assert variant.text.endswith("a double-precision kernel and a ray query ran")


def test_versions_of_the_packages_that_matter_are_listed(machine) -> None:
    """A bug report with these lines says what ran."""
    machine()
    named = {finding.name for finding in diagnose().findings}
    assert {"Python", "iriftrace", "mitsuba", "drjit", "numpy", "pyvista", "OpenEXR"} <= named
    assert not {"pytest", "ruff"} & named  # extras are not needed to trace rays


@pytest.mark.parametrize(
    ("system", "step"),
    [
        ("debian", "sudo apt-get update && sudo apt-get install -y libllvm19"),
        ("debian", "|| sudo apt-get install -y llvm"),  # releases without LLVM 19
        ("fedora", "sudo dnf install -y llvm-libs"),
        ("macos", "brew install llvm"),
        ("windows", "winget install LLVM.LLVM"),
        ("linux", "LLVM shared library, version 17 or newer"),
    ],
)
@pytest.mark.parametrize("libraries", [(), (OLD,)], ids=["none", "too old"])
def test_missing_or_old_llvm_gives_this_platforms_command(
    machine, system: str, step: str, libraries
) -> None:
    machine(libraries=libraries, system=system)
    assert step in lines("LLVM")[0].remedy
    assert lines("LLVM")[0].state == "error"
    assert not diagnose().ok


@pytest.mark.parametrize(
    ("release", "expected"),
    [
        ({"ID": "debian"}, "debian"),
        ({"ID": "ubuntu", "ID_LIKE": "debian"}, "debian"),
        ({"ID": "linuxmint", "ID_LIKE": "ubuntu debian"}, "debian"),
        ({"ID": "fedora"}, "fedora"),
        ({"ID": "rocky", "ID_LIKE": "rhel centos fedora"}, "fedora"),
        ({"ID": "arch"}, "linux"),
    ],
)
def test_distributions_are_recognised(monkeypatch, release: dict[str, str], expected: str) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(platform, "freedesktop_os_release", lambda: release)
    assert llvm.current_platform() == expected


@pytest.mark.parametrize(
    ("name", "expected", "library"),
    [
        ("darwin", "macos", "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib"),
        ("win32", "windows", "LLVM-C.dll"),
    ],
)
def test_other_systems_are_recognised_and_searched(
    monkeypatch, name: str, expected: str, library: str
) -> None:
    monkeypatch.setattr(sys, "platform", name)
    searched: list[str] = []
    monkeypatch.setattr(llvm.glob, "glob", lambda pattern: searched.append(pattern) or [])
    assert llvm.current_platform() == expected
    assert llvm.candidate_paths() == []
    assert any(pattern.endswith(library) for pattern in searched)


def test_the_library_that_will_be_used_is_named_first(machine) -> None:
    machine(libraries=(GOOD, OLD))
    first, second = lines("LLVM")
    assert (first.state, second.state) == ("ok", "ok")
    assert "19.1.7, /usr/lib/libLLVM.so.19.1 (will be used)" in first.text
    assert "not used: it is LLVM 15.0.6" in second.text


def test_a_variable_that_hides_a_usable_library_is_to_be_unset(machine, monkeypatch) -> None:
    """Installing another LLVM would not help while the variable stands."""
    machine(libraries=(OLD, GOOD))
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", OLD.path)
    assert lines("LLVM")[0].state == "error"
    assert lines("LLVM")[0].text.startswith("DRJIT_LIBLLVM_PATH names /usr/lib/libLLVM-15.so.1")
    assert lines("LLVM")[0].remedy.startswith("unset DRJIT_LIBLLVM_PATH")


def test_gpus_are_named_and_their_absence_is_no_fault(machine) -> None:
    machine()
    assert lines("CUDA")[0].state == "ok"
    assert "no device" in lines("CUDA")[0].text
    machine(cuda=CudaState(devices=("NVIDIA H200",), why=""))
    assert lines("CUDA")[0].text == "NVIDIA H200: cuda_ad_mono can be used"


def test_a_kernel_that_fails_is_an_error_with_its_last_words(machine, monkeypatch) -> None:
    def broken(variant: str) -> None:
        raise SetupError(f"{variant} does not work here: Aborted", code="machine.kernel")

    machine()
    monkeypatch.setattr(doctor, "run_trial", broken)
    (line,) = lines("variant")
    assert line.state == "error"
    assert line.text.endswith("Aborted")


def test_the_trial_reports_the_message_of_a_broken_setup(monkeypatch) -> None:
    """The real trial process, with a path at which nothing is."""
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    with pytest.raises(SetupError, match=r"llvm_ad_mono does not work here: DRJIT_"):
        doctor.run_trial("llvm_ad_mono")


def test_a_wrong_variant_variable_is_an_error(machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine()
    monkeypatch.setattr("iriftrace.core.runtime.variant.current_variant", lambda: None)
    monkeypatch.setenv("IRIFTRACE_VARIANT", "scalar_rgb")
    (line,) = lines("variant")
    assert (line.state, line.remedy) == ("error", "unset IRIFTRACE_VARIANT")


def test_a_missing_or_wrong_package_gives_the_pip_command(monkeypatch) -> None:
    def version(name: str) -> str:
        if name == "pint":
            raise PackageNotFoundError(name)
        return "3.8.0"

    monkeypatch.setattr(doctor.importlib.metadata, "version", version)
    missing = doctor._package(Requirement("pint>=0.24"))
    assert (missing.state, missing.text) == ("error", "not installed")
    wrong = doctor._package(Requirement("mitsuba>=3.9,<3.10"))
    assert wrong.state == "error"
    assert "3.8.0" in wrong.text
    assert wrong.remedy == f'{sys.executable} -m pip install "mitsuba<3.10,>=3.9"'


def test_a_machine_that_cannot_draw_is_warned_and_told_what_to_install(
    machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rays are traced without pictures, so this does not make the diagnosis bad."""
    machine()
    monkeypatch.setattr(doctor, "drawing_trouble", lambda: "the process was killed by SIGSEGV")
    (line,) = lines("pictures")
    assert line.state == "warn"
    assert "SIGSEGV" in line.text
    assert line.remedy.endswith("apt-get install -y libegl1 libgl1-mesa-dri")
    assert diagnose().ok


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("pass", ""),
        ("raise ValueError('seven')", "ValueError: seven"),
        ("import os; os.abort()", "the process was killed by SIGABRT"),
        ("import sys; sys.exit(3)", "exit code 3"),
    ],
)
def test_the_last_words_of_a_process_that_died(code: str, words: str) -> None:
    """A crash has no message of its own; its signal is all there is to say."""
    assert doctor._last_words(code) == words
