"""Variants, and the LLVM library they need: set before it can do harm.

What depends on the order of imports or could kill the process runs in a process of its own.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import mitsuba
import pytest

from iriftrace.core.errors import InputError, SetupError
from iriftrace.core.runtime import llvm
from iriftrace.core.runtime import variant as runtime

WITHOUT_VTK = (
    "medium.air.refractivity camera.camera core.errors core.units core.mesh.transform "
    "image.aov_image image.displacement image.metrics image.resolution part.part "
    "core.runtime.doctor core.runtime.llvm core.runtime.variant io.exr io.field_npz"
).split()
WITHOUT_MITSUBA = (
    "medium.part_fit io.field medium.shells.contour io.iso_surfaces medium.shells.report".split()
)
OLD_LIBRARIES = [library.path for library in llvm.llvm_libraries() if not library.ok]
#: Seconds after which a process that does not end says on stderr where it stands.
TOO_LONG = 60


def run_python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `code` in a fresh Python whose only LLVM and variant settings are `environment`."""
    watched = (
        f"import faulthandler\nfaulthandler.dump_traceback_later({TOO_LONG}, exit=True)\n{code}"
    )
    return subprocess.run(
        [sys.executable, "-c", watched],
        capture_output=True,
        text=True,
        env={**without_settings(), **environment},
        timeout=120,
        check=False,
    )


def run_past_hangs(code: str, path: str) -> subprocess.CompletedProcess[str]:
    """Run `code` with an LLVM library that may be of no use; anew if it does not get past loading.

    Twice in many runs a process stood still before Dr.Jit said what it thinks of LLVM 14, a large
    file that nothing else reads. Three such processes in a row leave the test out, which the last
    line of the run says. Waiting for our own probe fails.
    """
    for _ in range(3):
        done = run_python(code, DRJIT_LIBLLVM_PATH=path)
        waits_for_probe = re.search(r'runtime[\\/]llvm\.py"', done.stderr)
        if "Timeout (" not in done.stderr or waits_for_probe:
            return done
    pytest.skip(f"Mitsuba with {path} not tested: it does not load ({done.stderr})")


def without_settings() -> dict[str, str]:
    hidden = (llvm.PATH_VARIABLE, runtime.VARIANT_VARIABLE)
    return {key: value for key, value in os.environ.items() if key not in hidden}


def answer_of(code: str, **environment: str) -> Any:
    """Run `code` and return the JSON that it wrote."""
    done = run_python(code, **environment)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_importing_does_not_import_what_the_module_can_do_without() -> None:
    """Reading metrics needs no renderer, and --help must not wait seconds for VTK."""
    renderer = ["mitsuba", "drjit"]
    code = f"""
import importlib, json, sys
import iriftrace
dragged = {{}}
for modules, forbidden in (
    ({WITHOUT_VTK}, {[*renderer, "vtkmodules", "pyvista"]}),
    ({WITHOUT_MITSUBA}, {renderer}),
):
    for name in modules:
        importlib.import_module("iriftrace." + name)
        for heavy in set(forbidden) & set(sys.modules):
            dragged.setdefault(heavy, "iriftrace." + name)
print(json.dumps(dragged))
"""
    assert answer_of(code) == {}


def test_nothing_set_gives_the_llvm_variant_with_plugins_and_the_path_set() -> None:
    """ensure() alone is enough in a fresh process, and a second call changes nothing."""
    code = """
import json, os
from iriftrace.core.runtime.variant import ensure
first = ensure()
import mitsuba
plugin = mitsuba.load_dict({"type": "first_hit"}).__class__.__name__
print(json.dumps([first, ensure(), mitsuba.variant(), os.environ["DRJIT_LIBLLVM_PATH"]]))
"""
    first, second, variant, path = answer_of(code)
    assert first == second == variant == "llvm_ad_mono"
    assert path == runtime.require_llvm().path


def test_a_path_that_the_user_set_is_left_as_it_is() -> None:
    path = runtime.require_llvm().path
    alias = str(Path(path).resolve())
    code = "import os; from iriftrace.core.runtime.variant import ensure; ensure();"
    code += "import json; print(json.dumps(os.environ['DRJIT_LIBLLVM_PATH']))"
    assert answer_of(code, DRJIT_LIBLLVM_PATH=alias) == alias


def test_argument_beats_session_beats_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IRIFTRACE_VARIANT", "cuda_ad_mono")
    monkeypatch.setattr(runtime, "current_variant", lambda: None)
    assert runtime.wanted_variant() == "cuda_ad_mono"
    monkeypatch.setattr(runtime, "current_variant", lambda: "llvm_ad_mono")
    assert runtime.wanted_variant() == "llvm_ad_mono"
    assert runtime.wanted_variant("cuda_ad_mono") == "cuda_ad_mono"
    monkeypatch.setattr(runtime, "current_variant", lambda: None)
    monkeypatch.setenv("IRIFTRACE_VARIANT", "")
    assert runtime.wanted_variant() == "llvm_ad_mono"


@pytest.mark.parametrize("name", ["scalar_rgb", "scalar_spectral", "llvm_ad_rgb", "gpu", ""])
def test_other_variants_are_refused_in_one_sentence(name: str) -> None:
    """A scalar variant would run, slowly and in single precision: worse than an error."""
    with pytest.raises(InputError, match="choose llvm_ad_mono or cuda_ad_mono") as caught:
        runtime.ensure(name)
    assert repr(name) in str(caught.value)
    assert str(caught.value).count(".") == 1


@pytest.mark.parametrize(
    ("current", "message"),
    [
        ("scalar_rgb", r"Mitsuba's current variant 'scalar_rgb'.*scalar"),
        (None, "IRIFTRACE_VARIANT = 'scalar_rgb'"),
    ],
)
def test_a_scalar_session_or_environment_is_named(
    monkeypatch: pytest.MonkeyPatch, current: str | None, message: str
) -> None:
    """Switching behind the user's back would break the objects that are loaded already."""
    monkeypatch.setattr(runtime, "current_variant", lambda: current)
    monkeypatch.setenv("IRIFTRACE_VARIANT", "scalar_rgb")
    with pytest.raises(InputError, match=message):
        runtime.ensure()


@pytest.mark.parametrize("former", ["llvm_ad_rgb", "scalar_rgb"])
def test_using_switches_and_comes_back(variant: str, former: str) -> None:
    """Also when the block raises, and the plugins work again after each switch."""
    mitsuba.set_variant(former)
    try:
        for _ in range(2):
            with runtime.using(variant) as name:
                assert mitsuba.variant() == name == variant
                assert mitsuba.load_dict({"type": "first_hit"}) is not None
            assert mitsuba.variant() == former
        with pytest.raises(ZeroDivisionError), runtime.using(variant):
            _ = 1 / 0
        assert mitsuba.variant() == former
    finally:
        mitsuba.set_variant(variant)


def test_cuda_without_a_device_is_an_error_that_names_the_other_variant(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nothing = runtime.CudaState(devices=(), why="libcuda.so.1: no such file")
    monkeypatch.setattr(runtime, "cuda_state", lambda: nothing)
    with pytest.raises(SetupError, match=r"NVIDIA.*libcuda\.so\.1.*llvm_ad_mono"):
        runtime.ensure("cuda_ad_mono")


NO_LLVM = """
import sys
from iriftrace.core.runtime import llvm
from iriftrace.core.runtime import variant as runtime
from iriftrace.core.errors import SetupError
llvm.candidate_paths = lambda: []
try:
    runtime.ensure()
except SetupError as error:
    print(error)
sys.exit("mitsuba" in sys.modules or "drjit" in sys.modules)
"""


def test_without_llvm_the_error_comes_before_mitsuba_is_imported() -> None:
    """One failed load cannot be repaired in the same process, so it must not happen."""
    done = run_python(NO_LLVM)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("No LLVM library was found")


@pytest.mark.parametrize("path", [*OLD_LIBRARIES, "/nowhere/libLLVM.so"])
def test_a_bad_path_is_found_out_before_mitsuba_is_imported(path: str) -> None:
    """With LLVM 15 the process would die at the first float64 maximum, not raise."""
    done = run_python(NO_LLVM, DRJIT_LIBLLVM_PATH=path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"DRJIT_LIBLLVM_PATH names {path!r}")
    assert done.stdout.count("\n") == 1


def test_a_library_that_mitsuba_lacks_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bare systems have no libatomic; Dr.Jit then raises a NameError about its own module."""

    def drjit_without_libatomic() -> None:
        try:
            raise ImportError("libatomic.so.1: cannot open shared object file")
        except ImportError:
            raise NameError("name '_drjit_ext' is not defined")  # noqa: B904

    monkeypatch.setattr(runtime, "_mitsuba", drjit_without_libatomic)
    monkeypatch.setattr(runtime, "current_variant", lambda: None)
    monkeypatch.setattr(llvm, "current_platform", lambda: "debian")
    with pytest.raises(SetupError, match=r"\(libatomic\.so\.1: .*install -y libllvm19 libatomic1"):
        runtime.ensure()


def test_ctrl_c_within_the_import_is_no_fault_of_mitsuba(monkeypatch: pytest.MonkeyPatch) -> None:
    """It arrives as the ImportError of the extension that was being loaded."""

    def interrupted() -> Any:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error

    monkeypatch.setattr(runtime, "_mitsuba", interrupted)
    with pytest.raises(KeyboardInterrupt):
        runtime._import_mitsuba()


def test_mitsuba_that_is_not_installed_is_to_be_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> None:
        raise ModuleNotFoundError("No module named 'mitsuba'")

    monkeypatch.setattr(runtime, "_mitsuba", absent)
    monkeypatch.setattr(runtime, "current_variant", lambda: None)
    with pytest.raises(SetupError, match=r'No module named .*pip install "mitsuba>=3\.9,<3\.10"'):
        runtime.ensure()


TOO_LATE = """
import os
import mitsuba
try:
    mitsuba.set_variant("llvm_ad_rgb")
except ImportError:
    pass
del os.environ["DRJIT_LIBLLVM_PATH"]
from iriftrace.core.runtime import variant as runtime
from iriftrace.core.errors import SetupError
try:
    runtime.ensure("llvm_ad_mono")
except SetupError as error:
    print(error)
"""


@pytest.mark.parametrize("path", [*OLD_LIBRARIES, "/nowhere/libLLVM.so"])
def test_mitsuba_imported_earlier_with_a_bad_llvm_needs_a_restart(path: str) -> None:
    """Dr.Jit looks for LLVM once per process; a better path given later is not read."""
    done = run_past_hangs(TOO_LATE, path)
    assert done.returncode == 0, done.stderr
    assert "Mitsuba was imported" in done.stdout
    assert "restart Python" in done.stdout


def test_a_driver_without_optix_is_a_matter_of_setup() -> None:
    with pytest.raises(SetupError, match="newer NVIDIA driver"):
        runtime.refuse_gpu_without_optix(RuntimeError("Could not initialize OptiX!"))
    runtime.refuse_gpu_without_optix(RuntimeError("something else"))
