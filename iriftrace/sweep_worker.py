"""What runs in a worker process of a sweep: load the scene once, render pose after pose."""

from __future__ import annotations

import socket
import threading
import warnings
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from iriftrace import runtime
from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.scene import LoadedScene, load_scene
from iriftrace.sweep_pose import PoseResult, PoseTask, SceneSource, render_pose, source_of

# A worker that was started with several threads gets several poses at once, but Dr.Jit's arrays,
# the variant and the scene are those of the process. A pose uses several cores anyway.
_one_at_a_time = threading.Lock()

# Only the last scene: tasks come scene by scene, and a scene can need gigabytes.
_loaded: dict[str, LoadedScene] = {}


def render_on_worker(task: PoseTask, workers_of_host: Mapping[str, int]) -> PoseResult:
    """Render one pose in this worker.

    Parameters
    ----------
    task : PoseTask
    workers_of_host : mapping
        Number of workers on each host, by the host's name in their addresses.

    Raises
    ------
    InputError
        If this worker does not see the same scene, or runs another version of iriftrace.
    SetupError
        If no usable LLVM or CUDA is there.
    """
    with _one_at_a_time:
        _share_cores(task.source.variant, workers_of_host)
        return render_pose(task, _scene(task.source))


def _share_cores(variant: str, workers_of_host: Mapping[str, int]) -> None:
    """Let Dr.Jit use this worker's share of the cores.

    By default each process takes all of them: n workers would run n times as many threads as there
    are cores, which wait for each other. The result does not depend on it.
    """
    runtime.ensure(variant)
    drjit = import_module("drjit")
    address = import_module("distributed").get_worker().address
    cores = import_module("dask.system").CPU_COUNT
    threads = max(1, cores // workers_of_host.get(host_of(address), 1))
    if drjit.thread_count() != threads:
        drjit.set_thread_count(threads)


def host_of(address: str) -> str:
    """Host in an address such as ``tcp://10.0.0.1:8786`` or ``tls://[::1]:8786``."""
    return address.partition("://")[2].rpartition(":")[0]


def _scene(source: SceneSource) -> LoadedScene:
    if source.fingerprint not in _loaded:
        _check(source)
        _loaded.clear()
        with warnings.catch_warnings():
            # The program that asks for the sweep has said them.
            warnings.simplefilter("ignore", IriftraceWarning)
            _loaded[source.fingerprint] = load_scene(
                source.path, source.variables, variant=source.variant, engine=source.engine
            )
    return _loaded[source.fingerprint]


def _check(source: SceneSource) -> None:
    where = f"A worker on {socket.gethostname()}"
    if version("iriftrace") != source.version:
        raise InputError(
            f"{where} runs iriftrace {version('iriftrace')} instead of {source.version}, so its "
            "poses could differ; install the same version there."
        )
    path = Path(source.path)
    if not path.is_file():
        raise InputError(
            f"{where} does not see the scene {path}: workers read its files themselves; make the "
            "folder available there under the same path."
        )
    seen = source_of(path, source.variables, source.variant, source.engine)
    if seen.fingerprint != source.fingerprint:
        raise InputError(
            f"{where} sees another scene, or other meshes or fields, under {path}; make the same "
            "folder available there."
        )
