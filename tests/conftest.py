"""Fixtures and checks that hold for the whole test run."""

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path

# Before anything can import VTK or Matplotlib: tests draw on machines without a display.
os.environ["PYVISTA_OFF_SCREEN"] = "true"
os.environ["MPLBACKEND"] = "Agg"
os.environ.pop("IRIFTRACE_VARIANT", None)
# Tests run side by side; the threads of one would only wait for those of the other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import pytest

from iriftrace.core.errors import IriftraceError
from iriftrace.core.runtime import variant as runtime

SYSTEM_TESTS = Path(__file__).parent / "system"
CUDA = runtime.cuda_state()
TESTED_VARIANTS = ("llvm_ad_mono", "cuda_ad_mono") if CUDA.devices else ("llvm_ad_mono",)

# Shared machines are slow at times; how long an example takes says nothing about its result.
# Each run draws other examples.
hypothesis.settings.register_profile("iriftrace", deadline=None, max_examples=30)
hypothesis.settings.load_profile("iriftrace")


def pytest_sessionstart() -> None:
    """Fail at once without a working llvm_ad_mono, for else most tests would fail one by one."""
    try:
        library = runtime.require_llvm()
    except IriftraceError as error:
        pytest.exit(f"llvm_ad_mono cannot be tested: {error}", returncode=2)
    os.environ.setdefault("DRJIT_LIBLLVM_PATH", library.path)
    import drjit
    import mitsuba

    try:
        mitsuba.set_variant("llvm_ad_mono")
    except ImportError as error:
        pytest.exit(f"llvm_ad_mono cannot be tested: {error}", returncode=2)
    # As for OpenBLAS above.
    if "PYTEST_XDIST_WORKER" in os.environ:
        drjit.set_thread_count(1)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what lies in tests/system, so that `-m "not system"` is the quick run.

    Folders of long files come first, so that no worker has one of them alone at the end.
    """
    items.sort(key=lambda item: item.path, reverse=True)
    for item in items:
        if SYSTEM_TESTS in item.path.parents:
            item.add_marker(pytest.mark.system)


def pytest_collection_finish() -> None:
    """Modules and tests stay to the end, so that no collection of garbage has to look at them."""
    gc.collect()
    gc.freeze()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run each test that asks for `variant` once per variant that this machine can run.

    For the whole session, so that fixtures of any scope can build on it and pytest sorts the tests
    by variant instead of switching to and fro.
    """
    if "variant" in metafunc.fixturenames:
        metafunc.parametrize("variant", TESTED_VARIANTS, indirect=True, scope="session")


@pytest.fixture(scope="session")
def variant(request: pytest.FixtureRequest) -> Iterator[str]:
    """The name of the variant that is set, with iriftrace's plugins registered."""
    with runtime.using(request.param) as name:
        yield name


@pytest.fixture
def tmp_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder without the test's name, in which an expected message could be found."""
    return tmp_path_factory.mktemp("t")


@pytest.fixture(autouse=True)
def _variant_is_the_one_asked_for(request: pytest.FixtureRequest) -> None:
    """A test that switched the variant and did not come back would spoil all that follow."""
    if "variant" in request.fixturenames:
        assert runtime.current_variant() == request.getfixturevalue("variant")


@pytest.fixture(scope="module", autouse=True)
def _jit_memory_returned() -> Iterator[None]:
    """Give back Dr.Jit's cached arrays after each file; compiled kernels stay, they are reused.

    What is still in use then, such as modules, is not looked at again.
    """
    yield
    if "drjit" in sys.modules:
        gc.collect()
        gc.freeze()
        sys.modules["drjit"].flush_malloc_cache()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> Iterator[None]:
    """Say last, below the failures, what this machine could not test."""
    yield
    left_out = [] if CUDA.devices else ["cuda_ad_mono not tested: no CUDA device"]
    reasons = [report.longrepr[2] for report in terminalreporter.stats.get("skipped", [])]
    plain = [reason.removeprefix("Skipped: ") for reason in reasons]
    left_out += dict.fromkeys(reason for reason in plain if "not tested" in reason)
    if left_out:
        terminalreporter.write_line("; ".join(left_out))
