"""Guards: each is passed by a run that is none, says when, and turns the verdict."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from shared import once
from shell import Shell

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ArgumentError, ConfigError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.kinematics.stops import angle_at_C
from fivebar_sim.metrics import ground, guards, lasting
from fivebar_sim.metrics.guards import Guard, Guards
from fivebar_sim.report import single
from fivebar_sim.rollout import Plan, Result
from fivebar_sim.scenario import Scenario

CHATTER = (
    *("controller.kp=150", "controller.kd=5", "controller.period=0.01", "servo.limit=1"),
    "duration=2",
)
"""A loop that is too slow for its gains, and that the torque limit keeps near its path."""


KEPT = ("duration", "path", "guards.heat")
"""Settings that break nothing by themselves."""

FAST = ("path.frequency=10", "path.ramp=0.1", "duration=0.4", "guards.heat=100")

CASES = (
    (
        "treadmill-trot",
        (
            *("sim.integrator=implicitfast", "sim.timestep=0.001", "duration=1"),
            *("guards.contact=10", "guards.constraints=1"),
        ),
        "loop",
        "guard loop: the loop was open by more than 1 mm at t = 0.096",
    ),
    (
        "rail-landing",
        ("scene.drop=1.0",),
        "ground",
        "guard ground: the foot was in the floor by more than 12 mm at t = 0.4",
    ),
    (
        "treadmill-trot",
        ("sim.integrator=implicitfast", "guards.loop=1"),
        "contact",
        "guard contact: a foot that should stick crept under implicitfast, and changed a torque by",
    ),
    (
        "q8bot-trot",
        ("servo=hobby-9g", "guards.heat=100"),
        "torque",
        "guard torque: a motor's torque had been clipped for more than 50 % of a second at",
    ),
    (
        "airhockey-pd",
        (*CHATTER, "controller.kp=60", "controller.kd=2.5", "servo.limit=100", "duration=3"),
        "chatter",
        "guard chatter: a motor's torque had turned round with every command in more than",
    ),
    (
        "rail-landing",
        ("sim.integrator=implicitfast", "guards.contact=10"),
        "constraints",
        "guard constraints: loop, gears or ends of travel had given more than 1 % of the",
    ),
    (
        "minitaur-trot",
        # 10 Hz for good are too hot for its own motor
        (*FAST, "servo={kp=500,kd=1}"),
        "step",
        "guard step: the steps by themselves had given or taken more than 2 % of the energy",
    ),
    (
        "treadmill-trot",
        ("scene.stop=0.066", "duration=1"),
        "rail",
        "guard rail: the rail's end carried the trunk, with more than 0 N at t = 0.2 s, ",
    ),
    (
        "classic-ellipse",
        # a spring without any damper, held for 1 ms: at 0.5 ms the same leg leaves its path
        ("duration=0.75", "controller={name='pd',kd=0.0}"),
        "feedback",
        "guard feedback: held for its period the feedback is unstable, which the timestep hides: ",
    ),
    (
        "minitaur-trot",
        ("duration=0.75", "controller={name='pd',kp=49,kd=4e-4}", "servo={limit=0.4}"),
        "feedback",
        "guard feedback: held for its period the feedback is unstable, which the timestep hides: ",
    ),
    (
        "classic-ellipse",
        ("duration=0.75", "controller={name='computed_torque',kp=40000,kd=10}"),
        "feedback",
        "guard feedback: held for its period the feedback is unstable, which the timestep hides: ",
    ),
    (
        "classic-ellipse",
        (
            "duration=0.75",
            "controller={name='pd',kd=0.0005,period=0.002}",
            "sim.timestep=0.002",
        ),
        "feedback",
        "guard feedback: held for its period the feedback is unstable, which the timestep hides: ",
    ),
    (
        "rail-hop",
        (
            "duration=0.5",
            "controller={name='impedance',stiffness=[2000,2000],damping=[0.3,0.3]}",
        ),
        "feedback",
        "guard feedback: held for its period the feedback is unstable, which the timestep hides: ",
    ),
    (
        "classic-ellipse",
        ("guards.energy=1e-7", "duration=1"),
        "energy",
        "guard energy: more than 1e-05 % of the energy turned over was unaccounted",
    ),
)
"""Runs that are none: a scenario, what is set in it, the one guard that trips, and what it says.

None sits on a bound: the result would be another where a processor rounds otherwise, as
tests/test_scenarios_rounding.py looks for.
"""


@cache
def ran(name: str, *settings: str) -> Result:
    return rollout.run(Scenario.load(name, ["limits={}", *settings]))


def tripped(result: Result) -> dict[str, Guard]:
    return {guard.name: guard for guard in result.measured.guards if not guard.ok}


# runs that are none


def ended(case: int) -> Result:
    """Return what comes of a case, also for the tests with other rounding."""
    name, settings, *_ = CASES[case]
    return once(f"guards-{case}", lambda: ran(name, *settings))


@pytest.mark.parametrize("case", range(len(CASES)))
def test_each_turns_the_verdict_and_says_when(case: int) -> None:
    result = ended(case)
    name, settings, guard, said = CASES[case]
    assert result.verdict == "fail"
    assert list(tripped(result)) == [guard]
    assert str(tripped(result)[guard]).startswith(said)
    assert ran(name, *(s for s in settings if s.startswith(KEPT))).verdict == "not judged"


def test_each_has_words_also_where_it_holds() -> None:
    for guard in ran("classic-ellipse", "duration=0.8").measured.guards:
        assert str(guard) == f"guard {guard.name}: ok"


def test_time_is_that_of_the_first_step_past_the_bound() -> None:
    result = ran("rail-landing", "scene.drop=1.0", "duration=1.2")
    guard = tripped(result)["ground"]
    record = result.record
    leg = result.scenario.leg
    depth = leg.foot_radius - record["hip_z"] - record["foot_z"]
    assert guard.high == 2.0 * leg.foot_radius
    assert guard.value == pytest.approx(depth.max(), rel=1e-12)
    assert guard.time == record["time"][np.flatnonzero(depth > 2.0 * leg.foot_radius)[0]]


FOLDED = (
    *("duration=0.5", "scene=rail", "leg.L1=0.06", "leg.L3=0.06", "leg.L4=0.06"),
    *("path.centre=[0,-0.03]", "path.radii=[0.001,0.001]", "path.frequency=4", "path.ramp=0.1"),
)
"""A leg with one knee below its foot, in the working modes (-1, -1) and (1, 1)."""

WEAK = ("servo.kp=0.01", "scene.mass=5", "duration=1")


@pytest.mark.parametrize(
    ("name", "settings", "part"),
    [
        ("classic-ellipse", (*FOLDED, "leg.mode=[-1,-1]"), "joint B"),
        ("classic-ellipse", (*FOLDED, "leg.mode=[1,1]"), "joint D"),
        ("rail-landing", WEAK, "trunk"),
        ("rail-landing", (*WEAK, "leg.tilt=0.2"), "trunk"),
    ],
)
def test_what_is_in_the_floor_besides_the_foot_is_named(
    name: str, settings: tuple[str, ...], part: str
) -> None:
    """As deep as MuJoCo's own shapes are."""
    plan = rollout.plan(Scenario.load(name, ["limits={}", *settings]))
    result = rollout.execute(plan)
    guard = tripped(result)["floor"]
    assert (result.verdict, guard.part) == ("fail", part)
    assert f"guard floor: the {part} was in the floor by more than " in str(guard)
    assert guard.value == pytest.approx(deepest(plan, result), rel=1e-9)


def deepest(plan: Plan, result: Result) -> float:
    """Return how deep MuJoCo's links and boxes get in the floor [m]."""
    model = plan.model
    data = mujoco.MjData(model)
    # L2 and L3 reach from the same knees to the foot, which may be in the floor.
    geoms = [model.geom(name) for name in ("L1", "L4", "L5", "trunk")]
    columns = [result.record[name] for name in ("hip_z", *(f"theta_{j}" for j in "ABED"))]
    lowest = 0.0
    for qpos in zip(*columns, strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        for geom in geoms:
            x, y, z = np.abs(data.geom_xmat[geom.id][6:])
            a, b, c = geom.size
            capsule = geom.type == mujoco.mjtGeom.mjGEOM_CAPSULE
            reach = a + b * z if capsule else a * x + b * y + c * z
            lowest = min(lowest, float(data.geom_xpos[geom.id][2]) - reach)
    return -lowest


def hurried() -> Plan:
    """Return a landing of which the solver has too few iterations."""
    plan = rollout.plan(Scenario.load("rail-landing", ["limits={}", "duration=1.2"]))
    plan.model.opt.iterations = 2
    return plan


def test_solver_that_ran_out_of_iterations() -> None:
    result = rollout.execute(hurried())
    guard = tripped(result)["solver"]
    assert result.verdict == "fail"
    assert guard.time is not None
    assert 0.09 < guard.time < 0.12  # the landing
    words = f"MuJoCo's solver did not converge at t = {guard.time:g} s, nor in"
    assert str(guard).startswith(f"guard solver: {words}")


@pytest.mark.parametrize(
    ("joint", "limits"), [("A", (-6.0, -2.1)), ("B", (-3.0, 1.45)), ("E", (-1.05, 6.0))]
)
def test_stop_that_acts_is_named_with_the_step_that_mujoco_pushes_in(
    joint: str, limits: tuple[float, float]
) -> None:
    """A joint whose range ends within the path, as someone may have set it in the model."""
    plan = rollout.plan(Scenario.load("classic-ellipse", ["limits={}", "duration=0.8"]))
    plan.model.joint(joint).range = limits
    result = rollout.execute(plan)
    guard = tripped(result)["stops"]
    assert (result.verdict, guard.part) == ("fail", f"joint {joint}")
    assert f"guard stops: joint {joint} leaned into its stop by more than " in str(guard)
    assert guard.value is not None
    assert guard.value > 0.01

    data = mujoco.MjData(plan.model)
    data.qpos[:] = plan.start
    for ctrl in plan.ctrl:
        data.ctrl[:] = ctrl
        mujoco.mj_step(plan.model, data)
        pushed = data.efc_force[data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT]
        if pushed.any():
            break
    # The pose at the end of a step pushes in the next one.
    assert guard.time == pytest.approx(data.time - 0.001, abs=0.0015)


def test_stop_at_C_is_named_too() -> None:
    plan = rollout.plan(Scenario.load("classic-ellipse", ["limits={}", "duration=0.8"]))
    middle = float(angle_at_C(plan.motion.q).mean())
    plan.model.tendon_range[plan.model.tendon("C_angle").id] = (0.0, middle)
    assert tripped(rollout.execute(plan))["stops"].part == "joint C"
    scenario = plan.scenario
    held = rollout.run(scenario).measured.guards
    (stops,) = (guard for guard in held if guard.name == "stops")
    assert (stops.value, stops.time, stops.part, stops.ok) == (0.0, None, None, True)


def test_clipped_time_is_of_the_worse_motor_within_a_second() -> None:
    """3 s at 10 ms: A is clipped every other step for a second, E for 0.3 s in one piece."""
    time = np.arange(1.0, 301.0) * 0.01
    saturated = np.zeros((300, 2), dtype=bool)
    saturated[100:200:2, 0] = True
    saturated[50:80, 1] = True
    so_far = lasting.clipped(saturated, time)
    assert so_far.max() == pytest.approx(0.5)
    assert time[so_far.argmax()] == pytest.approx(1.99)  # the fiftieth step
    assert so_far[79] == pytest.approx(0.3)
    assert so_far[-1] == 0.0
    short = lasting.clipped(saturated[50:80], time[:30])  # all of a run of 0.3 s
    assert short[[0, 14, 29]] == pytest.approx([1 / 30, 0.5, 1.0])


def test_chatter_is_up_and_down_with_every_command_and_lasts(rng: np.random.Generator) -> None:
    """3 s at 1 ms, a command every 10 ms: of A, while E does as the motion asks for."""
    time = np.arange(1.0, 3001.0) * 1e-3
    command = np.arange(3000) // 10
    turning = np.where(command % 2, 1.0, -1.0)
    load = np.sin(2.0 * np.pi * 2.0 * time)

    def most(torque: Array) -> float:
        record = {"time": time, "torque_A": torque, "torque_E": load}
        return float(lasting.chattering(record, 10).max())

    assert most(3.0 + 0.5 * turning) == 1.0  # on top of a load too
    assert most(np.where(time < 0.3, turning, 0.1 * load)) == pytest.approx(0.28, abs=0.021)
    assert most(load + turning * np.exp(-20.0 * np.mod(time, 1.0))) < 0.2  # rings down
    assert most(load + 0.02 * turning) == 0.0  # too faint
    assert 0.5 < most(np.repeat(rng.standard_normal(300), 10)) < 0.8  # noise alone is none either
    assert most(load) == 0.0
    loud = load + turning
    loud[1500] += 30.0  # a spike of a single step hides nothing
    assert most(loud) == 1.0


def test_bounds_are_in_parts_of_the_leg() -> None:
    long = ran("classic-ellipse", "duration=1", "guards.loop=0.02").metrics["guards"]
    (loop,) = (each for each in long if each["name"] == "loop")
    assert loop["high"] == pytest.approx(0.02 * FiveBar.load("classic").size)
    assert {each["name"] for each in long} == {
        *("branch", "loop", "torque", "chatter", "energy", "constraints", "step"),
        *("solver", "stops", "jolts"),
    }


# the edge


def test_scenario_sets_and_keeps_them(tmp_path: Path) -> None:
    scenario = Scenario.load("classic-ellipse", ["guards.torque=0.1"])
    assert scenario.guards == Guards(torque=0.1)
    assert Scenario.from_table(scenario.table(), "again", tmp_path) == scenario
    with pytest.raises(ConfigError, match=r"\[guards\]: unknown key 'penetration'"):
        Scenario.load("classic-ellipse", ["guards.penetration=1"])
    with pytest.raises(ConfigError, match=r"guards\.loop must be in \[0, inf\), got -1"):
        Scenario.load("classic-ellipse", ["guards.loop=-1"])
    with pytest.raises(ArgumentError, match=r"torque must be in \[0, 1\], got 2"):
        Guards(torque=2)


def test_everyone_is_told(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(single, "figures", lambda run: [])  # what is said is enough
    chatter = [f"--set={setting}" for setting in ("limits={}", *CHATTER)]
    words = "guard torque: a motor's torque had been clipped for more than 50 % of a second at"
    said = shell("run", "airhockey-pd", *chatter, "--out", "run")
    assert said.status == 1
    assert words in said.out
    assert "verdict: FAIL" in said.out
    said = shell("report", "run")
    assert said.status == 0
    assert words.replace("'", "&#x27;") in Path("run/report.html").read_text()
    metrics = json.loads(Path("run/metrics.json").read_text())
    assert not metrics["limits"]
    assert metrics["verdict"] == "fail"


def test_the_part_that_was_first_is_named_with_the_worst_of_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def depths(
        leg: FiveBar, record: dict[str, Array], trunk: float, known: object
    ) -> dict[str, Array]:
        time = record["time"]
        # From step 30, 10 and 20 on: neither the first nor the last name, nor the deepest.
        return {
            "joint A": np.where(time > 0.0305, 0.3, 0.0),
            "joint B": np.where(time > 0.0105, 0.1, 0.0),
            "trunk": np.where(time > 0.0205, 0.2, 0.0),
        }

    monkeypatch.setattr(ground, "depths", depths)
    found = tripped(ran("rail-landing", "duration=0.8"))["floor"]
    assert (found.part, found.time, found.value) == ("joint B", pytest.approx(0.011), 0.3)


def test_new_guard_is_a_rule_and_a_function(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Verdict, console, report and JUnit have a guard that only its rule names."""

    def too_deep(run: guards.Evidence) -> guards.Found:
        depth = float(-run.record["foot_z"].min())
        return guards.Found(depth, 0.01, float(run.record["time"][3]))

    rule = guards.Rule("depth", too_deep, "foot below {}", ", {} at worst", 1e3, "mm")
    monkeypatch.setattr(guards, "GUARDS", (*guards.GUARDS, rule))
    monkeypatch.setitem(guards.RULES, rule.name, rule)
    monkeypatch.setattr(single, "figures", lambda run: [])

    words = "guard depth: foot below 10 mm at t = 0.004 s, "
    said = shell("run", "short.toml", "--out", "run")
    assert said.status == 1
    assert words in said.out
    depth = json.loads(Path("run/metrics.json").read_text())["guards"][-1]["value"]
    assert shell("report", "run").status == 0
    page = Path("run/report.html").read_text()
    assert "depth: foot below 10 mm" in page
    assert f"{1e3 * depth:.4g}&nbsp;mm" in page
    assert shell("check", "short.toml", "--junit", "junit.xml").status == 1
    assert words in Path("junit.xml").read_text()
