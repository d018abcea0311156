"""LLVM libraries of this machine, and which of them Dr.Jit can use.

None is loaded into this process: an old LLVM aborts it, and Dr.Jit would use a loaded one.
"""

from __future__ import annotations

import glob
import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

from attrs import frozen

from iriftrace.core.errors import SetupError
from iriftrace.core.plain import JsonObject

#: Dr.Jit reads this once, when Mitsuba is imported.
PATH_VARIABLE = "DRJIT_LIBLLVM_PATH"
#: LLVM 15 and 16 abort the process at the first float64 maximum on AVX-512 machines.
OLDEST_MAJOR = 17

_LINUX_FOLDERS = (
    "/usr/lib/x86_64-linux-gnu",  # Debian, Ubuntu
    "/usr/lib/aarch64-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",  # Fedora, RHEL, openSUSE
    "/usr/lib64/llvm*/lib*",
    "/usr/lib",  # Arch
    "/usr/lib/llvm*/lib",  # Alpine
    "/usr/local/lib",
    "/home/linuxbrew/.linuxbrew/opt/llvm*/lib",
)
_MACOS_FOLDERS = (
    "/opt/homebrew/opt/llvm*/lib",
    "/usr/local/opt/llvm*/lib",
    "/opt/local/libexec/llvm-*/lib",
)

# Dr.Jit's wheel also needs libatomic, which comes with compilers and is missing on bare systems.
# Debian 12's default LLVM is 14, hence 19 by name; releases after Debian 13 have only newer ones.
_INSTALL = {
    "debian": (
        "sudo apt-get update && sudo apt-get install -y libllvm19 libatomic1 "
        "|| sudo apt-get install -y llvm libatomic1"
    ),
    "fedora": "sudo dnf install -y llvm-libs libatomic",
    "macos": "brew install llvm",
    "windows": (
        "winget install LLVM.LLVM && setx DRJIT_LIBLLVM_PATH "
        r'"C:\Program Files\LLVM\bin\LLVM-C.dll"'
    ),
    "linux": (
        "install your distribution's LLVM shared library, version 17 or newer, "
        "and set DRJIT_LIBLLVM_PATH to its libLLVM.so"
    ),
}


@frozen
class LlvmLibrary:
    """One LLVM library that was found: a file, or a name that the system's loader resolves.

    The version (major, minor, patch) is None where it does not say; `why` is a clause that says why
    Dr.Jit cannot run iriftrace's kernels with it, empty if it can.
    """

    path: str
    version: tuple[int, int, int] | None
    why: str

    @property
    def ok(self) -> bool:
        """True if Dr.Jit can run iriftrace's kernels with it."""
        return not self.why

    @property
    def version_text(self) -> str:
        """The version as "19.1.7", or "unknown"."""
        return "unknown" if self.version is None else ".".join(map(str, self.version))


def current_platform() -> str:
    """Return "debian" or "fedora" (with their descendants), "macos", "windows" or "linux"."""
    if sys.platform in ("win32", "cygwin"):
        return "windows"
    if sys.platform == "darwin":
        return "macos"
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        return "linux"
    names = {release.get("ID", ""), *release.get("ID_LIKE", "").split()}
    if names & {"debian", "ubuntu"}:
        return "debian"
    if names & {"fedora", "rhel", "centos"}:
        return "fedora"
    return "linux"


def llvm_install_command() -> str:
    """Return the command that installs a usable LLVM on this platform."""
    return _INSTALL[current_platform()]


def llvm_libraries() -> tuple[LlvmLibrary, ...]:
    """Return the LLVM libraries of this machine, each once, the one that will be used first.

    The one that `DRJIT_LIBLLVM_PATH` names goes first, whether it works or not, because Dr.Jit
    looks nowhere else then; the usable ones follow, newest first, and then the others.
    """
    named = os.environ.get(PATH_VARIABLE, "")
    found = [inspect_llvm(path) for path in candidate_paths()]
    found.sort(key=lambda library: (library.ok, library.version or (0, 0, 0)), reverse=True)
    if not named:
        return tuple(found)
    first = inspect_llvm(named)
    others = [other for other in found if os.path.realpath(other.path) != os.path.realpath(named)]
    return (first, *others)


def require_llvm() -> LlvmLibrary:
    """Return the LLVM library to use: what `DRJIT_LIBLLVM_PATH` names, else the newest usable one.

    SetupError if no library is usable, or the one the variable names is not.
    """
    named = os.environ.get(PATH_VARIABLE, "")
    rejected = []
    for path in [named] if named else candidate_paths():  # newest name first: usually one is opened
        library = inspect_llvm(path)
        if library.ok:
            return library
        rejected.append(library)
    if named:
        raise SetupError(
            f"{PATH_VARIABLE} names {named!r}, which {rejected[0].why}; unset it or name a libLLVM "
            f"of version {OLDEST_MAJOR} or newer (to install one: {llvm_install_command()}).",
            code="llvm.unusable_path",
        )
    trouble = "No LLVM library was found, and rays are traced by code that LLVM compiles"
    if rejected:
        newest = max(rejected, key=lambda library: library.version or (0, 0, 0))
        trouble = f"No usable LLVM library was found: {newest.path} {newest.why}"
    remedy = f"Install LLVM {OLDEST_MAJOR} or newer: {llvm_install_command()}"
    raise SetupError(f"{trouble}. {remedy}", code="llvm.none")


def inspect_llvm(path: str) -> LlvmLibrary:
    """Open `path` in another process and say whether iriftrace can use it."""
    answer = run_probe("llvm", path)
    numbers = answer.get("version")
    version = None if numbers is None else (int(numbers[0]), int(numbers[1]), int(numbers[2]))
    return LlvmLibrary(path, version, _objection(version, answer))


def _objection(version: tuple[int, int, int] | None, answer: JsonObject) -> str:
    if answer["error"]:
        return f"cannot be loaded ({answer['error']})"
    old = version is not None and version[0] < OLDEST_MAJOR
    if answer["missing"] and not old:
        return f"is not a complete LLVM library ({', '.join(answer['missing'])} missing)"
    if version is None or old:
        said = "older than 16" if version is None else ".".join(map(str, version))
        return (
            f"is LLVM {said}, and versions before {OLDEST_MAJOR} can abort the whole process at "
            "the first double-precision maximum"
        )
    return ""


def run_probe(*arguments: str) -> JsonObject:
    """Run library_probe.py with `arguments`; a crash becomes an answer with "error"."""
    probe = Path(__file__).with_name("library_probe.py")
    command = [sys.executable, "-I", "-S", str(probe), *arguments]
    nothing: JsonObject = {"version": None, "missing": [], "devices": []}
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except subprocess.TimeoutExpired:
        return {**nothing, "error": "it did not answer within a minute"}
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return {**nothing, "error": f"the process that opened it died: {last}"}
    answer: JsonObject = json.loads(done.stdout)
    return answer


def candidate_paths() -> list[str]:
    """Return the LLVM library files of this machine, each file once, the newest name first."""
    files: dict[str, str] = {}
    for pattern in _patterns():
        for path in sorted(glob.glob(pattern)):
            files.setdefault(os.path.realpath(path), path)

    def numbers(path: str) -> tuple[int, ...]:
        # Numbers in the file's own name; a name without any comes last.
        return tuple(map(int, re.findall(r"\d+", os.path.basename(os.path.realpath(path)))))

    return sorted(files.values(), key=numbers, reverse=True)


def _patterns() -> list[str]:
    here = Path(sys.prefix)  # conda puts its libraries next to its Python
    kind = current_platform()
    if kind == "windows":
        programs = os.environ.get("PROGRAMFILES", r"C:\Program Files")
        folders = [here / "Library" / "bin", Path(programs) / "LLVM" / "bin"]
        return [str(folder / "LLVM-C.dll") for folder in folders]
    if kind == "macos":
        return [f"{folder}/libLLVM*.dylib" for folder in (here / "lib", *_MACOS_FOLDERS)]
    loader = [folder for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":") if folder]
    # "libLLVM." or "libLLVM-" only: libLLVMCore.so and the like are fragments of an LLVM.
    return [f"{folder}/libLLVM[.-]*so*" for folder in (*loader, here / "lib", *_LINUX_FOLDERS)]
