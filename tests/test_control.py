"""Controllers from other packages: found by their entry point, and refused in one line."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from fivebar_controllers.servo import Servo

from fivebar_sim import control, motion, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, SingularError
from fivebar_sim.integrator import Integrator
from fivebar_sim.scenario import Scenario

Plug = Callable[..., None]

LAW = '''
import msgspec

class Ahead(msgspec.Struct, frozen=True, kw_only=True):
    """Send the angles of the path, and a lead."""
    lead: float = 0.0
    def setpoints(self, leg, servo, motion, integrator):
        return motion.q[1:][:, [0, 2]] + self.lead

class Wrong(msgspec.Struct, frozen=True, kw_only=True):
    kind: str = "shape"
    def setpoints(self, leg, servo, motion, integrator):
        u = motion.q[1:][:, [0, 2]]
        if self.kind == "raise":
            raise RuntimeError("out of coffee")
        if self.kind == "refuse":
            from fivebar_sim.errors import ConfigError
            raise ConfigError("controller.gain must be in [0, 1], got 2")
        if self.kind == "singular":
            from fivebar_sim.errors import SingularError
            raise SingularError("B, C and D are in line at index (3,)", (3,))
        if self.kind == "somewhere":
            from fivebar_sim.errors import SingularError
            raise SingularError("B, C and D are in line")
        if self.kind == "shape":
            return u[:-1]
        u[3, 1] = float(self.kind)
        return u

class Silent(msgspec.Struct):
    pass

def law(): ...
'''


@pytest.fixture
def plug(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Plug:
    """Return a function that installs a package with controllers for the time of a test."""
    monkeypatch.setattr(sys, "modules", dict(sys.modules))  # forgets what is imported meanwhile

    def install(package: str, entries: dict[str, str], code: str = LAW) -> None:
        site = tmp_path / package
        site.mkdir()
        (site / f"{package}.py").write_text(code, encoding="utf-8")
        info = site / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Name: {package}\nVersion: 1.0\n", encoding="utf-8")
        lines = [f"{name} = {value}" for name, value in entries.items()]
        text = "\n".join(["[fivebar_sim.controllers]", *lines, ""])
        (info / "entry_points.txt").write_text(text, encoding="utf-8")
        monkeypatch.syspath_prepend(site)

    return install


def load(*settings: str) -> Scenario:
    return Scenario.load("classic-ellipse", ["duration=0.8", *settings])


def refused(*settings: str) -> str:
    with pytest.raises(ConfigError) as caught:
        rollout.plan(load(*settings))
    assert "\n" not in str(caught.value)
    return str(caught.value)


# law


def test_servo_is_found() -> None:
    assert control.find("servo") is Servo
    assert isinstance(Servo(), control.Setpoints)


def test_servo_sends_the_angles_of_the_path_at_the_integrators_time() -> None:
    scenario = load()
    leg = scenario.leg
    gains = scenario.servo
    wanted = motion.plan(leg, scenario.path, 800, 0.001)
    q = wanted.q[:, [0, 2]]
    lead = gains.kd / gains.kp * np.diff(q, axis=0) / 0.001
    instants: dict[Integrator, Array] = {"discrete": q[1:], "implicitfast": q[:-1]}
    for integrator, then in instants.items():
        none = Servo().setpoints(leg, gains, wanted, integrator)
        np.testing.assert_array_equal(none, then)
        shaped = Servo(feedforward="velocity").setpoints(leg, gains, wanted, integrator)
        np.testing.assert_allclose(shaped, then + lead, rtol=0, atol=1e-15)  # rounding


def test_controller_of_another_package_drives_the_leg(plug: Plug) -> None:
    plug("strangers", {"ahead": "strangers:Ahead"})
    assert set(control.known()) >= {"servo", "ahead"}
    scenario = load("controller.name=ahead")
    assert isinstance(scenario.controller, control.Setpoints)
    assert scenario.table()["controller"] == {"name": "ahead", "lead": 0.0}
    ours = rollout.run(load())
    theirs = rollout.run(scenario)
    np.testing.assert_array_equal(theirs.record["foot_x"], ours.record["foot_x"])
    lead = load("controller={name='ahead', lead=0.01}")
    assert msgspec.to_builtins(lead.controller) == {"lead": 0.01}
    np.testing.assert_allclose(rollout.plan(lead).ctrl, rollout.plan(scenario).ctrl + 0.01)


def test_package_installed_meanwhile_is_found(plug: Plug, tmp_path: Path) -> None:
    plug("strangers", {"ahead": "strangers:Ahead"})
    assert "later" not in control.known()
    info = tmp_path / "strangers" / "more-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: more\nVersion: 1.0\n", encoding="utf-8")
    entry = "[fivebar_sim.controllers]\nlater = strangers:Ahead\n"
    (info / "entry_points.txt").write_text(entry, encoding="utf-8")
    assert "later" in control.known()


def test_another_name_keeps_the_keys_that_both_have(plug: Plug) -> None:
    plug("strangers", {"ahead": "strangers:Ahead"})
    switched = load("controller.feedforward=velocity", "controller.name=ahead")
    assert msgspec.to_builtins(switched.controller) == {"lead": 0.0}
    back = load("controller={name='ahead', lead=1}", "controller.name=servo")
    assert back.controller == Servo()


# edge


def test_one_controller_seen_twice_is_one(plug: Plug) -> None:
    plug(
        "strangers", {"servo": "fivebar_controllers.servo:Servo"}
    )  # as from two copies of one package
    assert control.find("servo") is Servo


# refusal


def test_two_controllers_of_one_name_are_refused(plug: Plug) -> None:
    plug("strangers", {"servo": "strangers:Ahead"})
    message = refused()
    assert "two controllers are called 'servo': " in message
    assert "strangers:Ahead" in message
    assert "fivebar_controllers.servo:Servo" in message


def test_unknown_controller_is_refused_with_the_known_ones(plug: Plug) -> None:
    plug("strangers", {"ahead": "strangers:Ahead"})
    assert refused("controller.name=ahaed") == (
        "classic-ellipse: controller.name: unknown controller 'ahaed'; known: ahead, "
        "computed_torque, gain_schedule, gravity_compensation, impedance, pd, servo "
        "(did you mean 'ahead'?)"
    )


@pytest.mark.parametrize(
    ("kind", "came"),
    [("shape", "(799, 2)"), ("nan", "(800, 2)"), ("inf", "(800, 2)")],
)
def test_setpoints_of_wrong_shape_or_not_finite_are_refused(
    plug: Plug, kind: str, came: str
) -> None:
    plug("strangers", {"wrong": "strangers:Wrong"})
    message = refused(f"controller={{name='wrong', kind='{kind}'}}")
    assert message.startswith(
        "controller 'wrong' must plan finite setpoints [rad] of shape (800, 2)"
    )
    assert came in message


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
def test_torque_that_would_need_a_setpoint_turns_away_is_refused(integrator: str) -> None:
    """500 kg at the foot: tau / kp is 15 to 20 rad, and the run passed as if a servo took that."""
    heavy = ("controller.feedforward=torque", f"sim.integrator={integrator}")
    said = refused(*heavy, "scene={kind='payload', mass=500}")
    assert said.startswith(
        "controller 'servo' must plan setpoints within 3.142 rad (half a turn) of the motors' "
        "angles, got one for E that is "
    )
    assert float(re.findall(r"that is (\S+) rad away at t = 0 s; ", said)[0]) > 14.0
    assert said.endswith("is servo.kp = 8 N m/rad too soft for the load?")
    stiff = [*heavy, "scene={kind='payload', mass=500}", "servo.kp=80"]
    plan = rollout.plan(Scenario.load("classic-ellipse", stiff))
    assert plan.setpoints is not None
    assert 1.5 < np.abs(plan.setpoints - plan.motion.q[1:, ::2]).max() < np.pi


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (
            "singular",
            "path comes to a singular pose at t = 0.003 s, foot at (0.00, -80.00) mm: B, C and D "
            "are in line",
        ),
        ("somewhere", "B, C and D are in line"),
    ],
)
def test_singular_pose_that_a_controller_meets_says_when_and_where(
    plug: Plug, kind: str, said: str
) -> None:
    plug("strangers", {"wrong": "strangers:Wrong"})
    with pytest.raises(SingularError) as caught:
        rollout.plan(load(f"controller={{name='wrong', kind='{kind}'}}"))
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("raise", "controller 'wrong' failed: RuntimeError: out of coffee"),
        ("refuse", "controller.gain must be in [0, 1], got 2"),
    ],
)
def test_controller_that_fails_is_one_line_and_its_own_refusal_stays(
    plug: Plug, kind: str, said: str
) -> None:
    plug("strangers", {"wrong": "strangers:Wrong"})
    assert refused(f"controller={{name='wrong', kind='{kind}'}}") == said


@pytest.mark.parametrize(
    ("value", "code", "message"),
    [
        ("strangers:Gone", LAW, "cannot load controller 'odd' from strangers:Gone: Attribute"),
        ("nowhere:Law", LAW, "cannot load controller 'odd' from nowhere:Law: ModuleNotFound"),
        ("strangers:Law", "1 / 0", "cannot load controller 'odd' from strangers:Law: ZeroDivision"),
        ("strangers:Law", "def", "cannot load controller 'odd' from strangers:Law: SyntaxError"),
        ("strangers:law", LAW, "controller 'odd': strangers:law must be a msgspec Struct with"),
        ("strangers:Silent", LAW, "controller 'odd': strangers:Silent must be a msgspec Struct"),
    ],
)
def test_what_is_no_controller_is_refused(plug: Plug, value: str, code: str, message: str) -> None:
    plug("strangers", {"odd": value}, code)
    with pytest.raises(ConfigError) as caught:
        control.find("odd")
    assert str(caught.value).startswith(message)


def test_command_finds_a_controller_and_refuses_its_nonsense(plug: Plug, tmp_path: Path) -> None:
    plug("strangers", {"wrong": "strangers:Wrong"})
    command = [str(Path(sys.executable).with_name("fivebar")), "run", "classic-ellipse"]
    done = subprocess.run(
        [*command, "--out", "run", "--set", "duration=0.8", "--set", "controller.name=wrong"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "strangers")},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "fivebar: classic-ellipse: controller 'wrong' must plan finite setpoints [rad] of shape "
        "(800, 2), got float64 of shape (799, 2)\n"
    )
    assert not (tmp_path / "run").exists()
