"""./.venv/bin/python scripts/bench_live.py: what `fivebar run --live` costs the physics.

A run of 60 s, simulated alone and while it streams to a Rerun server on this machine, in turn; the
ratio of the medians. The server shows nothing: a viewer on the same machine also draws.
"""

from __future__ import annotations

import statistics
import subprocess
import time

from fivebar_sim import rollout
from fivebar_sim.errors import ConfigError
from fivebar_sim.recording import live, viewer
from fivebar_sim.scenario import Scenario

PORT = 9877
ROUNDS = 5


def listening(address: str) -> str:
    """Return the address as soon as a server listens there."""
    for _ in range(100):
        try:
            return live.check_address(address)
        except ConfigError:
            time.sleep(0.1)
    return live.check_address(address)


def measure(address: str) -> tuple[float, float]:
    """Return how long the run takes alone and streamed [s], the medians."""
    plan = rollout.plan(Scenario.load("classic-ellipse", ["duration=60"]))
    alone = []
    streamed = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        rollout.execute(plan)
        alone.append(time.perf_counter() - begun)
        with live.streaming(plan, address) as watch:
            begun = time.perf_counter()
            rollout.execute(plan, watch)
            streamed.append(time.perf_counter() - begun)

    return statistics.median(alone), statistics.median(streamed)


if __name__ == "__main__":
    bind = ["--serve-grpc", "--bind", viewer.LOOPBACK, "--port", str(PORT)]
    server = subprocess.Popen(
        [str(viewer.binary()), *bind],
        env=viewer.quiet_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        alone, streamed = measure(listening(f"{viewer.LOOPBACK}:{PORT}"))
    finally:
        server.kill()
        server.wait()
    print(f"60 s run: alone {alone:.3f} s, streamed {streamed:.3f} s")
    print(f"ratio {streamed / alone:.2f} (bar: 1.1)")
