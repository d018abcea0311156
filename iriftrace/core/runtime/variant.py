"""Choice of Mitsuba's variant, with an LLVM or CUDA that works.

All other modules use LLVM, CUDA and variants through this one.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType

from attrs import frozen

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.runtime.llvm import (
    OLDEST_MAJOR,
    PATH_VARIABLE,
    llvm_install_command,
    require_llvm,
    run_probe,
)

#: Single-channel, as a ray has one wavelength; "ad" is what derivatives need.
VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")
DEFAULT_VARIANT = "llvm_ad_mono"
VARIANT_VARIABLE = "IRIFTRACE_VARIANT"


@frozen
class CudaState:
    """The CUDA devices of this machine by name, why there are none, and the first one's memory."""

    devices: tuple[str, ...]
    why: str
    memory_bytes: int = 0


@cache
def cuda_state() -> CudaState:
    """Ask the CUDA driver for its devices, in another process."""
    answer = run_probe("cuda")
    return CudaState(tuple(answer["devices"]), answer["error"], answer.get("memory_bytes", 0))


def current_variant() -> str | None:
    """Return the variant that is set in this process, or None; does not import Mitsuba."""
    if "mitsuba" not in sys.modules:
        return None
    name: str | None = _mitsuba().variant()
    return name


def wanted_variant(variant: str | None = None) -> str:
    """Return the variant that `ensure(variant)` would set.

    In this order: the argument, the variant that is set already, the environment variable
    `IRIFTRACE_VARIANT`, `llvm_ad_mono`. InputError if it is not one of `VARIANTS`.
    """
    already = current_variant()
    if variant is not None:
        name, origin = variant, "The variant"
    elif already is not None:
        name, origin = already, "Mitsuba's current variant"
    elif os.environ.get(VARIANT_VARIABLE):
        name, origin = os.environ[VARIANT_VARIABLE], f"{VARIANT_VARIABLE} ="
    else:
        name, origin = DEFAULT_VARIANT, "The variant"
    if name in VARIANTS:
        return name
    if name.startswith("scalar"):
        reason = "scalar variants trace one ray at a time in single precision"
    else:
        reason = "rays here have one wavelength and are traced as arrays"
    raise InputError(
        f"{origin} {name!r} cannot be used, because {reason}; choose {' or '.join(VARIANTS)}.",
        code="variant.unusable",
        argument="variant",
    )


def ensure(variant: str | None = None) -> str:
    """Set a variant that works, register iriftrace's plugins with it and return its name.

    Call it before anything that traces rays; calling it again costs nothing. `wanted_variant` says
    what is chosen. Exactly this variant is set: there is no fallback, least of all to a scalar one.

    Before Mitsuba is imported for the first time, and only when `DRJIT_LIBLLVM_PATH` is unset, the
    variable is set to the newest LLVM found that is 17 or newer, in this process and its children.
    Otherwise Dr.Jit might pick an older one, and LLVM 15 and 16 abort the process.

    Raises
    ------
    InputError
        The variant is a scalar one or otherwise not among `VARIANTS`, or the working folder holds
        compiled plugins; see `refuse_foreign_plugins`.
    SetupError
        No usable LLVM or CUDA, or Mitsuba was imported earlier and took an LLVM that is not usable.
    """
    name = wanted_variant(variant)
    if name != current_variant():
        _set_variant(name)
    if name.startswith("llvm"):
        # Mitsuba may have been imported before: check which library Dr.Jit has loaded.
        version = importlib.import_module("drjit.detail").llvm_version()
        if version[0] < OLDEST_MAJOR:
            raise SetupError(
                f"Mitsuba was imported earlier and has loaded LLVM {'.'.join(map(str, version))}, "
                f"and versions before {OLDEST_MAJOR} can abort the whole process; restart Python "
                "and call iriftrace.core.runtime.variant.ensure() before importing mitsuba, or set "
                f"{PATH_VARIABLE} first.",
                code="llvm.too_old",
            )
    refuse_foreign_plugins(Path.cwd())
    importlib.import_module("iriftrace.plugins").register()
    return name


def refuse_foreign_plugins(folder: Path) -> None:
    """Refuse a folder whose compiled plugins Mitsuba would load instead of its own.

    For a plugin Mitsuba runs the library ``plugins/NAME.so`` of a scene's folder and of the working
    folder, whoever put it there, before it looks among its own.
    """
    files = (folder / "plugins").glob("*")
    found = sorted(file.name for file in files if file.suffix in (".so", ".dylib", ".dll"))
    if found and folder.resolve() != Path(str(_mitsuba().__file__)).parent.resolve():
        raise InputError(
            f"{folder / 'plugins'} holds compiled code ({found[0]}) that Mitsuba would run as a "
            "plugin of its own; work in another folder, or take it away.",
            code="mitsuba.foreign_plugin",
        )


@contextmanager
def full_precision() -> Iterator[None]:
    """Switch off Dr.Jit's fast arithmetic, which on CUDA leaves 20 bits of a double reciprocal."""
    drjit = importlib.import_module("drjit")
    fast = drjit.flag(drjit.JitFlag.FastMath) and not (current_variant() or "").startswith("cuda")
    with drjit.scoped_set_flag(drjit.JitFlag.FastMath, fast):
        yield


@contextmanager
def using(variant: str) -> Iterator[str]:
    """Work with `variant` inside the `with` block and set the former variant again afterwards.

    Objects of one variant cannot be used in another, so they end with the block. When no variant
    was set before, this one stays, because Mitsuba cannot unset one. Errors as of `ensure`.
    """
    former = current_variant()
    name = ensure(variant)
    try:
        with full_precision():
            yield name
    finally:
        if former is not None and former != current_variant():
            _mitsuba().set_variant(former)


def _set_variant(name: str) -> None:
    imported_before = "mitsuba" in sys.modules
    if not imported_before:
        try:
            os.environ[PATH_VARIABLE] = require_llvm().path
        except SetupError:
            if name.startswith("llvm"):
                raise
    if name.startswith("cuda") and not cuda_state().devices:
        raise SetupError(
            "cuda_ad_mono needs an NVIDIA GPU with its driver, and none answers "
            f"({cuda_state().why}); install the driver or use {DEFAULT_VARIANT}.",
            code="gpu.none",
            argument="variant",
        )
    mitsuba = _import_mitsuba()
    if name not in mitsuba.variants():
        raise SetupError(
            f"This Mitsuba ({mitsuba.__version__}) was built without {name}; "
            'install the published one: pip install "mitsuba>=3.9,<3.10"',
            code="variant.not_built",
        )
    try:
        mitsuba.set_variant(name)
    except ImportError as error:
        cause = str(error).splitlines()[0]
        if imported_before and name.startswith("llvm"):
            require_llvm()  # says what to install, should there still be none
            raise SetupError(
                f"Mitsuba was imported before it could find a usable LLVM and cannot look again "
                f"({cause}); restart Python and call iriftrace.core.runtime.variant.ensure() "
                "before importing mitsuba.",
                code="llvm.found_too_late",
            ) from error
        raise SetupError(
            f"Mitsuba cannot work with {name}: {cause}", code="variant.fails"
        ) from error


def refuse_gpu_without_optix(error: Exception) -> None:
    """Raise SetupError with the remedy if the driver has no OptiX that Mitsuba can use."""
    if "initialize OptiX" in str(error):
        raise SetupError(
            "This GPU's driver has no OptiX that Mitsuba can trace rays with; install a newer "
            f"NVIDIA driver, or use {DEFAULT_VARIANT}.",
            code="gpu.no_optix",
            argument="variant",
        ) from error


def readable(error: Exception) -> str:
    """Mitsuba's message on one line, without colours, tracebacks and positions in its source."""
    text = re.sub(r"\[[\w.]+\.(cpp|h):\d+\]\s*|\x1b\[[0-9;]*m", "", str(error))
    # A plugin in Python that refuses its properties comes with a traceback before its message.
    text = re.sub(r"Traceback \(most recent call last\):\n(?:[ \t].*\n)*(?:[\w.]+: )?", "", text)
    return re.sub(r"\s*\n\s*", " ", text).strip()


def _import_mitsuba() -> ModuleType:
    try:
        return _mitsuba()
    except (ImportError, NameError) as error:  # Dr.Jit stumbles over its own ImportError
        cause: BaseException = error
        while cause.__context__ is not None:
            cause = cause.__context__
        if isinstance(cause, KeyboardInterrupt):
            # Ctrl-C within the import arrives wrapped; it says nothing about the installation.
            raise KeyboardInterrupt from error
        if isinstance(cause, ModuleNotFoundError):
            remedy = 'pip install "mitsuba>=3.9,<3.10"'
        else:
            remedy = llvm_install_command()
        raise SetupError(
            f"Mitsuba cannot be imported ({cause}); to fix it: {remedy}", code="mitsuba.no_import"
        ) from error


def _mitsuba() -> ModuleType:
    return importlib.import_module("mitsuba")
