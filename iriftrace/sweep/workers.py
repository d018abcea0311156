"""Workers for long work: processes of this machine, or of a Dask scheduler on several."""

from __future__ import annotations

import logging
import re
import socket
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from iriftrace.core.errors import InputError, IriftraceError, SetupError, without_warnings
from iriftrace.core.runtime import variant as runtime
from iriftrace.sweep.journal import Piece
from iriftrace.sweep.options import LOCAL
from iriftrace.sweep.pose import PoseTask, SceneSource, render_pose, source_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene

if TYPE_CHECKING:
    from iriftrace.sweep.series import RenderPoses

Task = TypeVar("Task")
Result = TypeVar("Result")
Result_co = TypeVar("Result_co", covariant=True)


class Future(Protocol[Result_co]):
    """A future result of a worker of Dask."""

    def result(self) -> Result_co: ...


class Client(Protocol):
    """The methods of a client of Dask distributed that are used, which has no types of its own."""

    loop: object

    def submit(
        self, work: Callable[..., Result], *arguments: object, pure: bool
    ) -> Future[Result]: ...

    def cancel(self, futures: Sequence[Future[object]]) -> None: ...

    def nthreads(self) -> Mapping[str, int]: ...


_SECONDS_TO_ANSWER = 5
_SECONDS_FOR_A_WORKER = 10
_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://\S+:\d+")

# One task is being rendered, the next one waits at the worker, so that it never idles. More would
# only make results wait in the workers' memory.
_TASKS_PER_WORKER = 2

# Ctrl-C reaches all processes of a terminal; the one that started the workers ends them.
_IGNORE_INTERRUPTS = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"

# A worker with several threads would get several poses at once, but Dr.Jit's arrays,
# the variant and the scene are those of the process. A pose uses several cores anyway.
_one_at_a_time = threading.Lock()

# Only the last scene: tasks come scene by scene, and a scene can need gigabytes.
_loaded: dict[str, Scene] = {}


def check_scheduler(scheduler: str | None, count: int | None = None) -> None:
    """Refuse a scheduler that is neither ``"local"`` nor an address before starting the work.

    Also raises InputError if `count` workers are requested that it cannot start; SetupError if Dask
    distributed is not installed.
    """
    if scheduler is None:
        return
    if scheduler != LOCAL and not _ADDRESS.fullmatch(scheduler):
        raise InputError(
            f"The scheduler {scheduler!r} is not an address; give local, or what `dask scheduler` "
            "prints, such as tcp://192.168.0.1:8786.",
            code="scheduler.no_address",
            argument="scheduler",
        )
    if count is not None and scheduler != LOCAL:
        raise InputError(
            f"{count} workers cannot be started at {scheduler}, because a scheduler's workers are "
            f"started by hand, with `dask worker {scheduler}` (one thread each).",
            code="workers.at_scheduler",
            argument="workers",
        )
    if count is not None and count < 1:
        raise InputError(
            f"{count} workers do nothing; start at least 1.",
            code="workers.below_one",
            argument="workers",
        )
    if find_spec("distributed") is None:
        raise SetupError(
            "Workers need Dask distributed, which is not installed; in the clone: "
            "pip install -e '.[sweep]', or sweep without them.",
            code="workers.no_dask",
            argument="scheduler",
        )


@contextmanager
def pose_workers(scheduler: str, count: int | None = None) -> Iterator[RenderPoses]:
    """Workers that render poses, as long as the block lasts.

    Each worker loads the scene's files itself and keeps the scene, so workers on other machines
    must see them under the same path. The results are those of this process but for rounding, a
    relative 1e-11. When a worker dies, its poses are rendered again by another one.

    Parameters
    ----------
    scheduler : str
        ``"local"`` starts processes on this machine and ends them with the block; an address is
        that of a running Dask scheduler.
    count : int, optional
        Number of local workers; by default one for every two cores, at least two.

    Raises
    ------
    InputError
        If the scheduler does not answer or has no workers, or as `check_scheduler`.
    SetupError
        If Dask distributed is not installed.
    """
    with scheduler_client(scheduler, count) as client:
        # Workers come and go, so they are counted as each task is sent.
        yield lambda tasks: run_tasks(
            client, render_on_worker, ((task, list(client.nthreads())) for task in tasks)
        )


@contextmanager
def scheduler_client(scheduler: str, count: int | None = None) -> Iterator[Client]:
    """Dask client of the workers as long as the block lasts; parameters and errors as above."""
    check_scheduler(scheduler, count)
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        yield stack.enter_context(_local(count) if scheduler == LOCAL else _connected(scheduler))


def run_tasks(
    client: Client, work: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[Result]:
    """Yield results of `work(task)` as they arrive; workers must be able to import `work`."""
    waiting = iter(tasks)
    running: set[Future[Result]] = set()
    completed = import_module("distributed").as_completed(loop=client.loop)

    def fill() -> None:
        most = max(1, _TASKS_PER_WORKER * len(client.nthreads()))
        for task in islice(waiting, max(0, most - len(running))):
            future = client.submit(work, task, pure=False)
            running.add(future)
            completed.add(future)

    try:
        fill()
        for future in completed:
            running.discard(future)
            result = _result(future)
            fill()
            yield result
    finally:
        client.cancel(list(running))


@contextmanager
def _local(count: int | None) -> Iterator[Client]:
    distributed = import_module("distributed")
    cores = import_module("dask.system").CPU_COUNT
    with (
        distributed.LocalCluster(
            n_workers=count or max(2, cores // 2),
            threads_per_worker=1,
            processes=True,
            # The dashboard is not used, and its usual port may be taken.
            dashboard_address="127.0.0.1:0",
            # Dask's limit, an equal part of the memory, would kill workers with large scenes.
            memory_limit=0,
            preload=_IGNORE_INTERRUPTS,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    distributed = import_module("distributed")
    try:
        client = distributed.Client(address, timeout=_SECONDS_TO_ANSWER, set_as_default=False)
    except OSError as error:
        raise InputError(
            f"No scheduler answers at {address}; start one with `dask scheduler`, or check address "
            "and firewall.",
            code="scheduler.no_answer",
            argument="scheduler",
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_SECONDS_FOR_A_WORKER)
        except TimeoutError as error:
            raise InputError(
                f"The scheduler at {address} has no workers; start some with `dask worker "
                f"{address}` (one thread each).",
                code="scheduler.no_workers",
            ) from error
        yield client


@contextmanager
def _quiet() -> Iterator[None]:
    """Hide Dask's messages about lost connections from the user; the results show them."""
    import_module("distributed")  # which gives each of its loggers a level
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _result(future: Future[Result]) -> Result:
    """The result, or an error that a user understands."""
    distributed = import_module("distributed")
    try:
        result: Result = future.result()
    except distributed.KilledWorker as error:
        raise SetupError(
            f"{error.allowed_failures + 1} workers died of the same task, the last one at "
            f"{error.last_worker.address}; they may have run out of memory: start fewer. The same "
            "command continues where it stopped.",
            code="workers.died",
        ) from error
    except distributed.CancelledError as error:
        raise SetupError(
            "The scheduler is gone; start it again. The same command continues where it stopped.",
            code="scheduler.gone",
        ) from error
    except IriftraceError:
        raise
    except ImportError as error:
        raise SetupError(
            f"A worker cannot run iriftrace ({error}); install the same version there, with the "
            "extra sweep.",
            code="workers.no_iriftrace",
        ) from error
    return result


def render_on_worker(sent: tuple[PoseTask, Sequence[str]]) -> Piece:
    """Render one pose in this worker, one of those with the addresses that come with the task."""
    task, addresses = sent
    assert task.source is not None
    with _one_at_a_time:
        _limit_cores(task.source.variant, addresses)
        return render_pose(task, _scene(task.source))


def _limit_cores(variant: str, addresses: Sequence[str]) -> None:
    """Let Dr.Jit use this worker's part of the cores.

    By default each process uses all of them: n workers would run n times as many threads as there
    are cores, which wait for each other. The result does not depend on it.
    """
    runtime.ensure(variant)
    drjit = import_module("drjit")
    host = host_of(import_module("distributed").get_worker().address)
    cores = import_module("dask.system").CPU_COUNT
    sharing = [host_of(each) for each in addresses].count(host)
    threads = max(1, cores // max(1, sharing))
    if drjit.thread_count() != threads:
        drjit.set_thread_count(threads)


def host_of(address: str) -> str:
    """Host in an address such as ``tcp://10.0.0.1:8786`` or ``tls://[::1]:8786``."""
    return address.partition("://")[2].rpartition(":")[0]


def _scene(source: SceneSource) -> Scene:
    if source.fingerprint not in _loaded:
        _check(source)
        _loaded.clear()
        with without_warnings():
            # The program that requested the sweep has issued these warnings.
            _loaded[source.fingerprint] = load_scene(
                source.path, source.variables, variant=source.variant, engine=source.engine
            )
    return _loaded[source.fingerprint]


def _check(source: SceneSource) -> None:
    where = f"A worker on {socket.gethostname()}"
    if version("iriftrace") != source.version:
        raise InputError(
            f"{where} runs iriftrace {version('iriftrace')} instead of {source.version}, so its "
            "poses could differ; install the same version there.",
            code="workers.other_version",
        )
    path = Path(source.path)
    if not path.is_file():
        raise InputError(
            f"{where} does not see the scene {path}: workers read its files themselves; make the "
            "folder available there under the same path.",
            code="workers.no_scene",
        )
    seen = source_of(path, source.variables, source.variant, source.engine)
    if seen.fingerprint != source.fingerprint:
        raise InputError(
            f"{where} sees another scene, or other meshes or fields, under {path}; make the same "
            "folder available there.",
            code="workers.other_scene",
        )
