"""The metrics of a run: foot tracking, loop closure, load of the motors, energy, branch, guards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from fivebar_sim.arrays import Array, Bools, sum_of_columns
from fivebar_sim.control import Feedback
from fivebar_sim.dynamics import creep, heat
from fivebar_sim.errors import PoseError
from fivebar_sim.kinematics.stops import Ranges
from fivebar_sim.metrics import (
    branch,
    catalogue,
    energy,
    ground,
    guards,
    load,
    measured,
    peaks,
)
from fivebar_sim.metrics.columns import (
    GROUND_COLUMNS,
    JOINT_COLUMNS,
    by_motor,
    motors,
    side_by_side,
)
from fivebar_sim.metrics.json_types import Motors, Parts
from fivebar_sim.metrics.measured import Measured
from fivebar_sim.metrics.sharing import Load, Temperatures
from fivebar_sim.paths import Gait
from fivebar_sim.scenario.scenes import Ground

if TYPE_CHECKING:
    from fivebar_sim.scenario import Scenario

DECIMALS = 9
"""Decimals of a phase: far more than a step's part of a period, far fewer than rounding reaches."""


class Unrecorded(NamedTuple):
    """Per-step data that the metrics need and rollout.parquet leaves out.

    Attributes:
        steps: The forces that acted, and the pose at the start.
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        unsolved: Whether MuJoCo's solver ran out of iterations in each step, (N,).
        warnings: Number of MuJoCo's warnings.
        ranges: The ranges of the model's joints, see `stops.beyond`.
        trunk: Height of the trunk's lowest point above the hip frame's origin [m].
        growth: Decades by which errors of the feedback would have grown by each step, unseen,
            (N,); None without feedback. See `sampling.Stability.hidden`.
        jolts: Torque that lasts a single step, as a part of the run's largest, (N,); None in torque
            drive, where a torque lasts as long as the controller's period.
        signs: The branch of each step, see `branch.signs_of`; None: the record tells it.
        heights: Heights of the joints, see `ground.heights_of`; None: the record tells them.
    """

    steps: energy.Steps
    saturated: Bools
    unsolved: Bools
    warnings: int
    ranges: Ranges
    trunk: float
    growth: Array | None = None
    jolts: Array | None = None
    signs: NDArray[np.int8] | None = None
    heights: Mapping[str, Array] | None = None


def measure(scenario: Scenario, record: Mapping[str, Array], besides: Unrecorded) -> Measured:
    """Return the metrics of a run, in SI units.

    Tracking, closure and everything else with a function of its own come from `catalogue`; load
    from `load.measure`, where saturated is the fraction of steps in which the torque limit clipped;
    peaks from `peaks`; energy from `energy.measure`. What each is measured over, the window or the
    whole run, stands in its row of the catalogue; guards look at every step.

    Args:
        scenario: The scenario that was run.
        record: The columns of rollout.parquet.
        besides: What the record leaves out.
    """
    leg = scenario.leg

    body = energy.Body(leg, scenario.payload, scenario.trunk)
    balance = energy.balance(body, record, besides.steps)
    folded = branch.measure(leg, record, besides.signs)
    heated = heating_of(scenario, record)
    checked = guards.Evidence(
        bounds=scenario.guards,
        leg=leg,
        record=record,
        branch=folded,
        saturated=besides.saturated,
        balance=balance,
        unsolved=besides.unsolved,
        command=scenario.command,
        ranges=besides.ranges,
        trunk=besides.trunk,
        crept=_crept(scenario, record),
        heating=heated,
        growth=besides.growth,
        jolts=besides.jolts,
        heights=besides.heights,
    )

    window = scenario.window
    h = scenario.sim.timestep
    grounded = "ground_z" in record
    return measured.of(
        catalogue.measure(leg, record, window),
        window=peaks.Window(begin=window.start * h, end=window.stop * h),
        load=load_of(scenario, record, besides, heated),
        peaks=peaks.measure(record, window),
        whole=peaks.measure_whole(record),
        energy=energy.measure(balance),
        branch=folded,
        guards=guards.judge(checked),
        warnings=int(besides.warnings),
        ground=ground.measure(leg, record, window) if grounded else msgspec.UNSET,
    )


def _crept(scenario: Scenario, record: Mapping[str, Array]) -> Array | None:
    """Return what a creeping foot changes in the torques, (N, 2); None where it does not creep."""
    footing = _footing(scenario)
    if footing is None:
        return None
    course = creep.Course(
        timestep=scenario.sim.timestep,
        q=side_by_side(record, JOINT_COLUMNS),
        rate_A=record["theta_dot_A"],
        ground=side_by_side(record, GROUND_COLUMNS),
        torque=motors(record, "torque"),
    )
    try:
        return creep.changes(scenario.leg, footing, course)
    except PoseError:
        # A leg that has come to lie in line has lost its branch, which has a guard of its own.
        return None


def _footing(scenario: Scenario) -> creep.Footing | None:
    """Return what holds the foot in its place; None where it does not creep."""
    scene = scenario.scene
    if not isinstance(scene, Ground) or scene.friction == 0.0:
        return None
    if scenario.sim.integrator == "discrete":
        return None
    controller = scenario.controller
    # Under a torque drive kd is the controller's: the step does not know it as damping.
    drive = controller.drive if isinstance(controller, Feedback) else "position"
    servo = scenario.servo
    damping = servo.damping if drive == "position" else servo.back_emf
    # The stiffness of a feedback controller is its own; it is taken to be the servo's.
    return creep.Footing(scene.friction, damping, servo.kp)


def heating_of(scenario: Scenario, record: Mapping[str, Array]) -> heat.Heating | None:
    """Return the heat of the motors; None where the servo's table does not describe the winding."""
    winding = scenario.servo.winding
    if winding is None:
        return None
    return heat.heating(motors(record, "torque")[scenario.for_good], winding)


def _warmth(heated: heat.Heating | None) -> dict[str, Any]:
    """Return what the table `load` says of the heat, as far as it is known."""
    if heated is None:
        return {}
    warmth: dict[str, Any] = {"heat": Motors(**by_motor(heated.watts))}
    if heated.temperature is None or heated.continuous is None:
        return warmth
    return warmth | {
        "temperature": Temperatures(**by_motor(heated.temperature)),
        "continuous": Motors(**by_motor(heated.continuous)),
        "survives": heated.used,
    }


def _line(scenario: Scenario, record: Mapping[str, Array]) -> dict[str, Any]:
    """Return how near the motors come to the servo's torque-speed line, where it has one."""
    limit = scenario.servo.limit
    no_load = scenario.servo.speed
    if limit is None or no_load is None:
        return {}
    torque, speed = (motors(record, name)[scenario.window] for name in ("torque", "theta_dot"))
    return {"line": Motors(**by_motor(heat.line_used(torque, speed, limit, no_load)))}


def load_of(
    scenario: Scenario,
    record: Mapping[str, Array],
    besides: Unrecorded,
    heated: heat.Heating | None,
) -> Load:
    """Return how the motors share the load over the window, how hot they get, and more."""
    # qpos may begin with the hip's height; its last four are A, B, E, D.
    start = besides.steps.start[-4::2]
    window = scenario.window
    path = scenario.path
    h = scenario.sim.timestep
    torque = motors(record, "torque")
    theta = motors(record, "theta")
    # The work of a step needs the angles before it too: one row more than the torques.
    turned = np.concatenate([start[None], theta])[window.start : window.stop + 1]
    # A step belongs to the phase it starts in; rounding may put the first start below 0.
    begun = np.maximum(record["time"][window] - h, 0.0)
    phase = stance = None

    if path.period is not None:
        # A step that begins at the edge of two bins must not miss it by rounding.
        cycle = np.round(path.cycle(begun), DECIMALS)
        # What np.mod gives, bit by bit, in a tenth of the time.
        phase = cycle - np.floor(cycle)

    # With a ground the real stance counts, not the planned one.
    if "ground_z" in record:
        stance = ground.stands(record)[window]
    elif isinstance(path, Gait) and phase is not None:
        stance = phase < path.duty

    shared = load.sharing(torque[window], turned, h, stance=stance, phase=phase)
    clips = besides.saturated[window]
    clipped = Parts(**by_motor(sum_of_columns(clips) / len(clips)))
    more = _warmth(heated) | _line(scenario, record)
    return Load(**msgspec.structs.asdict(shared), **more, saturated=clipped)
