"""Feedback controllers in the loop with MuJoCo: batches, control periods, and what goes wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
from fivebar_controllers.pd import Pd

from fivebar_sim import rollout
from fivebar_sim.arrays import Array
from fivebar_sim.control import Observation, Reference
from fivebar_sim.control.bus import Bus
from fivebar_sim.control.interface import Drive
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ArgumentError, ConfigError, DivergedError, LoopOpenError
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import digest
from fivebar_sim.rollout import Plan
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import feedback
from fivebar_sim.simulation.steps import Legs

H = 1e-3
ASIDE = ["duration=0.4", "path.frequency=4", "path.ramp=0.1", "limits={}"]
BRIEF = ["duration=0.1", "path.frequency=16", "path.ramp=0.03", "path.radii=[0.004,0.002]"]
"""Where only the bits matter."""

LEGS = [  # unlike, but of one timestep, length and control period
    ["controller.name=pd"],
    ["controller.name=pd", "sensors={noise=1e-3, rate_noise=0.1}", "sim.seed=7"],
    ["controller.name=pd", "sensors={noise=1e-3, rate_noise=0.1}", "sim.seed=8"],
    ["controller.name=pd", "controller.derivative=error", "sensors={delay=0.001}"],
    ["controller.name=computed_torque", "leg.L2=0.065"],
    ["controller.name=computed_torque", "path.radii=[0.005,0.002]"],
    ["controller.name=computed_torque", "servo={preset='xl330', limit=1.0}"],
    ["controller.name=impedance", "leg={L1=0.04, L2=0.06, L3=0.055, L4=0.045, L5=0.03}"],
    ["controller.name=impedance", "servo={limit=0.02, delay=0.002}", "sim.integrator=implicitfast"],
    ["controller.name=gain_schedule", "controller.period=0.001", "controller.kp_near=1.0",
     "controller.kd_near=0.01", "controller.kp_far=1.0", "controller.kd_far=0.01"],
    ["controller.name=gravity_compensation", "controller.kd=0.01"],
]  # fmt: skip


def planned(*settings: str) -> Plan:
    return rollout.plan(Scenario.load("classic-ellipse", [*ASIDE, *settings]))


class Mine(msgspec.Struct, frozen=True, kw_only=True):
    """What a user may bring: damped, until its time comes, and then wrong in a way of its own."""

    drive: ClassVar[Drive] = "torque"
    period: Any = 0.001
    after: float = 0.1
    wrong: str = "none"

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Any:
        """Return the torques of a PD law, or what is wrong."""
        good = Pd().command(leg, servo, seen, wanted)
        if seen.time < self.after:
            return good
        match self.wrong:
            case "shape":
                return good[:, :1]
            case "text":
                return [["a", "b"]] * len(good)
            case "nan":
                return good * np.nan
            case "open":
                raise LoopOpenError("the loop is open", (0,))
            case "error":
                raise KeyError("gain")
            case "scribbles":
                seen.theta[:] = 7.0
                seen.theta_dot[:] = 7.0
            case "legal":
                raise ArgumentError("gain must be in (0, inf), got 0")
        return good


class Angles(msgspec.Struct, frozen=True, kw_only=True):
    """Sends the reference's angles."""

    drive: ClassVar[Drive] = "position"
    period: float = 0.001
    turned: float = 0.0

    def command(self, leg: FiveBar, servo: Servo, seen: Observation, wanted: Reference) -> Array:
        """Return the reference's angles, those of E turned from 0.1 s on."""
        del leg, servo
        return wanted.theta + np.array([0.0, self.turned if seen.time > 0.0995 else 0.0])


def with_mine(controller: Any, *settings: str) -> Plan:
    scenario = Scenario.load("classic-ellipse", [*ASIDE, *settings])
    return rollout.plan(scenario.driven_by(controller))


def ctrl(plan: Plan) -> Array:
    record = rollout.execute(plan).record
    return np.stack([record["ctrl_A"], record["ctrl_E"]], axis=-1)


# law


def test_batch_of_unlike_legs_has_the_bits_of_each_alone() -> None:
    """The first comes once more at the end: its controller drives legs that are not neighbours."""
    plans = [planned(*BRIEF, *settings) for settings in LEGS]
    every = [rollout.execute(plan) for plan in plans]
    together = rollout.run_all([*plans, plans[0]], 2)
    for settings, alone, result in zip([*LEGS, LEGS[0]], [*every, every[0]], together, strict=True):
        assert result.scenario is alone.scenario
        assert result.metrics == alone.metrics
        for name, column in result.record.items():
            np.testing.assert_array_equal(column, alone.record[name], f"{settings} {name}")


@pytest.mark.parametrize(
    "settings",
    [
        ["sensors={noise=1e-3, delay=0.0025}", "servo.delay=0.001"],
        ["controller.kp=1000", "controller.kd=0.5"],  # breaks down within a period
    ],
)
@pytest.mark.parametrize("every", [2, 3])
def test_periods_step_by_step_have_the_bits_of_periods_at_once(
    monkeypatch: pytest.MonkeyPatch, settings: list[str], every: int
) -> None:
    own = ["controller.name=pd", f"controller.period={every * H}", *settings]
    plans = [planned(*BRIEF, *own, f"sim.seed={seed}") for seed in (1, 2)]
    came: list[Any] = []
    for most in (0, every):
        monkeypatch.setattr(feedback, "SINGLY", most)
        try:
            came.append([digest(result.record) for result in rollout.run_all(plans)])
        except DivergedError as error:
            came.append((str(error), error.time))
    assert came[0] == came[1]


def test_seed_is_that_of_each_leg() -> None:
    plans = [planned(*LEGS[i]) for i in (1, 2, 1)]
    one, other, same = (result.record["foot_x"] for result in rollout.run_all(plans))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 1e-6


def test_batch_of_payloads_and_forces_has_the_bits_of_each_alone() -> None:
    plans = [
        planned(*BRIEF, "controller.name=impedance", f"scene={{kind='payload', mass={mass}}}",
                f"force={{kind='constant', value=[0.0, {push}]}}", f"leg.L3={0.06 + 0.001 * push}")
        for mass, push in ((0.02, 0.0), (0.02, -0.5), (0.0, 0.3))
    ]  # fmt: skip
    every = [rollout.execute(plan) for plan in plans]
    for alone, result in zip(every, rollout.run_all(plans, 2), strict=True):
        for name, column in alone.record.items():
            np.testing.assert_array_equal(column, result.record[name], name)


def test_many_like_legs_are_one_call_and_keep_their_bits() -> None:
    """Thirty-three legs in one array of poses: no sum depends on how many are in it."""
    plans = [
        planned("duration=0.06", "controller.name=computed_torque", f"sim.seed={i}",
                "sensors.noise=1e-5", f"path.frequency={25.0 + 0.1 * i}", "path.ramp=0.02")
        for i in range(33)
    ]  # fmt: skip
    together = rollout.run_all(plans, 2)
    for i in (0, 16, 32):
        for name, column in rollout.execute(plans[i]).record.items():
            np.testing.assert_array_equal(column, together[i].record[name], name)


def test_threads_are_given_only_what_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    threads = []

    def legs(models: Any, start: Array, nthread: int) -> Legs:
        threads.append(nthread)
        return Legs(models, start, nthread)

    monkeypatch.setattr(feedback, "Legs", legs)
    few = planned(*BRIEF, "controller.name=pd")
    seldom = with_mine(Angles(period=0.02), *BRIEF)
    for plans in ([few] * 15, [few] * 16, [seldom]):
        rollout.run_all(plans, 2)
    assert threads == [1, 2, 2]


def test_legs_of_several_periods_and_kinds_come_back_in_order() -> None:
    settings = [
        ["controller.name=pd", "controller.period=0.002"],
        [],
        ["controller.name=pd"],
        ["controller.name=pd", "scene=rail"],
        ["controller.name=pd", "controller.period=0.002", "duration=0.5"],
    ]
    plans = [planned(*each) for each in settings]
    for plan, result in zip(plans, rollout.run_all(plans, 2), strict=True):
        assert result.scenario is plan.scenario
        assert result.metrics["tracking"] == rollout.execute(plan).metrics["tracking"]


@pytest.mark.parametrize("every", [1, 2, 7])
def test_commands_hold_for_a_control_period(every: int) -> None:
    """Also in the last one, which 400 steps cut off where seven do not divide them."""
    plan = with_mine(Angles(period=every * H))
    sent = ctrl(plan)
    k = np.arange(400)
    wanted = plan.motion.q[:, [0, 2]]
    np.testing.assert_array_equal(sent, wanted[k // every * every])


@pytest.mark.parametrize("period", [0.001, 0.002])
@pytest.mark.parametrize("settings", [(), ('servo="xl330-m288"',)], ids=["", "back-EMF"])
def test_what_a_controller_writes_over_its_observation_stays_there(
    period: float, settings: tuple[str, ...]
) -> None:
    options = (*BRIEF, *settings)
    tidy, untidy = (
        rollout.execute(with_mine(Mine(period=period, after=0.0, wrong=wrong), *options)).record
        for wrong in ("none", "scribbles")
    )
    assert digest(untidy) == digest(tidy)


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_feedback_that_sends_a_plan_is_the_plan(integrator: str) -> None:
    """The same setpoints, asked or planned: the same bits. Planned ones are one step ahead."""
    asked = with_mine(Angles(), f"sim.integrator={integrator}", "servo={rate=200.0, delay=0.003}")
    bus = Bus([asked.scenario.servo], "position", timestep=H, steps=asked.scenario.steps)
    bus.restart(np.arange(1), asked.motion.q[:1, [0, 2]])
    table = bus.send_all(asked.motion.q[None, :-1, [0, 2]])[0]
    plain = planned(f"sim.integrator={integrator}", "servo={rate=200.0, delay=0.003}")
    known = rollout.execute(plain._replace(setpoints=table)).record
    for name, column in rollout.execute(asked).record.items():
        np.testing.assert_array_equal(column, known[name], name)


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_unsaturated_torque_arrives_though_the_motor_has_a_back_emf(integrator: str) -> None:
    """What is recorded as torque is the command, but for how the rate changes in a step."""
    for h in (1e-3, 2.5e-4):
        settings = ["controller.name=pd", "servo={limit=1.0, speed=200.0}", f"sim.timestep={h}"]
        plan = planned(*settings, f"controller.period={h}", f"sim.integrator={integrator}")
        record = rollout.execute(plan).record
        for side in "AE":
            torque = record[f"torque_{side}"]
            rate = record[f"theta_dot_{side}"]
            before = np.concatenate([[0.0], rate[:-1]])
            command = record[f"ctrl_{side}"] - 1.0 / 200.0 * before
            np.testing.assert_allclose(torque, command - (rate - before) / 200.0, atol=1e-15)
            assert (
                np.abs(torque - command).max()
                < 1.1 * h / 200.0 * np.abs(np.diff(rate, prepend=0.0) / h).max()
            )
            assert np.abs(torque).max() > 1e-3


def test_saturated_torque_is_that_of_the_motors_line() -> None:
    plan = planned("controller.name=pd", "servo={limit=0.003, speed=30.0}", "controller.kp=3.0")
    result = rollout.execute(plan)
    assert result.metrics["load"]["saturated"]["A"] > 0.1
    for side in "AE":
        rate = result.record[f"theta_dot_{side}"]
        u = result.record[f"ctrl_{side}"]
        line = np.clip(u, -0.003, 0.003) - 0.003 / 30.0 * rate
        np.testing.assert_allclose(result.record[f"torque_{side}"], line, atol=1e-15)


# refusal


@pytest.mark.parametrize("period", [0.0015, 0.0004, 1e308])
def test_refusal_of_a_period_that_is_no_whole_number_of_steps(period: float) -> None:
    with pytest.raises(ArgumentError, match=r"^controller\.period must be a whole number of time"):
        planned("controller.name=pd", f"controller.period={period}")


@pytest.mark.parametrize("period", [0.0, "1 ms", None, float("nan")])
def test_refusal_of_a_users_period_that_is_no_time(period: Any) -> None:
    with pytest.raises(ArgumentError, match=r"^controller\.period must be in \(0, inf\) s, got"):
        with_mine(Mine(period=period))


@pytest.mark.parametrize("after", [0.0, 0.1])
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            "shape",
            r"controller 'Mine' must command numbers of shape \(1, 2\), got float64 of shape",
        ),
        ("text", r"controller 'Mine' must command numbers of shape \(1, 2\), got <U1 of shape"),
        ("error", "controller 'Mine' failed: KeyError: 'gain'"),
    ],
)
def test_refusal_of_what_a_controller_answers(wrong: str, message: str, after: float) -> None:
    with pytest.raises(ConfigError, match=f"^{message}"):
        rollout.execute(with_mine(Mine(wrong=wrong, after=after)))


def test_refusal_by_the_controller_itself_is_its_own() -> None:
    with pytest.raises(ArgumentError, match=r"^gain must be in \(0, inf\), got 0$"):
        rollout.execute(with_mine(Mine(wrong="legal")))


@pytest.mark.parametrize("wrong", ["nan", "open"])
def test_controller_without_an_answer_says_when_the_foot_left_its_path(wrong: str) -> None:
    with pytest.raises(DivergedError) as caught:
        rollout.execute(with_mine(Mine(wrong=wrong, after=0.1)))
    said = {"nan": "its command is not finite", "open": "the loop is open"}[wrong]
    assert f"controller 'Mine' has no answer: {said}" in str(caught.value)
    assert str(caught.value).startswith("classic-ellipse: the foot left its path at t = 0.1 s; ")
    assert caught.value.time == pytest.approx(0.1)  # it had been near until then
    assert "\n" not in str(caught.value)


def test_controller_without_an_answer_at_the_start() -> None:
    with pytest.raises(DivergedError, match="has no answer: its command is not finite") as caught:
        rollout.execute(with_mine(Mine(wrong="nan", after=0.0)))
    assert caught.value.time == 0.0


def test_setpoint_that_no_servo_can_mean_says_when_and_whose() -> None:
    with pytest.raises(DivergedError, match=r"for E that is 3\.\d* rad away") as caught:
        rollout.execute(with_mine(Angles(turned=3.3)))
    assert "must be within 3.142 rad (half a turn) of the motors' angles" in str(caught.value)
    assert caught.value.time == pytest.approx(0.1)


@pytest.mark.parametrize("settings", [["controller.kd=10"], ["controller.kp=1000"]])
def test_unstable_gain_says_when_it_left_and_when_it_broke(settings: list[str]) -> None:
    with pytest.raises(DivergedError, match=r"^classic-ellipse: the foot left .* broke") as caught:
        rollout.execute(planned("controller.name=pd", *settings))
    broke = float(str(caught.value).partition("broke down at t = ")[2].partition(" s")[0])
    assert 0.0 < caught.value.time < broke < 0.1


@pytest.mark.parametrize("order", [1, -1])
def test_one_broken_leg_of_a_batch_is_the_one_that_is_named(order: int) -> None:
    """The others' runs end with it; it is not they who failed."""
    good = planned("controller.name=pd")
    bad = planned("controller.name=pd", "controller.kp=1000", "name=bad")
    with pytest.raises(DivergedError, match=r"^bad: the foot left its path at t = 0\.") as together:
        rollout.run_all([good, bad][::order])
    with pytest.raises(DivergedError) as alone:
        rollout.execute(bad)
    assert str(together.value) == str(alone.value)
    assert together.value.time == alone.value.time


def test_one_leg_without_an_answer_is_the_one_that_is_named() -> None:
    plans = [with_mine(Mine(wrong="none")), with_mine(Mine(wrong="nan"), "name=bad")]
    with pytest.raises(DivergedError, match=r"^bad: the foot left its path at t = 0\.1 s"):
        rollout.run_all(plans)


def test_command_breaks_off_with_one_line(tmp_path: Path, shell: Any) -> None:
    del tmp_path
    set_pd = ["--set", "controller.name=pd", "--set"]
    said = shell.refused("run", "short.toml", *set_pd, "controller.kp=1000", status=1)
    assert said.startswith("short: the foot left its path at t = 0.003 s; the simulation broke")
    said = shell.refused("run", "short.toml", *set_pd, "controller.period=0.0015")
    assert said == (
        "short.toml: controller.period must be a whole number of timesteps of 0.001 s, got 0.0015 s"
    )
