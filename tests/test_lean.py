"""What MuJoCo leaves out of a leg's steps: the states keep their bits, and the clock comes back."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from fivebar_sim import model
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.geometry import FiveBar
from fivebar_sim.scenario.scenes import Rail
from fivebar_sim.simulation import lean
from fivebar_sim.simulation.limits.limited import STATE
from fivebar_sim.simulation.steps import Legs

CLASSIC = FiveBar.load("classic")
OFF = mujoco.mjtDisableBit


def starts(built: mujoco.MjModel) -> Array:
    """Return the rest pose of a model."""
    return built.key("home").qpos[None].copy()


def commands(built: mujoco.MjModel, steps: int) -> Array:
    """Return commands that move the motors about their rest."""
    rest = built.key("home").ctrl
    swing = 0.3 * np.sin(0.05 * np.arange(steps))
    return (rest + swing[:, None] * np.isin(np.arange(built.nu), [built.nu - 1]))[None]


# law


@pytest.mark.parametrize("integrator", ["discrete", "implicitfast"])
@pytest.mark.parametrize("scene", ["air", "payload", Rail(mass=0.5, drop=0.01, friction=1.0)])
@pytest.mark.parametrize("friction", [0.0, 0.01])
def test_states_keep_their_bits(scene: Any, integrator: Any, friction: float) -> None:
    """A plain batch on the model as it was built, beside the legs: also while the foot lands."""
    servo = Servo(friction=friction)
    built = model.build(CLASSIC, scene=scene, integrator=integrator, servo=servo)
    ctrl = commands(built, 300)
    batch = Batch(built, 1, 1)
    batch.qpos = starts(built)
    full = batch.rollout(300, ctrl, record=(STATE, "qfrc_constraint", "sensordata"))
    states = Legs(built, starts(built)).advance(ctrl)
    np.testing.assert_array_equal(states.qpos, full[STATE][..., 1 : 1 + built.nq])
    np.testing.assert_array_equal(states.qvel, full[STATE][..., 1 + built.nq :])
    np.testing.assert_array_equal(states.constraint, full["qfrc_constraint"])
    if states.ground.size:
        at = built.sensor("ground").adr[0] + 1
        np.testing.assert_array_equal(states.ground, full["sensordata"][..., [at, at + 2]])
        assert states.ground[..., 1].max() > 0.0


@pytest.mark.parametrize(
    ("scene", "servo", "kept"),
    [
        ("air", Servo(), set()),
        ("payload", Servo(), set()),
        ("air", Servo(friction=0.01), {OFF.mjDSBL_FRICTIONLOSS}),
        ("rail", Servo(), {OFF.mjDSBL_CONTACT, OFF.mjDSBL_SENSOR}),
        ("treadmill", Servo(), {OFF.mjDSBL_CONTACT, OFF.mjDSBL_SENSOR}),
    ],
)
def test_what_acts_or_is_recorded_is_kept(scene: str, servo: Servo, kept: set[Any]) -> None:
    chosen = {OFF.mjDSBL_CONTACT, OFF.mjDSBL_SENSOR, OFF.mjDSBL_FRICTIONLOSS, OFF.mjDSBL_SPRING}
    flags = lean.left_out(model.build(CLASSIC, scene=scene, servo=servo))
    assert {flag for flag in chosen if not flags & flag.value} == kept


@pytest.mark.parametrize("scene", ["air", "payload", "rail", "treadmill"])
def test_time_angles_and_rates_are_all_of_the_state(scene: str) -> None:
    built = model.build(CLASSIC, scene=scene, servo=Servo())
    whole = mujoco.mj_stateSize(built, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    assert mujoco.mj_stateSize(built, STATE) == whole == 1 + built.nq + built.nv


def test_motion_alone_has_the_same_bits_without_the_grounds_force() -> None:
    built = model.build(CLASSIC, scene=Rail(mass=0.5, drop=0.01, friction=1.0))
    assert lean.left_out(built, forces=False) & OFF.mjDSBL_SENSOR.value
    ctrl = commands(built, 100)
    states = Legs(built, starts(built)).advance(ctrl)
    qpos, qvel, warnings = Legs(built, starts(built), forces=False).moved(ctrl)
    np.testing.assert_array_equal(qpos, states.qpos)
    np.testing.assert_array_equal(qvel, states.qvel)
    np.testing.assert_array_equal(warnings, states.warnings)


def test_spring_that_somebody_adds_is_kept() -> None:
    for name in ("jnt_stiffness", "tendon_stiffness"):
        built = model.build(CLASSIC)
        assert lean.left_out(built) & OFF.mjDSBL_SPRING.value
        getattr(built, name)[0] = 0.1
        assert not lean.left_out(built) & OFF.mjDSBL_SPRING.value


def test_floor_that_the_foot_can_reach_is_kept() -> None:
    """The foot's ball, hung straight down with its links in line, just touches it or does not."""
    built = model.build(CLASSIC)
    assert not lean.can_touch(built)
    foot = built.geom("foot")
    A = built.body("L1").pos
    reach = np.linalg.norm(A) + CLASSIC.L1 + np.linalg.norm(foot.pos) + CLASSIC.foot_radius
    for height, touches in ((reach * (1.0 + 1e-9), False), (reach * (1.0 - 1e-9), True)):
        built.body("hip").pos[2] = height
        assert lean.can_touch(built) == touches


def test_geoms_of_a_leg_that_collide_are_kept() -> None:
    built = model.build(CLASSIC)
    built.geom("L3").conaffinity[:] = 1
    assert lean.can_touch(built)


def test_geoms_that_are_only_seen_have_no_part_in_the_search_for_contacts() -> None:
    built = model.build(CLASSIC, scene="rail")
    names = {built.geom(i).name for i in np.flatnonzero(lean.only_seen(built))}
    assert names == {"trunk", "L1", "L2", "L3", "L4", "L5"}
    (short,) = lean.lean([built])
    drawn = [short.geom(name).bodyid.item() for name in sorted(names)]
    assert drawn == [0] * len(names)
    assert short.geom("foot").bodyid == short.body("L2").id
    assert built.geom("L3").bodyid == built.body("L3").id


def test_geom_that_acts_is_not_only_seen() -> None:
    """It collides, in general or with one other, winds a tendon, or meets air."""
    wound = (
        '<worldbody><site name="a" pos="1 0 0"/><site name="b" pos="-1 0 0"/>'
        '<geom name="drawn" size="0.1" contype="0" conaffinity="0"/>'
        '<geom name="spool" size="0.1" contype="0" conaffinity="0"/>'
        '<body name="ball" pos="0 0 1"><freejoint/>'
        '<geom name="ball" size="0.1" contype="0" conaffinity="0"/></body></worldbody>'
        '<contact><pair geom1="ball" geom2="drawn"/></contact>'
        '<tendon><spatial><site site="a"/><geom geom="spool"/><site site="b"/></spatial></tendon>'
    )
    for left, xml in {
        0: wound,
        1: wound.replace('<geom geom="spool"/>', ""),
        2: wound.replace('<pair geom1="ball" geom2="drawn"/>', ""),
    }.items():
        built = mujoco.MjModel.from_xml_string(f"<mujoco>{xml}</mujoco>")
        assert lean.only_seen(built).sum() == left

    leg = model.build(CLASSIC)
    for name in ("contype", "conaffinity"):
        getattr(leg.geom("L3"), name)[:] = 1
        assert not lean.only_seen(leg)[leg.geom("L3").id]
        getattr(leg.geom("L3"), name)[:] = 0
        assert lean.only_seen(leg)[leg.geom("L3").id]
    leg.opt.density = 1.2
    assert not lean.only_seen(leg).any()


def test_equal_models_are_one_and_others_are_not() -> None:
    """Whether they follow each other or not."""
    built = [model.build(CLASSIC) for _ in range(4)]
    built[2].body("L2").mass[:] *= 1.0 + 1e-15
    one, next_one, other, last = lean.lean(built)
    assert one is next_one
    assert one is last
    assert other is not one
    assert other.body("L2").mass == built[2].body("L2").mass


# the clock


def clock() -> int | None:
    found = lean._clock()
    assert found is not None  # MuJoCo's own wheel has it
    return found.value


def test_clock_stands_while_legs_are_stepped_and_is_there_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = clock()
    assert before is not None
    seen = []
    rollout = Batch.rollout
    monkeypatch.setattr(
        Batch, "rollout", lambda *args, **keys: (seen.append(clock()), rollout(*args, **keys))[1]
    )
    built = model.build(CLASSIC)
    Legs(built, starts(built)).advance(commands(built, 3))
    assert seen == [None]
    assert clock() == before


def test_clock_is_there_again_whatever_happens() -> None:
    before = clock()
    with pytest.raises(KeyboardInterrupt), lean.without_clock():
        raise KeyboardInterrupt
    assert clock() == before
    with lean.without_clock():
        with lean.without_clock():
            assert clock() is None
        assert clock() is None
    assert clock() == before


def test_clock_of_two_threads_comes_back_with_the_last() -> None:
    """They end in the order in which they began, which no nesting does."""
    before = clock()
    first = lean.without_clock()
    second = lean.without_clock()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert clock() is None
    second.__exit__(None, None, None)
    assert clock() == before
