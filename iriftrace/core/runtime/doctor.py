"""Diagnosis of this machine: libraries, which will be used, what is wrong and how to fix it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import signal
import subprocess
import sys
from functools import cache
from typing import Literal

from attrs import frozen
from packaging.requirements import Requirement

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.runtime import llvm
from iriftrace.core.runtime.llvm import (
    PATH_VARIABLE,
    LlvmLibrary,
    llvm_install_command,
    llvm_libraries,
)
from iriftrace.core.runtime.variant import CudaState, cuda_state, wanted_variant

State = Literal["ok", "warn", "error"]

# In a separate process: without a driver VTK crashes instead of raising an error.
_DRAWING = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))
plotter.add_mesh(pyvista.Sphere())
assert plotter.screenshot(return_img=True).std() > 0
"""
_DRIVERS = {
    "debian": "sudo apt-get update && sudo apt-get install -y libegl1 libgl1-mesa-dri",
    "fedora": "sudo dnf install -y mesa-libEGL mesa-dri-drivers",
}

# The maximum is what LLVM 15 and 16 abort on; 2.5 shows that the kernel ran and what it computed.
# The ray to a square needs OptiX on a GPU.
_TRIAL = """
from iriftrace.core.runtime.variant import ensure
variant = ensure({variant!r})
import drjit, mitsuba
assert drjit.maximum(mitsuba.Float64([1.0, 2.5]), 1.5)[1] == 2.5
scene = mitsuba.load_dict({{"type": "scene", "square": {{"type": "rectangle"}}}})
ray = mitsuba.Ray3f(mitsuba.Point3f([0, 0], 0, 3), mitsuba.Vector3f(0, 0, -1))
assert abs(scene.ray_intersect_preliminary(ray, coherent=True).t[1] - 3) < 1e-5
"""


@frozen
class DiagnosisLine:
    """One line of the diagnosis; `remedy` is a command or an advice, empty when there is none."""

    name: str
    state: State
    text: str
    remedy: str = ""


@frozen
class Diagnosis:
    """All findings, the most important first."""

    findings: tuple[DiagnosisLine, ...]

    @property
    def ok(self) -> bool:
        """Rays can be traced; warnings may remain."""
        return all(finding.state != "error" for finding in self.findings)


def diagnose() -> Diagnosis:
    """Check Python, the packages, LLVM and CUDA, run one kernel and draw one picture.

    The last two happen in other processes, so that a broken library is a finding and not a crash.
    """
    libraries, cuda = _llvm(llvm_libraries()), _cuda(cuda_state())
    return Diagnosis((_python(), *_packages(), *libraries, cuda, _variant(), _drawing()))


def _python() -> DiagnosisLine:
    text = f"{platform.python_version()} on {platform.platform()}, {platform.machine()}"
    if sys.maxsize < 2**32:
        return DiagnosisLine("Python", "error", f"{text}: 32 bit", "install a 64-bit Python")
    return DiagnosisLine("Python", "ok", text)


def _packages() -> list[DiagnosisLine]:
    """Compare the installed packages with those that the installed iriftrace requires."""
    try:
        own = importlib.metadata.distribution("iriftrace")
    except importlib.metadata.PackageNotFoundError:
        text = "runs from a folder without being installed: the plugins cannot be found"
        return [DiagnosisLine("iriftrace", "error", text, f"{sys.executable} -m pip install -e .")]
    findings = [DiagnosisLine("iriftrace", "ok", own.version)]
    for requirement in map(Requirement, own.requires or ()):
        if requirement.marker is None:
            findings.append(_package(requirement))
        if requirement.name == "mitsuba":
            findings.append(_package(Requirement("drjit")))
    return findings


def _package(requirement: Requirement) -> DiagnosisLine:
    try:
        version = importlib.metadata.version(requirement.name)
    except importlib.metadata.PackageNotFoundError:
        text = "not installed"
    else:
        if requirement.specifier.contains(version, prereleases=True):
            return DiagnosisLine(requirement.name, "ok", version)
        text = f"{version}, but {requirement.specifier} is needed"
    remedy = f'{sys.executable} -m pip install "{requirement}"'
    return DiagnosisLine(requirement.name, "error", text, remedy)


def _llvm(libraries: tuple[LlvmLibrary, ...]) -> list[DiagnosisLine]:
    """Check the LLVM libraries; the first one is used, or the one that the variable names."""
    if not libraries:
        return [DiagnosisLine("LLVM", "error", "none was found", llvm_install_command())]
    first, *others = libraries
    findings = []
    if first.ok:
        findings.append(
            DiagnosisLine("LLVM", "ok", f"{first.version_text}, {first.path} (will be used)")
        )
    else:
        text, remedy = f"{first.path} {first.why}", llvm_install_command()
        if os.environ.get(PATH_VARIABLE):
            text = f"{PATH_VARIABLE} names {text}"
        if any(library.ok for library in others):
            remedy = f"unset {PATH_VARIABLE}: a usable library is there (below)"
        findings.append(DiagnosisLine("LLVM", "error", text, remedy))
    for other in others:
        usable = "also usable" if other.ok else f"not used: it {other.why}"
        text = f"{other.version_text}, {other.path} ({usable})"
        findings.append(DiagnosisLine("LLVM", "ok", text))
    return findings


def _cuda(cuda: CudaState) -> DiagnosisLine:
    if cuda.devices:
        return DiagnosisLine("CUDA", "ok", f"{', '.join(cuda.devices)}: cuda_ad_mono can be used")
    return DiagnosisLine("CUDA", "ok", f"no device, so cuda_ad_mono cannot be used ({cuda.why})")


def _variant() -> DiagnosisLine:
    """Run one double-precision kernel and one ray query with the variant that would be set."""
    try:
        variant = wanted_variant()
    except InputError as error:
        return DiagnosisLine("variant", "error", str(error), "unset IRIFTRACE_VARIANT")
    try:
        run_trial(variant)
    except SetupError as error:
        return DiagnosisLine("variant", "error", str(error))
    return DiagnosisLine(
        "variant", "ok", f"{variant}: a double-precision kernel and a ray query ran"
    )


def run_trial(variant: str) -> None:
    """Run one kernel and one ray query in another process; SetupError with its last line if not."""
    trouble = _last_words(_TRIAL.format(variant=variant))
    if trouble:
        raise SetupError(f"{variant} does not work here: {trouble}", code="variant.fails")


def _drawing() -> DiagnosisLine:
    trouble = drawing_trouble()
    if not trouble:
        return DiagnosisLine("pictures", "ok", "VTK draws without a display")
    text = f"VTK cannot draw, so 3-D pictures are left out ({trouble})"
    remedy = _DRIVERS.get(llvm.current_platform(), "install a driver with OpenGL 3.2 or newer")
    return DiagnosisLine("pictures", "warn", text, remedy)


@cache
def drawing_trouble() -> str:
    """Draw a sphere off screen in another process; return why it failed, or "" when it did not.

    Call this before drawing with VTK in this process: without an OpenGL driver VTK ends the
    process instead of raising an error.
    """
    return _last_words(_DRAWING)


def _last_words(code: str) -> str:
    """Run `code` in another process and return the last line of its failure, "" if it succeeded."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", code],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=300,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "it did not finish in 5 minutes"
    if done.returncode == 0:
        return ""
    if done.returncode < 0:
        return f"the process was killed by {signal.Signals(-done.returncode).name}"
    lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
    return lines[-1].removeprefix("iriftrace.core.errors.SetupError: ")
