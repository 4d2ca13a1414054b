"""Start a Dask cluster, or connect to a running cluster."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import dask
from distributed import Client, LocalCluster
from distributed.comm import get_address_host_port
from distributed.deploy import Cluster
from distributed.security import Security

from mdr_dask.errors import ClusterError
from mdr_dask.execute.events import Event, Tell
from mdr_dask.execute.resources import Resources
from mdr_dask.execute.window import TaskWindow
from mdr_dask.task import one_blas_thread

#: Address of the web page of a scheduler. Only programs on this machine can open this page.
DASHBOARD = "127.0.0.1:0"
#: Dask starts as many workers in an adaptive cluster as are needed to finish all waiting tasks in this time, up
#: to the maximum in the cluster file.
TARGET_DURATION = "1s"
#: Loggers whose messages explain why workers cannot be started. Messages of the run quote the newest message of these
#: loggers.
STARTING = ("distributed.deploy", "dask_jobqueue", "tornado")
#: Loggers whose messages are discarded, because they repeat errors that the run reports.
ECHOES = ("distributed", "asyncio")
#: Settings of a cluster on this machine. If a worker dies, Dask reports the block of this worker to the run and does
#: not try the block again. The supervising process (the nanny) restarts the worker. Profiling would take 4 % of a core
#: for each worker.
ON_THIS_MACHINE = {
    "distributed.deploy.lost-worker-timeout": "1 day",
    "distributed.scheduler.allowed-failures": 0,
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500 ms",
}


class _LastMessage(logging.Handler):
    """A handler that keeps the last error message of a library as one line of text."""

    text = ""

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        text = f"{type(error).__name__}: {error}" if error else record.getMessage()
        self.text = " ".join(text.split())


@contextmanager
def task_window(resources: Resources, tell: Tell) -> Iterator[TaskWindow]:
    """Start a cluster, connect to a running cluster or use the given client, and yield a task window on the workers."""
    message = _LastMessage(logging.ERROR)
    with ExitStack() as stack:
        for names, handler in ((ECHOES, logging.NullHandler()), (STARTING, message)):
            for logger in _loggers(names):
                stack.enter_context(_redirected(logger, handler))
        # the workers may be threads of this process
        stack.enter_context(one_blas_thread())
        most: int = 0
        replace_lost: Callable[[], None] | None = None
        if resources.client is not None:
            client = resources.client
        elif resources.scheduler is not None:
            tell(Event("connecting", {"scheduler": resources.scheduler}))
            client = stack.enter_context(_connected(resources.scheduler))
        else:
            _require_guard()
            assert resources.cluster is not None
            plan = resources.cluster
            tell(Event("starting", {"cluster": plan["class"]}, f"starting {plan['class']}"))
            is_local = issubclass(cluster_class(plan["class"]), LocalCluster)
            stack.enter_context(dask.config.set(ON_THIS_MACHINE if is_local else {}))
            cluster = stack.enter_context(_started(plan))
            if "scale" in plan and not is_local:  # Dask does not replace batch jobs that have reached their time limit
                replace_lost = partial(cluster.scale, **plan["scale"])
            client, most = stack.enter_context(Client(cluster, set_as_default=False)), _most(plan)
        timeout = resources.case_timeout
        yield TaskWindow(client, tell, resources.patience, most, replace_lost, lambda: message.text, timeout)


def _require_guard() -> None:
    """Raise ClusterError if the script, which worker processes import, lacks ``if __name__ == "__main__"``."""
    main = sys.modules.get("__main__")
    source = getattr(main, "__file__", None)
    frame = sys._getframe()
    while frame.f_back is not None:
        frame = frame.f_back
        is_script = frame.f_code.co_name == "<module>" and main is not None and frame.f_globals is vars(main)
        text = Path(source).read_text("utf-8", "replace") if is_script and source and Path(source).is_file() else None
        if text is not None and "__main__" not in text:
            remedy = "put what it does below 'if __name__ == \"__main__\":', or compute in threads"
            raise ClusterError(f"{source}: worker processes import this script: {remedy}")


def _loggers(names: tuple[str, ...]) -> list[logging.Logger]:
    """Return the named loggers and all loggers below the named loggers. Dask adds handlers to all these loggers."""
    below = [known for known in logging.root.manager.loggerDict for name in names if known.startswith(f"{name}.")]
    return [logging.getLogger(name) for name in (*names, *below)]


@contextmanager
def _redirected(logger: logging.Logger, handler: logging.Handler) -> Iterator[None]:
    before = logger.handlers[:], logger.propagate, logger.level
    logger.handlers, logger.propagate = [handler], False
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.handlers, logger.propagate = before[:2]
        logger.setLevel(before[2])


def _connected(address: str) -> Client:
    try:
        get_address_host_port(address)
        return Client(address, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler answers at {address!r}: {str(error) or type(error).__name__}") from None


@contextmanager
def _started(plan: Mapping[str, Any]) -> Iterator[Cluster]:
    kind = cluster_class(plan["class"])
    with ExitStack() as stack:
        try:
            cluster = kind(**_closed_to_others(kind, plan.get("arguments", {}), stack))
            if "scale" in plan:
                cluster.scale(**plan["scale"])
            if "adapt" in plan:
                cluster.adapt(**{"target_duration": TARGET_DURATION, **plan["adapt"]})
        except (ImportError, AttributeError, TypeError, ValueError, OSError, RuntimeError) as error:
            raise ClusterError(f"cannot start {plan['class']!r}: {type(error).__name__}: {error}") from None
        try:
            yield cluster
        finally:
            with suppress(AssertionError, OSError, RuntimeError, TimeoutError):  # raised if no worker was started
                cluster.close()


def cluster_class(name: str) -> type[Cluster]:
    """Import the class of a Dask cluster by its dotted name; raise ClusterError if there is no such class."""
    package, _, attribute = name.rpartition(".")
    try:
        found = getattr(import_module(package), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise ClusterError(f"cannot start {name!r}: {type(error).__name__}: {error}") from None
    if not (isinstance(found, type) and issubclass(found, Cluster)):
        raise ClusterError(f"cannot start {name!r}: expected a class of Dask clusters, got {type(found).__name__}")
    return found


def _closed_to_others(kind: type[Cluster], arguments: Mapping[str, Any], stack: ExitStack) -> dict[str, Any]:
    """Add arguments that protect a cluster from other users: TLS, and a web page that only this machine can open.

    Only clusters on this machine and clusters of batch jobs get these arguments. Arguments in the cluster file take
    precedence; ``security: false`` turns TLS off.
    """
    own = dict(arguments)
    if issubclass(kind, LocalCluster):
        own["dashboard_address"] = own.get("dashboard_address") or DASHBOARD
    elif hasattr(kind, "job_cls"):  # only clusters of batch jobs have this attribute
        own["scheduler_options"] = {"dashboard_address": DASHBOARD, **own.get("scheduler_options", {})}
    else:
        return own
    if own.setdefault("security", True) is True:
        own["security"] = Security.temporary()
        if hasattr(kind, "job_cls"):
            folder = TemporaryDirectory(prefix=".mdr-dask-keys-", dir=".", ignore_cleanup_errors=True)
            own["security"] = _in_files(own["security"], Path(stack.enter_context(folder)).absolute())
    if own["security"] is False:
        del own["security"]
    return own


def _in_files(keys: Security, folder: Path) -> Security:
    """Write TLS keys to files in a folder that only this user and the batch jobs of this user can read."""
    names = [f"tls_{role}_{part}" for role in ("client", "scheduler", "worker") for part in ("cert", "key")]
    for name in ("tls_ca_file", *names):
        (folder / name).write_text(getattr(keys, name))
    return Security(require_encryption=True, **{name: str(folder / name) for name in ("tls_ca_file", *names)})


def _most(plan: Mapping[str, Any]) -> int:
    """Return the largest number of threads of an adaptive cluster; 0 without a maximum and for other clusters."""
    arguments = plan.get("arguments", {})
    adapt = plan.get("adapt", {})
    each = arguments.get("cores", 1) if "maximum_jobs" in adapt else arguments.get("threads_per_worker", 1)
    return int(max(adapt.get("maximum_jobs", 0), adapt.get("maximum", 0)) * each)
