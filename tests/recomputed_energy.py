"""The energy balance of a run directory, recomputed from its files: part of `recomputed`.

What loop, gears and ends of travel did is not in the record. It follows from the motion: the joint
forces that took the rates v to v' in a step, less those of motors, weight, pushes and ground.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from recomputed_run import Array, Complex, Run, cycle_at

L1, L2, L3, L4 = range(4)


class Body(NamedTuple):
    """A rigid body: its mass, its inertia about its centre, and the link that it turns with.

    Attributes:
        m: [kg].
        inertia: [kg m^2].
        turns: Index of its link.
        arms: Offsets along the chain to its centre, each turning with a link [m].
    """

    m: float
    inertia: float
    turns: int
    arms: tuple[tuple[int, complex], ...]


class Motion(NamedTuple):
    """Unit vectors along the links and their rates [rad/s], (N, 4); height of the hip and rate."""

    along: Complex
    omega: Array
    hip: Array
    lift: Array


def capsule(m_per: float, length: float, radius: float) -> tuple[float, float]:
    """Return mass and inertia about its centre of a capsule of a density."""
    tube = m_per * math.pi * radius**2 * length
    caps = m_per * 4.0 / 3.0 * math.pi * radius**3
    # a half ball's centre is 3/8 r beyond its face, and 83/320 m r^2 its inertia about that
    apart = 0.5 * length + 0.375 * radius
    return (
        tube + caps,
        tube * (radius**2 / 4 + length**2 / 12) + caps * (83 / 320 * radius**2 + apart**2),
    )


def bodies(scenario: dict[str, Any]) -> list[Body]:
    """Return all that moves but the trunk."""
    leg = scenario["leg"]
    lengths = [leg["L1"], leg["L2"], leg["L3"], leg["L4"]]
    before: list[tuple[tuple[int, complex], ...]] = [
        (), ((L1, leg["L1"]),), ((L4, leg["L4"]),), ()
    ]  # fmt: skip
    foot = (L2, leg["L2"] + leg["L6"] * np.exp(1j * leg["bend"]))
    found = [Body(0.0, leg["armature"], link, ()) for link in (L1, L4)]
    for link, length in enumerate(lengths):
        if "mass" in leg:
            m = leg["mass"][link]
            inertia = leg["inertia"][link] if "inertia" in leg else m * length**2 / 12
            centre = leg["com"][link] if "com" in leg else 0.5 * length
        else:
            m, inertia = capsule(leg["density"], length, leg["radius"])
            centre = 0.5 * length
        found.append(Body(m, inertia, link, (*before[link], (link, centre))))

    if "mass" not in leg:
        ball = leg["density"] * 4.0 / 3.0 * math.pi * leg["foot_radius"] ** 3
        inertia = 0.4 * ball * leg["foot_radius"] ** 2
        found.append(Body(ball, inertia, L2, (*before[L2], foot)))
        if leg["L6"]:
            m, inertia = capsule(leg["density"], leg["L6"], leg["radius"])
            middle = leg["L2"] + 0.5 * leg["L6"] * np.exp(1j * leg["bend"])
            found.append(Body(m, inertia, L2, (*before[L2], (L2, middle))))

    scene = scenario["scene"]
    if isinstance(scene, dict) and scene["kind"] == "payload":
        found.append(Body(scene["mass"], 0.0, L2, (*before[L2], foot)))
    return found


def place(body: Body, m: Motion) -> Complex:
    """Return the centre of a body [m], (N,)."""
    return _sum(1j * m.hip, *(arm * m.along[:, k] for k, arm in body.arms))


def speed(body: Body, m: Motion) -> Complex:
    """Return its velocity [m/s], (N,)."""
    turned = (1j * m.omega[:, k] * arm * m.along[:, k] for k, arm in body.arms)
    return _sum(1j * m.lift, *turned)


def pull(body: Body, m: Motion) -> Complex:
    """Return its acceleration at steady rates of the links [m/s^2], (N,)."""
    pulled = (-(m.omega[:, k] ** 2) * arm * m.along[:, k] for k, arm in body.arms)
    return _sum(0j * m.hip, *pulled)


def _sum(*vectors: NDArray[Any]) -> Complex:
    return np.asarray(np.sum(vectors, axis=0), dtype=np.complex128)


def dot(a: Complex, b: Complex) -> Array:
    """Return the scalar product of plane vectors."""
    return (np.conj(a) * b).real


def energies(run: Run) -> dict[str, Any]:
    """Return the table energy of metrics.json, by dotted key."""
    h = run.h
    leg = run.scenario["leg"]
    start, end = _motions(run)
    mean = start._replace(omega=0.5 * (start.omega + end.omega), lift=0.5 * (start.lift + end.lift))
    trunk = _trunk(run)
    weight = complex(*leg["gravity"])
    all_bodies = bodies(run.scenario)

    foot = Body(0.0, 0.0, L2, ((L1, leg["L1"]), _foot(leg)))
    at_foot = speed(foot, mean)
    works = {
        "motor": h * np.sum(run.pair("torque") * mean.omega[:, [L1, L4]], axis=1),
        "force": h * dot(_pushes(run), at_foot),
        "ground": h * dot(_contact(run), at_foot + _roll(run, foot, mean)),
    }

    # Newton's law along the mean rates: what took the rates at a step's start to those at its end
    turned = start._replace(omega=end.omega, lift=end.lift)
    gained = trunk * (end.lift - start.lift) * mean.lift
    fell = h * trunk * weight.imag * mean.lift
    given = np.zeros(len(gained))
    for body in all_bodies:
        along = speed(body, mean)
        spin = end.omega[:, body.turns] - start.omega[:, body.turns]
        gained += body.m * dot(speed(body, turned) - speed(body, start), along)
        gained += body.inertia * spin * mean.omega[:, body.turns]
        gained += h * body.m * dot(pull(body, start), along)
        given -= h * body.m * dot(pull(body, start) - pull(body, mean), along)
        fell += h * body.m * dot(np.array([weight]), along)
    works["constraints"] = gained - fell - works["motor"] - works["force"] - works["ground"]
    works["step"] = given

    # rates belong to the middle of the step that they moved the leg by
    halves = [_half_back(m, h) for m in (start, end)]
    kinetic = [_kinetic(all_bodies, trunk, m) for m in halves]
    height = [_potential(all_bodies, trunk, weight, m) for m in halves]
    works["kinetic"] = kinetic[1] - kinetic[0]
    works["potential"] = height[1] - height[0]
    return {f"energy.{name}": work.sum() for name, work in works.items()} | _balance(works)


def _balance(works: dict[str, Array]) -> dict[str, Any]:
    """Return the turnover, and the largest imbalance as a part of it."""
    did = sum(works[name] for name in ("motor", "force", "ground", "constraints", "step"))
    left = np.cumsum(works["kinetic"] + works["potential"] - did)
    acting = ("motor", "force", "ground", "constraints", "potential")
    turnover = sum(np.abs(works[name]).sum() for name in acting)
    part = np.abs(left).max() / turnover if turnover > 1e-9 else None
    return {"energy.turnover": turnover, "energy.imbalance": part}


def _foot(leg: dict[str, Any]) -> tuple[int, complex]:
    return L2, leg["L2"] + leg["L6"] * np.exp(1j * leg["bend"])


def _trunk(run: Run) -> float:
    return run.scenario["scene"]["mass"] if "hip_z" in run.record else 0.0


def _motions(run: Run) -> tuple[Motion, Motion]:
    """Return the motion before and after every step."""
    r = run.record
    still = np.zeros(len(r["time"]))
    found = []
    for of in (run.before, r.__getitem__):
        q = [of(f"theta_{joint}") for joint in "ABDE"]
        v = [of(f"theta_dot_{joint}") for joint in "ABDE"]
        hip = (of("hip_z"), of("hip_dot_z")) if "hip_z" in r else (still, still)
        found.append(Motion(np.exp(1j * _directions(q)), _directions(v), *hip))
    return found[0], found[1]


def _directions(q: list[Array]) -> Array:
    """Return what belongs to links of what belongs to the joints A, B, D, E: knees are relative."""
    A, B, D, E = q
    return np.column_stack([A, A + B, E + D, E])


def _half_back(m: Motion, h: float) -> Motion:
    back = np.exp(-0.5j * h * m.omega)
    return m._replace(along=m.along * back, hip=m.hip - 0.5 * h * m.lift)


def _kinetic(all_bodies: list[Body], trunk: float, m: Motion) -> Array:
    found = 0.5 * trunk * m.lift**2
    for body in all_bodies:
        found = found + 0.5 * body.m * np.abs(speed(body, m)) ** 2
        found = found + 0.5 * body.inertia * m.omega[:, body.turns] ** 2
    return found


def _potential(all_bodies: list[Body], trunk: float, weight: complex, m: Motion) -> Array:
    found = -trunk * weight.imag * m.hip
    for body in all_bodies:
        found = found - body.m * dot(np.array([weight]), place(body, m))
    return found


def _pushes(run: Run) -> Complex:
    """Return the force on the foot in each step [N], in the scene "payload" alone."""
    force = run.scenario.get("force")
    scene = run.scenario["scene"]
    begun = np.arange(0.0, len(run.record["time"])) * run.h
    if force is None or not (isinstance(scene, dict) and scene["kind"] == "payload"):
        return np.zeros(len(begun), dtype=complex)
    if force["kind"] == "constant":
        return np.full(len(begun), complex(*force["value"]))
    assert force["kind"] == "stance"
    duty = run.scenario["path"]["duty"]
    cycle = cycle_at(run, begun)
    sine = np.where(cycle < duty, np.sin(np.pi * cycle / duty), 0.0)
    return sine * complex(*force["peak"])


def _contact(run: Run) -> Complex:
    """Return the force of the ground on the foot [N]."""
    r = run.record
    if "ground_x" not in r:
        return np.zeros(len(r["time"]), dtype=complex)
    return r["ground_x"] + 1j * r["ground_z"]


def _roll(run: Run, foot: Body, m: Motion) -> Array:
    """Return the velocity of the ball's point of contact against the foot [m/s]."""
    radius = run.scenario["leg"]["foot_radius"]
    E = 0.5 * run.scenario["leg"]["L5"] * np.exp(1j * run.scenario["leg"]["tilt"])
    deep = np.maximum(radius - (place(foot, m) - E).imag, 0.0)
    return (radius - 0.5 * deep) * m.omega[:, L2]
