"""Runs shown while they are simulated: what is sent is what was simulated, and stays so."""

from __future__ import annotations

import itertools
import re
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rerun as rr
from recorded import read
from shell import Shell

from fivebar_sim import rollout
from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import live, poses
from fivebar_sim.recording import viewer as recording_viewer
from fivebar_sim.recording.poses import Room
from fivebar_sim.recording.relay import Relay
from fivebar_sim.robots import LEGS
from fivebar_sim.runs import directory
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import feedback, steps
from fivebar_sim.walking.shown import live as live_robots
from fivebar_sim.walking.shown import recording

PD = "controller={name='pd', period=0.002}"
RUNS = {
    "setpoints": ("classic-ellipse", ["duration=0.9"]),
    # Every fourth period is sent by itself, so a short run is many messages.
    "feedback": ("classic-ellipse", ["duration=0.4", "path.ramp=0.1", "path.frequency=4", PD]),
    "ground": ("treadmill-trot", ["duration=0.9"]),
}


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep what would go to a viewer in a file."""
    file = tmp_path / "live.rrd"

    def keep(self: rr.RecordingStream, url: str) -> None:
        assert re.fullmatch(r"rerun\+http://127\.0\.0\.1:\d+/proxy", url)
        self.save(file)

    monkeypatch.setattr(rr.RecordingStream, "connect_grpc", keep)
    monkeypatch.setattr(steps, "WATCHED", 130)
    ticks = itertools.count(0.0, 0.05)  # [s]: a glance at every fourth period of the loop
    monkeypatch.setattr(feedback, "time", SimpleNamespace(monotonic=ticks.__next__))
    return file


@pytest.mark.parametrize("name", RUNS)
def test_what_is_sent_is_what_was_simulated(name: str, kept: Path) -> None:
    source, settings = RUNS[name]
    plan = rollout.plan(Scenario.load(source, settings))
    with live.streaming(plan, "127.0.0.1:9876") as watch:
        result = rollout.execute(plan, watch)
    alone = rollout.execute(plan)
    for column, values in result.record.items():
        np.testing.assert_array_equal(values, alone.record[column], err_msg=column)

    moving, static = read(kept)
    rows = np.array(moving["/hip/L1"]["step"]) - 1
    assert 50 <= len(rows) <= 80 or name == "feedback"  # 60 Hz, and the first of every part
    assert (np.diff(rows) > 0).all()
    assert rows[0] == 0
    np.testing.assert_array_equal(
        moving["/hip/L1"]["sim_time"], np.round(1e9 * result.record["time"][rows])
    )
    torque = np.array(moving["/torque"]["Scalars:scalars"])
    expected = np.stack([result.record["torque_A"], result.record["torque_E"]], axis=-1)
    np.testing.assert_array_equal(torque, 1e3 * expected[rows])
    error = np.hypot(
        result.record["foot_x"] - result.record["target_x"],
        result.record["foot_z"] - result.record["target_z"],
    )
    np.testing.assert_array_equal(
        np.ravel(moving["/tracking_error"]["Scalars:scalars"]), 1e3 * error[rows]
    )
    assert ("/floor" in static) == (name == "ground")


STAND = ["duration=0.1", "path.seconds=0.1", "path.ramp=0.05", "limits={}"]
ROBOTS = {
    "feedback": [
        "controller={name='pd', period=0.004}",
        'robot.hips.side_step={kp=4, kd=0.03, mass="20 g", across=0, along=0}',
    ],
    "held": ["scene='air'"],
}


@pytest.mark.parametrize("name", ROBOTS)
def test_what_is_sent_of_a_robot_is_what_was_simulated(
    name: str, kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each entity is what the recording of the finished run has at the same steps."""
    monkeypatch.setattr(steps, "WATCHED", 30)
    monkeypatch.setattr(poses, "POSE_PERIOD", 1e-3)
    plan = rollout.plan(Scenario.load("robot-q8bot-stand", [*STAND, *ROBOTS[name]]))
    assert isinstance(plan, rollout.RobotPlan)
    with live_robots.streaming(plan, "127.0.0.1:9876") as watch:
        result = rollout.execute(plan, watch)
    alone = rollout.execute(plan)
    for column, values in result.record.items():
        np.testing.assert_array_equal(values, alone.record[column], err_msg=column)

    recording.write(kept.with_name("after.rrd"), [result])
    moving, static = read(kept)
    after, still = read(kept.with_name("after.rrd"))
    assert moving.keys() == after.keys()
    # How long the arrows will be is not known before.
    lengths = {f"/ground_force/{leg}" for leg in LEGS}
    for entity in after.keys() - lengths:
        rows = np.array(moving[entity]["step"]) - 1
        assert rows[0] == 0
        assert len(rows) >= 6
        assert (np.diff(rows) > 0).all()
        for part, values in after[entity].items():
            assert moving[entity][part] == [values[row] for row in rows], (entity, part)
    # The text has no verdict, targets are those of all steps, and the floor reaches farther.
    properties = {entity for entity in still if entity.startswith("/__properties/")}
    assert static.keys() == still.keys() - properties


def test_floor_reaches_as_far_as_the_robot_goes() -> None:
    room = Room(np.array([-0.1, 0.0]), np.array([0.1, 0.05]), 0.1, 1.0, floor=True)
    assert live_robots._reaching(room, -0.1, 0.1) is room
    farther = live_robots._reaching(room, -0.05, 0.11)
    np.testing.assert_allclose([farther.low, farther.high], [[-0.1, 0.0], [0.51, 0.05]])
    back = live_robots._reaching(farther, -0.2, 0.3)
    np.testing.assert_allclose([back.low, back.high], [[-0.6, 0.0], [0.51, 0.05]])


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("9876", "--live-at takes HOST:PORT, as 127.0.0.1:9876, got '9876'"),
        ("localhost:0", "--live-at takes HOST:PORT"),
        ("localhost:http", "--live-at takes HOST:PORT"),
        ("192.0.2.1:9876", "--live-at must be on this machine, 127.0.0.1, localhost, ::1, got"),
    ],
)
def test_address_elsewhere_or_none_is_refused(address: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        live.check_address(address)
    assert str(caught.value).startswith(said)


def test_nobody_listening_is_one_line(shell: Shell) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    said = shell.refused("run", "short.toml", "--live-at", address)
    assert said.startswith(f"no Rerun viewer listens at {address}: ")


def test_no_screen_is_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    said = shell.refused("run", "short.toml", "--live")
    assert said.startswith("no screen here: neither DISPLAY nor WAYLAND_DISPLAY is set; --live-at")


def test_trouble_while_sending_reaches_the_caller(
    kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*args: object) -> None:
        raise OSError("no room")

    monkeypatch.setattr("fivebar_sim.recording.rrd.send_series", fail)
    plan = rollout.plan(Scenario.load("classic-ellipse", ["duration=0.9"]))
    with pytest.raises(OSError, match="no room"), live.streaming(plan, "127.0.0.1:9876") as watch:
        rollout.execute(plan, watch)


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.0 400 Bad request\r\n\r\n"])
def test_who_speaks_no_grpc_is_no_viewer(answer: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that says nothing would keep a run waiting for ever; one that errs would lose it."""
    monkeypatch.setattr(live, "ANSWER", 0.3)
    judged = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            connection = server.accept()[0]
            connection.sendall(answer)
            judged.wait()  # an end of the connection would be an answer, too
            connection.close()

        thread = threading.Thread(target=serve)
        thread.start()
        with pytest.raises(ConfigError, match=r"^no Rerun viewer listens at 127\.0\.0\.1:\d+: "):
            live.check_address(f"127.0.0.1:{server.getsockname()[1]}")
        judged.set()
        thread.join()


def wait_for(viewer: subprocess.Popen[bytes], address: str) -> None:
    """Wait until a viewer listens, however long it takes to start."""
    while True:
        try:
            live.check_address(address)
            return
        except ConfigError:
            assert viewer.poll() is None
            time.sleep(0.1)


def test_viewer_that_is_closed_does_not_harm_the_run(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    command = [str(recording_viewer.binary()), "--serve-grpc", "--bind", "127.0.0.1", "--port"]
    viewer = subprocess.Popen(
        [*command, address.split(":")[1]],
        env=recording_viewer.quiet_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for(viewer, address)
        plan = rollout.plan(Scenario.load("classic-ellipse", ["duration=0.9"]))
        with live.streaming(plan, address) as watch:
            viewer.kill()
            viewer.wait()
            result = rollout.execute(plan, watch)
    finally:
        viewer.kill()
        viewer.wait()
    assert result.write(tmp_path / "run").is_dir()


@pytest.fixture
def stalled(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Give the address of a viewer that greets and then takes nothing."""
    monkeypatch.setattr(live, "STALLED", 0.2)
    kept: list[socket.socket] = []

    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    kept.append(server.accept()[0])
                except OSError:
                    return
                kept[-1].sendall(live.SETTINGS)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
        thread.join()
    for each in kept:
        each.close()


@pytest.mark.parametrize("settings", [["short.toml"], ["robot-q8bot-stand", *STAND]])
def test_stalled_viewer_does_not_keep_the_run(
    settings: list[str], shell: Shell, stalled: str
) -> None:
    source, *changes = settings
    told = [word for change in changes for word in ("--set", change)]
    assert shell("run", source, *told, "--live-at", stalled, "--out", "mine").status == 0
    directory.check_run(shell.folder / "mine")


def test_what_a_viewer_does_not_take_makes_it_idle_at_once(stalled: str) -> None:
    """Time from before the end of the run counts, once the buffers on the way are full."""
    with Relay(stalled) as relay:
        host, _, port = relay.address.partition(":")
        client = socket.create_connection((host, int(port)))
        assert not relay.full
        client.settimeout(0.3)
        with pytest.raises(TimeoutError):
            client.sendall(bytes(1 << 26))
        assert relay.full
        relay.moved -= 1000.0
        assert relay.idle(time.monotonic()) >= 1000.0
        relay.full = False
        assert relay.idle(time.monotonic()) < 1000.0
        client.close()


def test_signal_ends_a_run_whose_viewer_has_stalled(
    stalled: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wait(sender: object, relay: object) -> None:
        raise AssertionError("it waits for the viewer")

    monkeypatch.setattr(live._Sender, "finish", wait)
    plan = rollout.plan(Scenario.load("classic-ellipse", ["duration=0.9"]))
    with pytest.raises(KeyboardInterrupt):
        run_interrupted(plan, stalled)


def run_interrupted(plan: rollout.Plan, address: str) -> None:
    with live.streaming(plan, address) as watch:
        rollout.execute(plan, watch)
        raise KeyboardInterrupt


def test_interrupt_while_the_viewer_is_awaited_leaves_the_run(
    shell: Shell, stalled: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(sender: object, relay: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(live._Sender, "finish", interrupted)
    assert shell("run", "short.toml", "--live-at", stalled, "--out", "mine").status == 130
    directory.check_run(shell.folder / "mine")
