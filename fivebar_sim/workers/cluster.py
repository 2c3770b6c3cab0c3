"""Workers on a Ray cluster that is there already; a lost node's tasks are done again by others.

Every node needs the same versions of this package, of MuJoCo and NumPy, and of a user's own
controllers; a processor of one kind gives the same bits.
"""

from __future__ import annotations

import importlib.util
import logging
import os
import re
import socket
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, NamedTuple

from fivebar_sim.errors import ConfigError, WorkersError
from fivebar_sim.workers.here import Answer, Task

PATIENCE = 3.0
"""Time in which somebody must answer at the address [s]; Ray itself would try for minutes."""

SETTINGS = 4
"""Type of the frame with which every side of HTTP/2 begins."""

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, SETTINGS, 0, 0, 0, 0, 0])
"""What a client of HTTP/2 says first."""

AHEAD = 2
"""Tasks a processor that are handed out at one time, so that none waits for its next one."""

TRIES = 5
"""How often a task is handed out before it is given up: one that ends its node would end them
all."""

FEWEST = 8
"""Tasks that are handed out at one time at least: nodes may come while it goes on."""

PACKAGES = ("fivebar-sim", "mujoco", "numpy")
"""What must be of the same version on every node."""


class Cluster:
    """What is asked of a cluster; `Ray` is the real one.

    Attributes:
        lost: The errors of a task whose node is gone.
    """

    lost: tuple[type[Exception], ...] = ()

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Any:
        """Hand out a task; return a handle of it."""
        raise NotImplementedError

    def ready(self, handles: list[Any]) -> list[Any]:
        """Wait until at least one task has ended, and return those that have."""
        raise NotImplementedError

    def result(self, handle: Any) -> Any:
        """Return what came of a task that has ended, or raise its error."""
        raise NotImplementedError

    def processors(self) -> int:
        """Return how many tasks are done at one time now."""
        raise NotImplementedError


class Sent(NamedTuple):
    """A task that was handed out."""

    number: int
    argument: Any


class Done(NamedTuple):
    """What a node sends back: versions of what its numbers depend on, and the result."""

    versions: dict[str, str]
    result: Any


def done(work: tuple[Callable[[Any], Any], Any]) -> Done:
    """Do a task on a node."""
    function, argument = work
    return Done(versions(), function(argument))


def versions() -> dict[str, str]:
    """Return the versions of what numbers depend on."""
    return {name: version(name) for name in PACKAGES}


class RayCluster:
    """A Ray cluster.

    Args:
        address: HOST:PORT of the cluster, as `ray start` prints it, or ray://HOST:PORT.

    Raises:
        ConfigError: It is no such address, or Ray is not installed.
        WorkersError: Nobody answers there.
    """

    def __init__(self, address: str) -> None:
        check_address(address)
        self.address = address

    def results(self, function: Callable[[Any], Any], tasks: Iterable[Task]) -> Iterator[Answer]:
        """Yield the result of every task; see `Workers`.

        Raises:
            WorkersError: The cluster is gone, has other versions, or loses a task again and again.
        """
        # Ray sends a script's own function along; the nodes import those of modules.
        with _connected(self.address) as cluster:
            yield from drained(cluster, function, iter(tasks))

    @contextmanager
    def connected(self) -> Iterator[RayCluster]:
        """Stay connected within: for `results` again and again, which each connect for themselves.

        Raises:
            WorkersError: The cluster refuses the connection.
        """
        with _connected(self.address):
            yield self


def check_address(address: str) -> None:
    """Raise unless somebody answers at an address as a cluster does, and Ray is installed.

    Raises:
        ConfigError: It is no address, or Ray is not installed.
        WorkersError: Nobody answers there, or something else than a cluster.
    """
    found = re.fullmatch(r"(?:ray://)?(\[[0-9A-Fa-f:.]+\]|[^\s:/]+):(\d{1,5})", address)
    if found is None or not 0 < int(found[2]) < 65536:
        raise ConfigError(f"--ray takes HOST:PORT of a Ray cluster, got {address!r}")
    if importlib.util.find_spec("ray") is None:
        raise ConfigError("--ray needs Ray: pip install 'fivebar-sim[ray]'")
    try:
        _ask(found[1].strip("[]"), int(found[2]))
    except OSError as error:
        why = error.strerror or str(error) or "no answer"
        raise WorkersError(f"no Ray cluster answers at {address}: {why}") from None


def _ask(host: str, port: int) -> None:
    """Raise OSError unless a server of HTTP/2, which gRPC is built on, answers."""
    with socket.create_connection((host, port), PATIENCE) as connection:
        # A cluster with certificates says nothing to those who come without.
        if os.environ.get("RAY_USE_TLS", "0") not in ("", "0"):
            return
        connection.settimeout(PATIENCE)
        connection.sendall(PREFACE)
        said = connection.recv(9)
        if len(said) < 4 or said[3] != SETTINGS:
            raise OSError("what answers is no Ray cluster")


def drained(
    cluster: Cluster, function: Callable[[Any], Any], tasks: Iterator[Task]
) -> Iterator[Answer]:
    """Yield the results of tasks, of which only a few are handed out at one time.

    Args:
        cluster: Does them.
        function: Does a task.
        tasks: The tasks.

    Raises:
        WorkersError: A task is lost too often, or a node has other versions.
    """
    pending: dict[Any, Sent] = {}
    tries: Counter[int] = Counter()

    def hand_out(sent: Sent) -> None:
        tries[sent.number] += 1
        pending[cluster.submit(done, (function, sent.argument))] = sent

    while True:
        most = max(FEWEST, AHEAD * cluster.processors())
        while len(pending) < most and (task := next(tasks, None)) is not None:
            hand_out(Sent(*task))
        if not pending:
            return

        for handle in cluster.ready(list(pending)):
            sent = pending.pop(handle)
            try:
                found = cluster.result(handle)
            except cluster.lost as error:
                if tries[sent.number] >= TRIES:
                    raise WorkersError(
                        f"the cluster lost task {sent.number} {TRIES} times, the last time by "
                        f"{type(error).__name__}; what is done is kept"
                    ) from None
                hand_out(sent)
                continue
            _check_versions(found)
            del tries[sent.number]
            yield sent.number, found.result


def _check_versions(found: Done) -> None:
    """Raise unless a node has the versions of this process."""
    ours = versions()
    for name, there in found.versions.items():
        if there != ours[name]:
            raise WorkersError(
                f"the cluster has {name} {there}, here is {ours[name]}: numbers could differ"
            )


class Ray(Cluster):
    """A cluster that `ray.init` is connected to."""

    def __init__(self, ray: Any) -> None:
        self._ray = ray
        errors = ray.exceptions
        self.lost = (
            errors.WorkerCrashedError,
            errors.NodeDiedError,
            errors.ObjectLostError,
            errors.OutOfMemoryError,
            errors.LocalRayletDiedError,
        )
        # Handed out again here, so that a task that ends its node does not end one after the other.
        self._remote: Any = ray.remote(num_cpus=1, max_retries=0)(done)

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Any:
        """Hand out a task; see `Cluster`."""
        assert function is done
        return self._remote.remote(argument)

    def ready(self, handles: list[Any]) -> list[Any]:
        """Return what has ended; see `Cluster`."""
        return self._ray.wait(handles, num_returns=1)[0]

    def result(self, handle: Any) -> Any:
        """Return what came of a task; see `Cluster`."""
        try:
            return self._ray.get(handle)
        except self._ray.exceptions.RayTaskError as error:
            # Ray wraps an error of the task's own, whose message is a traceback.
            cause = error.cause
            raise cause if isinstance(cause, Exception) else error from None

    def processors(self) -> int:
        """Return how many tasks are done at one time; see `Cluster`."""
        return int(self._ray.cluster_resources().get("CPU", 1))


@contextmanager
def _connected(address: str) -> Iterator[Cluster]:
    """Connect to a cluster within.

    Raises:
        WorkersError: It is none, or refuses the connection.
    """
    # Ray tells its makers how it is used unless this is set before it is imported.
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    # Ray's own wish for the same as what it does from its next version on; without, it warns.
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    import ray

    # A script may be connected already, and goes on with it afterwards.
    ours = not ray.is_initialized()
    if ours:
        try:
            ray.init(
                address=address,
                log_to_driver=False,
                configure_logging=False,
                logging_level=logging.ERROR,
            )
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            line = " ".join(str(error).split())
            raise WorkersError(f"no Ray cluster at {address}: {line}") from None
    try:
        with _silent(ray):
            yield Ray(ray)
    finally:
        if ours:
            ray.shutdown()


@contextmanager
def _silent(ray: Any) -> Iterator[None]:
    """Keep Ray from printing the log of a lost node to stdout, where a command's results go."""
    worker = ray._private.worker
    name = "print_to_stdstream"
    # It has no switch for this; should a version have no such function, it prints.
    printer = getattr(worker, name, None)
    if printer is None:
        yield
        return
    setattr(worker, name, lambda *_data, **_options: None)
    try:
        yield
    finally:
        setattr(worker, name, printer)
