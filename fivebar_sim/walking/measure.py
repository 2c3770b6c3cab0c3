"""The metrics of a robot's run: those of a leg, of all four together, and those of its trunk."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np

from fivebar_sim.arrays import Array, Bools
from fivebar_sim.dynamics.heat import Heating
from fivebar_sim.metrics import branch, catalogue, energy, measured, peaks, tracking
from fivebar_sim.metrics.branch import Branch
from fivebar_sim.metrics.columns import Record, motors
from fivebar_sim.metrics.ground import GroundForce, GroundMetrics, longest
from fivebar_sim.metrics.measured import Measured
from fivebar_sim.metrics.sharing import Load
from fivebar_sim.robots import LEGS, Floor, places, together
from fivebar_sim.robots import measured as robots
from fivebar_sim.robots.columns import of_leg
from fivebar_sim.robots.floor import load
from fivebar_sim.robots.ground import Flat
from fivebar_sim.robots.measure import measure as how_it_moved
from fivebar_sim.robots.measured import LegsTable, LegTable, RobotTable
from fivebar_sim.robots.push import recovery
from fivebar_sim.simulation import record as recorded
from fivebar_sim.simulation.measure import Unrecorded, heating_of, load_of
from fivebar_sim.walking import energy as whole_energy
from fivebar_sim.walking.guards import Seen, judge
from fivebar_sim.walking.hip_load import HipLoad, all_heat, hip_loads
from fivebar_sim.walking.walk import Walk, jumped, saturated

NOWHERE = 0.01
"""Body lengths below which a way is none: a cost of transport over it would mean nothing."""


class Leg(NamedTuple):
    """One leg of a run.

    Attributes:
        name: One of `LEGS`.
        record: Its columns as a leg alone has them, without any ground.
        load: How its motors shared the load over the window.
        heated: Their heat; None where the winding is not known.
        saturated: Whether the torque limit clipped A and E in each step, (N, 2).
        branch: How it was folded.
        force: Vertical force of the floor on its foot [N], (N,); None in the air.
        slid: How far the foot slid in each step while it stood [m], (N,); None in the air.
        height: Height of the foot's ball above the floor [m], (N,); None in the air.
    """

    name: str
    record: Record
    load: Load
    heated: Heating | None
    saturated: Bools
    branch: Branch
    force: Array | None
    slid: Array | None
    height: Array | None


def measure(went: Walk) -> Measured:
    """Return the metrics of a robot's run, in SI units.

    Args:
        went: What the robot did.
    """
    planned = went.plan
    window = planned.window
    h = planned.sim.timestep
    legs = [_leg(went, k) for k in range(len(LEGS))]
    balance = whole_energy.balance(went)
    folded = together.branch([leg.branch for leg in legs])
    rows = together.rows([catalogue.measure(planned.robot.leg, leg.record, window) for leg in legs])
    found_peaks = together.peaks([peaks.measure(leg.record, window) for leg in legs])
    whole = together.whole([peaks.measure_whole(leg.record) for leg in legs])
    ground = msgspec.UNSET
    if went.trunk is not None:
        # Nothing but the feet touches the floor.
        rows["ground"] = {"foot_share": 1.0, "rail_end_max": 0.0}
        ground = _ground(went, legs)
        found_peaks = _with_forces(found_peaks, went, legs, window)
        whole = _with_forces(whole, went, legs, slice(None))

    seen = [
        Seen(leg.name, leg.record, leg.branch, leg.saturated, leg.heated, leg.height)
        for leg in legs
    ]
    common = measured.of(
        rows,
        window=peaks.Window(begin=window.start * h, end=window.stop * h),
        load=_load(went, legs),
        peaks=found_peaks,
        whole=whole,
        energy=energy.measure(balance),
        branch=folded,
        guards=judge(went, seen, balance),
        warnings=int(went.states.warnings[0]),
        ground=ground,
    )
    hips = hip_loads(planned, went.record)
    own = LegsTable(**_legs(legs, hips, window))
    return robots.of(common, _robot(went, legs, hips), own)


def _leg(went: Walk, k: int) -> Leg:
    """Return leg k of a run."""
    planned = went.plan
    alone = planned.legs[k]
    name = LEGS[k]
    record = of_leg(went.record, name)
    force = record.pop("ground_z", None)
    record.pop("ground_x", None)
    record.pop("ground_y", None)
    clipped = saturated(went, k)

    steps = energy.Steps(alone.start, np.empty((0, 4)), alone.pushes)
    besides = Unrecorded(
        steps=steps,
        saturated=clipped,
        unsolved=np.zeros(0, dtype=bool),
        warnings=0,
        ranges=recorded.ranges(planned.model, f"{name}_"),
        trunk=0.0,
    )
    heated = heating_of(alone.scenario, record)

    slid = height = None
    if force is not None and went.trunk is not None:
        hip = planned.robot.hips[name]
        scene = planned.scene
        ground = scene.ground if isinstance(scene, Floor) else Flat()
        stands = force > 0.0
        slid = np.where(stands, places.slid(planned.robot, went.trunk, hip, record, ground), 0.0)
        x, y, z = places.feet(went.trunk, hip, record).T
        height = z - planned.robot.leg.foot_radius
        if not ground.level:
            height = height - ground.heights(x, y)
    return Leg(
        name=name,
        record=record,
        load=load_of(alone.scenario, record, besides, heated),
        heated=heated,
        saturated=clipped,
        branch=branch.measure(planned.robot.leg, record),
        force=force,
        slid=slid,
        height=height,
    )


def _load(went: Walk, legs: list[Leg]) -> Load:
    """Return how the motors of all legs shared the load over the window."""
    window = went.plan.window
    torque = [motors(leg.record, "torque")[window] for leg in legs]
    theta = []
    for planned, leg in zip(went.plan.legs, legs, strict=True):
        angles = np.concatenate([planned.start[None, ::2], motors(leg.record, "theta")])
        theta.append(angles[window.start : window.stop + 1])

    stance = None
    if went.trunk is not None:
        stance = [leg.force[window] > 0.0 for leg in legs if leg.force is not None]
    shared = together.sharing(torque, theta, went.plan.sim.timestep, stance, None)
    return together.loads(shared, [leg.load for leg in legs])


def _ground(went: Walk, legs: list[Leg]) -> GroundMetrics:
    """Return the metrics of all feet on the floor: their mean stance, all that they slid."""
    window = went.plan.window
    forces = np.stack([leg.force for leg in legs if leg.force is not None])
    heights = [leg.height for leg in legs if leg.height is not None]
    slips = [leg.slid for leg in legs if leg.slid is not None]
    down = forces > 0.0
    return GroundMetrics(
        force_max=GroundForce(x=_sideways(went, slice(None)), z=float(forces.max())),
        stance_share=float(down[:, window].mean()),
        slip=float(sum(each[window].sum() for each in slips)),
        # A run begins with the lowest foot just on the floor, before its first row.
        foot_height_max=max(0.0, *(float(each.max()) for each in heights)),
        # The robot flies while none of its feet stands.
        flight_max=went.plan.sim.timestep * longest(np.logical_not(np.any(down, axis=0))),
    )


def _sideways(went: Walk, rows: slice) -> float:
    """Return the largest force of the floor along x on any foot in some steps [N]."""
    return float(max(np.abs(went.record[f"{leg}_ground_x"][rows]).max() for leg in LEGS))


def _with_forces(found: Any, went: Walk, legs: list[Leg], rows: slice) -> Any:
    """Return peaks with those of the floor's forces, of the whole run with their times."""
    forces = [leg.force for leg in legs if leg.force is not None]
    z = np.max(forces, axis=0)
    x = np.max([np.abs(went.record[f"{leg}_ground_x"]) for leg in LEGS], axis=0)
    peak = GroundForce(x=float(x[rows].max()), z=float(z[rows].max()))
    with_force = msgspec.structs.replace(found, ground_peak=peak)
    if not isinstance(found, peaks.Whole):
        return with_force
    time = went.record["time"]
    when = GroundForce(x=float(time[np.argmax(x)]), z=float(time[np.argmax(z)]))
    at = msgspec.structs.replace(found.at, ground_peak=when)
    return msgspec.structs.replace(with_force, at=at)


def _robot(
    went: Walk, legs: list[Leg], hips: dict[str, list[HipLoad]]
) -> RobotTable | msgspec.UnsetType:
    """Return how the trunk moved; unset where it was held."""
    if went.trunk is None:
        return msgspec.UNSET
    planned = went.plan
    robot = planned.robot
    window = planned.window
    moved = how_it_moved(went.trunk, window, robot.length, len(went.falls))
    seconds = planned.sim.timestep * (window.stop - window.start)
    way = abs(moved.speed) * seconds
    weight = (robot.mass + load(planned.scene)) * float(np.linalg.norm(planned.model.opt.gravity))

    cost = electric = None
    if way > NOWHERE * robot.length and weight > 0.0:
        works = [leg.load.work for leg in legs]
        given = sum((work.A.positive or 0.0) + (work.E.positive or 0.0) for work in works)
        given += sum(hip_load.work for each in hips.values() for hip_load in each)
        cost = given / (weight * way)
        warm = all_heat(hips)
        if warm is not None and all(leg.heated is not None for leg in legs):
            watts = warm + sum(
                float(leg.heated.watts.sum()) for leg in legs if leg.heated is not None
            )
            electric = (given + watts * seconds) / (weight * way)

    table = RobotTable(
        **msgspec.structs.asdict(moved),
        cost_of_transport=cost,
        cost_of_transport_electric=electric,
    )
    pushes = planned.scenario.pushes
    if pushes:
        over = recovery(went.trunk, pushes, fell=bool(went.falls))
        table = msgspec.structs.replace(table, recovery=over)
    # The flights of a gait are no jumps.
    if planned.scenario.path.period is not None:
        return table
    leap = jumped(went)
    height = None if leap is None else leap.height
    agility = None if leap is None else leap.agility
    return msgspec.structs.replace(table, jump_height=height, agility=agility)


def _legs(legs: list[Leg], hips: dict[str, list[HipLoad]], window: slice) -> dict[str, LegTable]:
    """Return what each leg did over the window."""
    efforts = [float(np.abs(motors(leg.record, "torque")[window]).sum()) for leg in legs]
    weights = [0.0 if leg.force is None else float(leg.force[window].sum()) for leg in legs]
    found = {}

    for leg, effort, weight in zip(legs, efforts, weights, strict=True):
        error = tracking.tracking_error(leg.record)[window]
        besides: dict[str, Any] = {}

        for hip_load in hips[leg.name]:
            besides |= hip_load.table

        if leg.force is not None and leg.slid is not None:
            besides |= {
                "duty": float((leg.force[window] > 0.0).mean()),
                "slip": float(leg.slid[window].sum()),
                "weight_share": weight / sum(weights) if sum(weights) > 0.0 else None,
                "force_peak": float(leg.force[window].max()),
            }

        found[leg.name] = LegTable(
            tracking_rms=tracking.root_mean_square(error),
            torque_rms=leg.load.torque_rms,
            torque_peak=leg.load.torque_peak,
            share_A=leg.load.share_A,
            share_of_robot=effort / sum(efforts) if sum(efforts) > 0.0 else None,
            saturated=leg.load.saturated,
            heat=leg.load.heat,
            **besides,
        )
    return found
