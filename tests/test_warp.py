"""Legs on a device: what is refused before anything is compiled, and the law of the processor."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.metadata
import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from fivebar_sim import Scenario
from fivebar_sim.control.friction import Friction
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, ExtraError
from fivebar_sim.metrics import guards
from fivebar_sim.metrics.limits import look_up
from fivebar_sim.regression.baseline import Recorded, read
from fivebar_sim.rollout import Result, plan, run_all
from fivebar_sim.simulation.plan import Plan
from fivebar_sim.warp import device as devices
from fivebar_sim.warp import memory, possible
from fivebar_sim.warp.models import lean_models, put

SCENARIOS = Path(__file__).parents[1] / "scenarios"
HAS_WARP = importlib.util.find_spec("mujoco_warp") is not None
needs_warp = pytest.mark.skipif(not HAS_WARP, reason="the extra gpu is not installed")


def shipped(name: str, **changes: Any) -> Plan:
    """Return the plan of a shipped scenario of a leg."""
    scenario = Scenario.load(SCENARIOS / f"{name}.toml")
    return plan(msgspec.structs.replace(scenario, **changes))


@pytest.fixture(scope="module")
def short() -> Plan:
    """Return a plan of 800 steps."""
    return shipped("classic-ellipse", duration=0.8, limits={})


# what is refused


@pytest.mark.parametrize("name", ["cuda", "cpu", "cuda:-1", "CUDA:0", 0, "gpu"])
def test_other_names_are_told_the_legal_ones(name: Any, short: Plan) -> None:
    with pytest.raises(ArgumentError, match=r'^device must be None .* "cuda:N".*, got ') as caught:
        run_all([short], device=name)
    assert "\n" not in str(caught.value)


def test_missing_package_says_what_to_install(monkeypatch: Any, short: Plan) -> None:
    monkeypatch.setitem(sys.modules, "warp", None)
    with pytest.raises(ExtraError, match=r"pip install 'fivebar-sim\[gpu\]'$") as caught:
        run_all([short], device="cpu-warp")
    assert "\n" not in str(caught.value)


def test_missing_card_names_those_that_are_there(monkeypatch: Any, short: Plan) -> None:
    cards: list[Any] = []
    fake = SimpleNamespace(get_cuda_devices=lambda: cards, get_device=lambda name: name)
    monkeypatch.setattr(devices, "warp", lambda: fake)
    with pytest.raises(ConfigError, match=r'^no device "cuda:0": Warp finds no CUDA card here; "'):
        run_all([short], device="cuda:0")

    cards += [SimpleNamespace(alias="cuda:0"), SimpleNamespace(alias="cuda:1")]
    assert devices.opened("cuda:1") == "cuda:1"
    with pytest.raises(ConfigError, match=r'^no device "cuda:2": here are cuda:0, cuda:1; '):
        run_all([short], device="cuda:2")


def test_what_no_device_can_run_is_refused_before_warp_is_looked_for(
    monkeypatch: Any, short: Plan
) -> None:
    monkeypatch.setitem(sys.modules, "warp", None)
    asked = shipped("airhockey-pd")
    with pytest.raises(ConfigError, match=r"^airhockey-pd: no device .* feedback controller 'pd'"):
        run_all([short, asked], device="cuda:0")

    robot = plan(Scenario.load(SCENARIOS / "robots/robot-q8bot-stand.toml"))
    with pytest.raises(ConfigError, match=r"no device can run a robot"):
        run_all([robot], device="cuda:0")


def test_friction_that_changes_and_noslip_are_refused(short: Plan) -> None:
    friction = Friction(model="stribeck", base=0.01, stribeck=0.02)
    rubbing = shipped("classic-ellipse", duration=0.8, limits={}, servo=Servo(friction=friction))
    assert "friction that changes" in str(possible.obstacle(rubbing))

    held = shipped("classic-ellipse", duration=0.8, limits={})
    held.model.opt.noslip_iterations = 3
    assert "noslip_iterations = 3" in str(possible.obstacle(held))
    assert possible.obstacle(short) is None


def test_too_little_memory_says_how_many_legs_fit(monkeypatch: Any, short: Plan) -> None:
    monkeypatch.setattr(memory, "bytes_of_leg", lambda model: 1000)
    monkeypatch.setattr(memory, "free_bytes", lambda device: 1_000_000)
    one = 1000 * memory.SCRATCH + 4 * 250
    fits = int(1_000_000 // one)
    card = SimpleNamespace(alias="cuda:0")
    memory.check_fits(short.model, fits, 250, card)
    with pytest.raises(ConfigError, match=rf"^{fits + 1} legs need .* free: {fits} legs fit$"):
        memory.check_fits(short.model, fits + 1, 250, card)


# steps, against the processor's; compiling the kernels first takes minutes


def stamp(*files: str) -> Path:
    """Return a file that lies in Warp's cache once all kernels of some tests are compiled."""
    room = Path(str(devices.__file__)).parent
    kernels = b"".join((room / name).read_bytes() for name in ("kernels.py", *files))
    versions = [importlib.metadata.version(name) for name in ("mujoco-warp", "warp-lang")]
    name = "-".join([*versions, hashlib.sha256(kernels).hexdigest()[:12]])
    return Path(devices.warp().config.kernel_cache_dir) / f"fivebar-sim-{name}"


def legs() -> list[Plan]:
    """Return plans of legs that differ in all that may differ on a device, a limit among it."""
    servo = Servo(limit=0.0029, speed=50.0)
    first = shipped("classic-ellipse", duration=0.8, limits={}, servo=servo)
    leg = first.scenario.leg
    other = dataclasses.replace(leg, L1=1.03 * leg.L1, L3=0.99 * leg.L3, density=1.2 * leg.density)
    stiff = msgspec.structs.replace(servo, kp=1.2 * servo.kp, limit=0.0036)
    return [first, shipped("classic-ellipse", duration=0.8, limits={}, leg=other, servo=stiff)]


@needs_warp
def test_legs_that_differ_move_as_on_the_processor() -> None:
    if not stamp().exists():
        pytest.skip("no warm cache of Warp's kernels: run the long tests once")
    plans = legs()
    for there, here in zip(run_all(plans, device="cpu-warp"), run_all(plans), strict=True):
        for name in ("theta_A", "theta_E", "theta_B", "theta_D"):
            assert np.abs(there.record[name] - here.record[name]).max() < 3e-5  # [rad]
        for name in ("torque_A", "torque_E"):
            assert np.abs(there.record[name] - here.record[name]).max() < 5e-5  # [N m]
        clipped = [result.metrics["load"]["saturated"]["A"] for result in (there, here)]
        assert clipped[0] == pytest.approx(clipped[1], abs=0.01)


SPACING = 2.0**-22
"""A float's spacing between 2 and 4 rad, where a leg's angles lie [rad]."""

LENGTHS = ("closure.rms", "closure.max", "tracking.rms", "tracking.max")
"""Metrics that are distances between points which the record computes from the angles."""

MOVED = {
    # a slip while landing, 19.8 instead of 22.0 um
    ("rail-landing", "ground.slip"): 0.12,
}
"""What single precision moves by more than its rounding, by which part."""


def allowed(planned: Plan, key: str, recorded: Recorded) -> float:
    """Return how far a metric may be from its baseline, in its unit."""
    scenario = planned.scenario
    if recorded.value is not None and (scenario.name, key) in MOVED:
        return MOVED[scenario.name, key] * abs(recorded.value)
    # The record sees four angles, each rounded by half a spacing at a lever of the leg's size.
    rounded = 2.0 * SPACING * scenario.leg.size if key in LENGTHS else 0.0
    return recorded.tolerance + rounded


def off(planned: Plan, result: Result) -> dict[str, tuple[float | None, float | None]]:
    """Return the metrics that are off their baseline, with it."""
    recorded = read(SCENARIOS / f"baselines/{planned.scenario.name}.json")
    assert recorded is not None
    found = {}
    for key, then in recorded.metrics.items():
        now = look_up(result.metrics, key)
        if then.value is None or now is None:
            if then.value is not now:
                found[key] = (now, then.value)
        elif not abs(now - then.value) <= allowed(planned, key, then):
            found[key] = (now, then.value)
    return found


@needs_warp
@pytest.mark.long
def test_every_scenario_without_feedback_meets_its_baseline() -> None:
    every = [plan(Scenario.load(file)) for file in sorted(SCENARIOS.glob("*.toml"))]
    possible_ones = [planned for planned in every if possible.obstacle(planned) is None]
    assert len(possible_ones) == 14
    results = run_all(possible_ones, device="cpu-warp")
    for planned, result in zip(possible_ones, results, strict=True):
        assert off(planned, result) == {}, planned.scenario.name
        assert guards.tripped(result.measured.guards) == []


@needs_warp
@pytest.mark.long
def test_legs_on_a_device_give_the_same_bits_alone_and_in_any_order() -> None:
    plans = legs()
    alone = [run_all([planned], device="cpu-warp")[0] for planned in plans]
    together = run_all(plans[::-1], device="cpu-warp")[::-1]
    for one, other in zip(alone, together, strict=True):
        for name, column in one.record.items():
            assert np.array_equal(column, other.record[name]), name
    stamp().touch()


@needs_warp
@pytest.mark.long
def test_a_step_takes_no_more_memory_than_is_counted(monkeypatch: Any) -> None:
    model = lean_models([legs()[0].model])[0]
    wp = devices.warp()
    sizes: list[int] = []

    def counted(make: Any) -> Any:
        def made(*args: Any, **keywords: Any) -> Any:
            array = make(*args, **keywords)
            sizes.append(array.capacity)
            return array

        return made

    with devices.on("cpu"):
        there = put([model] * 64, wp.get_device("cpu"))
        data = memory.data_of(model, 64)
        for name in ("empty", "zeros"):
            monkeypatch.setattr(wp, name, counted(getattr(wp, name)))
        devices.mujoco_warp().step(there, data)
    assert 0 < sum(sizes) <= (memory.SCRATCH - 1.0) * 64 * memory.bytes_of_leg(model)
