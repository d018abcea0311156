"""Open one LLVM or CUDA library in a separate process and write the result as JSON.

Run as a file (`python -I -S library_probe.py llvm PATH`), never imported by iriftrace: a library
that aborts on loading, or two LLVMs that disagree, must not take the user's process with them.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys

# Dr.Jit looks these up; parser-only builds such as libclang's or llvmlite's miss some of them.
_NEEDED = ("LLVMRunPasses", "LLVMOrcCreateLLJIT", "LLVMCreateDisasm", "LLVMParseIRInContext")
# LLVMGetVersion exists from LLVM 16 on; before, only the link-time optimizer knew the number.
_OLD_VERSION = "_ZN4llvm16LTOCodeGenerator16getVersionStringEv"


def probe_llvm(path: str) -> dict[str, object]:
    """Return {"version": [major, minor, patch] or None, "missing": names, "error": text}."""
    try:
        library = ctypes.CDLL(path)
    except OSError as error:
        return {"version": None, "missing": [], "error": str(error)}
    version: list[int] | None = None
    if hasattr(library, "LLVMGetVersion"):
        numbers = [ctypes.c_uint() for _ in range(3)]
        library.LLVMGetVersion(*[ctypes.byref(number) for number in numbers])
        version = [number.value for number in numbers]
    elif hasattr(library, _OLD_VERSION):
        text_of = library[_OLD_VERSION]
        text_of.restype = ctypes.c_char_p
        text = (text_of() or b"").decode(errors="replace").removeprefix("LLVM version ")
        digits = text.split(".")
        if len(digits) >= 3 and all(digit.isdecimal() for digit in digits[:3]):
            version = [int(digit) for digit in digits[:3]]
    missing = [name for name in _NEEDED if not hasattr(library, name)]
    return {"version": version, "missing": missing, "error": ""}


def probe_cuda() -> dict[str, object]:
    """Return {"devices": names, "memory_bytes": of the first, "error": why there is none}."""
    windows = sys.platform == "win32"
    try:
        driver = _library("DRJIT_LIBCUDA_PATH", "nvcuda.dll" if windows else "libcuda.so.1")
        # On Windows OptiX lies in the driver store and is found through the registry.
        if not windows:
            _library("DRJIT_LIBOPTIX_PATH", "libnvoptix.so.1")
    except OSError as error:
        return {"devices": [], "error": str(error)}
    status = driver.cuInit(0)
    if status != 0:
        return {"devices": [], "error": f"cuInit failed with code {status}"}
    count, memory = ctypes.c_int(), ctypes.c_size_t()
    driver.cuDeviceGetCount(ctypes.byref(count))
    names: list[str] = []
    for ordinal in range(count.value):
        device = ctypes.c_int()
        driver.cuDeviceGet(ctypes.byref(device), ordinal)
        name = ctypes.create_string_buffer(256)
        driver.cuDeviceGetName(name, len(name), device)
        if not names:
            driver.cuDeviceTotalMem_v2(ctypes.byref(memory), device)
        names.append(name.value.decode(errors="replace"))
    why = "" if names else "the driver reports no device"
    return {"devices": names, "memory_bytes": memory.value, "error": why}


def _library(variable: str, name: str) -> ctypes.CDLL:
    """The library that an environment variable of Dr.Jit names, or the system's."""
    return ctypes.CDLL(os.environ.get(variable) or name)


if __name__ == "__main__":
    answer = probe_cuda() if sys.argv[1] == "cuda" else probe_llvm(sys.argv[2])
    sys.stdout.write(json.dumps(answer))
