"""Workers on a cluster: lost tasks are done again, other versions refused, nobody waited for."""

from __future__ import annotations

import operator
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from shell import JUDGED, Shell

from fivebar_sim.errors import ConfigError, WorkersError
from fivebar_sim.workers import cluster
from fivebar_sim.workers.cluster import Cluster, Done, RayCluster, check_address, drained

WITH_RAY = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")
HEAD = "127.0.0.2"
NODE = "127.0.0.3"
"""Addresses of the loopback. Ray takes 127.0.0.1 for the machine's address in its network."""


class GoneError(Exception):
    """The node of a task is gone."""


class Fake(Cluster):
    """A cluster whose nodes are lost, and which does tasks in any order."""

    lost = (GoneError,)

    def __init__(self, losses: Callable[[int], bool]) -> None:
        self.losses = losses
        self.submitted: list[Any] = []
        self.most = 0

    def submit(self, function: Callable[[Any], Any], argument: Any) -> Any:
        """Hand out a task."""
        self.submitted.append((function, argument))
        return len(self.submitted) - 1

    def ready(self, handles: list[Any]) -> list[Any]:
        """Return some tasks."""
        self.most = max(self.most, len(handles))
        return random.Random(len(self.submitted)).sample(handles, min(2, len(handles)))

    def result(self, handle: Any) -> Any:
        """Return what came of a task."""
        if self.losses(handle):
            raise GoneError
        function, argument = self.submitted[handle]
        return function(argument)

    def processors(self) -> int:
        """Return 5."""
        return 5


def test_lost_tasks_are_done_again_and_all_are_there_once() -> None:
    fake = Fake(lambda handle: handle % 3 == 0)
    found = list(drained(fake, operator.neg, ((k, k + 1) for k in range(40))))
    assert sorted(found) == [(k, -(k + 1)) for k in range(40)]
    assert len(fake.submitted) > 50
    assert fake.most == 10


def test_task_that_ends_every_node_is_given_up() -> None:
    fake = Fake(lambda handle: True)
    with pytest.raises(WorkersError, match="lost task 7 5 times, the last time by GoneError"):
        list(drained(fake, operator.neg, iter([(7, 1)])))
    assert len(fake.submitted) == 5


def test_error_of_a_task_is_the_callers() -> None:
    with pytest.raises(TypeError, match="bad operand"):
        list(drained(Fake(lambda handle: False), operator.neg, iter([(0, "text")])))


def test_node_of_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = Fake(lambda handle: False)
    old = {**cluster.versions(), "mujoco": "3.0.0"}
    monkeypatch.setattr(cluster, "done", lambda work: Done(old, work[0](work[1])))
    with pytest.raises(WorkersError, match=r"the cluster has mujoco 3\.0\.0, here is"):
        list(drained(fake, operator.neg, iter([(0, 1)])))


@contextmanager
def server(answer: bytes) -> Iterator[int]:
    """Listen on a port, and say something to whoever comes."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            connection = listening.accept()[0]
            with connection:
                connection.recv(100)
                connection.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield listening.getsockname()[1]
        thread.join(10)


@WITH_RAY
def test_address_is_asked_before_ray_is(shell: Shell) -> None:
    for odd in ("cluster", "h:0", "h:99999", "http://h:1", "h:1/x", ""):
        with pytest.raises(ConfigError, match="--ray takes HOST:PORT of a Ray cluster, got"):
            check_address(odd)
    with server(b"HTTP/1.1 400 Bad Request\r\n") as port:
        with pytest.raises(WorkersError, match=r"no Ray cluster answers at .*: what answers is no"):
            RayCluster(f"127.0.0.1:{port}")
    with server(bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])) as port:
        check_address(f"ray://127.0.0.1:{port}")

    with socket.create_server(("127.0.0.1", 0)) as listening:
        free = listening.getsockname()[1]
    vary = ("--vary", "leg.L2=0.05,0.06", "--ray", f"127.0.0.1:{free}")
    line = shell.refused("sweep", "short.toml", "--out", "o", *vary)
    assert line == f"no Ray cluster answers at 127.0.0.1:{free}: Connection refused"
    both = shell.refused("sweep", "short.toml", "--out", "o", *vary, "--processes", "2")
    assert "--processes are this machine's: leave it out beside --ray" in both


def test_somebody_who_says_nothing_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 0.1)
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: name)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        with pytest.raises(WorkersError, match="timed out"):
            check_address(f"127.0.0.1:{listening.getsockname()[1]}")


def test_ray_is_asked_for_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"--ray needs Ray: pip install 'fivebar-sim\[ray\]'"):
        check_address("127.0.0.1:1")


def raylet(address: str) -> int:
    """Return the process that is a node of the cluster."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_text("utf-8").split("\0")
        except OSError:
            continue
        if words[0].endswith("/raylet") and f"--node_ip_address={address}" in words:
            return int(process.name)
    raise AssertionError(f"there is no node at {address}")


@contextmanager
def node(folder: Path, ready: Callable[[], bool], *args: str) -> Iterator[None]:
    """Start a node of a cluster on the loopback, wait until it is ready, and end it afterwards."""
    command = [str(Path(sys.executable).with_name("ray")), "start", *args, "--block"]
    command += ["--num-cpus=1", "--object-store-memory=80000000", "--disable-usage-stats"]
    with (folder / "node.log").open("ab") as out:

        def start() -> subprocess.Popen[bytes]:
            return subprocess.Popen(command, stdout=out, stderr=out, start_new_session=True)

        run = start()
        try:
            while not ready():
                # On a busy machine Ray gives up after 30 s; the test's own time limit ends it.
                if run.poll() is not None:
                    run = start()
                time.sleep(0.2)
            yield
        finally:
            run.terminate()
            run.wait(60)


def wait_for(what: Callable[[], bool]) -> None:
    for _ in range(2400):
        if what():
            return
        time.sleep(0.1)
    raise AssertionError("it takes too long")


def answers(address: str) -> bool:
    try:
        check_address(address)
    except WorkersError:
        return False
    return True


NODES = """
import logging, ray, sys
ray.init(address=sys.argv[1], log_to_driver=False, logging_level=logging.ERROR)
print("nodes:", int(ray.cluster_resources().get("CPU", 0)))
"""


def nodes(address: str) -> int:
    """Return how many nodes of one processor a cluster has."""
    run = subprocess.run([sys.executable, "-c", NODES, address], capture_output=True, text=True)
    # Ray may print the log of a lost node as well.
    found = re.search(r"^nodes: (\d+)$", run.stdout, re.MULTILINE)
    return int(found[1]) if found else 0


@contextmanager
def two_nodes(folder: Path) -> Iterator[str]:
    """Start a cluster of two nodes of one processor, and yield its address."""
    with socket.create_server((HEAD, 0)) as listening:
        port = listening.getsockname()[1]
    address = f"{HEAD}:{port}"
    with ExitStack() as stack:
        head = ("--head", f"--node-ip-address={HEAD}", f"--port={port}")
        # Its sockets are in there, and their names may have 107 bytes.
        short = stack.enter_context(tempfile.TemporaryDirectory(prefix="ray"))
        more = ("--include-dashboard=false", f"--temp-dir={short}")
        up = lambda: answers(address) and nodes(address) == 1  # noqa: E731
        stack.enter_context(node(folder, up, *head, *more))
        second = (f"--address={address}", f"--node-ip-address={NODE}")
        stack.enter_context(node(folder, lambda: nodes(address) == 2, *second))
        yield address


@pytest.mark.long
@WITH_RAY
@pytest.mark.skipif(sys.platform != "linux", reason="looks in /proc for the node")
def test_cluster_that_loses_a_node_gives_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    (tmp_path / "short.toml").write_text(JUDGED, encoding="utf-8")
    command = [sys.executable, "-m", "fivebar_sim", "sweep", "short.toml", "--out"]
    vary = ["--vary", "leg.L2=0.05:0.07:400"]

    with two_nodes(tmp_path) as address:
        run = subprocess.Popen([*command, "there", *vary, "--ray", address], stdout=subprocess.PIPE)
        blocks = tmp_path / "there" / "blocks"
        wait_for(lambda: blocks.is_dir() and len(list(blocks.glob("0*"))) >= 4)
        os.kill(raylet(NODE), signal.SIGKILL)
        assert len(list(blocks.glob("0*"))) < 25
        out = run.communicate()[0].decode()

    assert run.returncode == 0
    assert "400 runs in there/runs.parquet" in out
    # One line: Ray prints the log of a lost node to stdout by itself.
    assert len(out.splitlines()) == 1
    subprocess.run([*command, "here", *vary], check=True, capture_output=True)
    there, here = (tmp_path / name / "runs.parquet" for name in ("there", "here"))
    assert there.read_bytes() == here.read_bytes()


TRAINING = """
import runpy, sys
from fivebar_sim.workers.cluster import RayCluster
script = runpy.run_path(sys.argv[1])
def generations(workers):
    for each in script["train"](20, 0, duration=0.2, workers=workers):
        print(*each[:4], *each.mean, flush=True)
if sys.argv[2:]:
    with RayCluster(sys.argv[2]).connected() as cluster:
        generations(cluster)
else:
    generations(None)
"""


@pytest.mark.long
@WITH_RAY
@pytest.mark.skipif(sys.platform != "linux", reason="looks in /proc for the node")
def test_training_on_a_cluster_that_loses_a_node_gives_the_same_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the script: its own functions go to the nodes along with their tasks."""
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    script = Path(__file__).parents[1] / "scripts" / "train_hop.py"
    command = [sys.executable, "-c", TRAINING, str(script)]

    with two_nodes(tmp_path) as address:
        with subprocess.Popen([*command, address], stdout=subprocess.PIPE, text=True) as run:
            assert run.stdout is not None
            there = [run.stdout.readline()]
            os.kill(raylet(NODE), signal.SIGKILL)
            there += run.stdout.readlines()
        assert run.returncode == 0

    here = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert "".join(there) == here
    assert len(there) == 20
