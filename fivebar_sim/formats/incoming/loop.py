"""Finds the five-bar in a tree of bodies: five links around, five hinges between them.

Bodies that no joint moves against each other are one link, and so are two that are welded. Links
and hinges are numbered once around: hinge k is between link k and link k + 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mujoco

from fivebar_sim.errors import ConfigError, unknown
from fivebar_sim.formats.incoming.source import HINGE, Closure, Source

FIVE = 5
CLOSING = -1
"""Number of the hinge that is a closure, not a joint."""


class Loop(NamedTuple):
    """The loop of a five-bar.

    Attributes:
        links: The bodies of each link, five times around: ground, L1, L2, L3, L4.
        hinges: The joints between them: A, B, C, D, E; `CLOSING` for the closure.
        closure: What closes the loop.
        welded: The bodies that a weld puts elsewhere than the tree has them: those of the far half
            of the welded link; empty without a weld.
    """

    links: tuple[tuple[int, ...], ...]
    hinges: tuple[int, ...]
    closure: Closure
    welded: tuple[int, ...]


def find(source: Source, motors: tuple[str, str] | None, name: str | None) -> Loop:
    """Return the loop of a leg, beginning at its first motor.

    Args:
        source: The model.
        motors: Names of the driven joints A and E; None: those with motors, in any order.
        name: Name of the closure, where there are several.

    Raises:
        ConfigError: No closed loop or several, not five hinges, or not two motors on one link.
    """
    loop = _around(source, _only(source, name))
    _check_hinges(source, loop)
    driven = _driven(source, loop, motors)
    # The chains begin at the ground: its hinges are the first and the last.
    ends = [loop.hinges[0], loop.hinges[-1]]
    if set(driven) != set(ends):
        ground = source.model.body(loop.links[0][-1]).name or "the world"
        said = " and ".join(_name(source, loop, joint) for joint in driven)
        raise ConfigError(
            f"{source.path}: both motors must turn against the ground, {ground}, and those at "
            f"{said} do not"
        )
    return loop if ends == driven else reversed_loop(loop)


def reversed_loop(loop: Loop) -> Loop:
    """Return a loop the other way around: A and E, B and D, L1 and L4, L2 and L3 change places."""
    return loop._replace(links=loop.links[:1] + loop.links[:0:-1], hinges=loop.hinges[::-1])


def _only(source: Source, name: str | None) -> Closure:
    """Return the closure of the leg; several at one place are one."""
    closures = source.closures
    if not closures:
        raise ConfigError(
            f"{source.path} has no closed loop: no equality connect or weld of two bodies"
        )
    if name is not None:
        known = {part: each for each in closures for part in (each.name, *each.name.split("-"))}
        if name not in known:
            raise ConfigError(f"{source.path}: {unknown('loop', name, [c.name for c in closures])}")
        return known[name]

    tops = source.model.body_weldid
    pairs = {frozenset((int(tops[c.one.body]), int(tops[c.other.body]))) for c in closures}
    if len(pairs) > 1:
        said = ", ".join(each.name for each in closures)
        raise ConfigError(
            f"{source.path} has {len(pairs)} closed loops, {said}: a leg has one; name it with "
            "--loop"
        )
    return closures[0]


def _around(source: Source, closure: Closure) -> Loop:
    """Return links and hinges around a loop, beginning where both of its chains begin."""
    model = source.model
    there = _chain(model, closure.one.body)
    back = _chain(model, closure.other.body)
    # Above the last link that both chains pass, they are one.
    while len(there) > 1 and len(back) > 1 and there[-2] == back[-2]:
        there.pop()
        back.pop()
    if there[0] == back[0]:
        raise ConfigError(f"{source.path}: {closure.name} joins a link to itself: no closed loop")
    # A loop that closes on the link where it begins ends there.
    if len(back) == 1:
        there, back = back, there
        closure = closure._replace(one=closure.other, other=closure.one)

    tops = [*reversed(there), *back[:-1]]
    one = [_hinge_of(source, top) for top in there[:-1]]
    other = [_hinge_of(source, top) for top in back[:-1]]
    links = [_bodies(model, top, tops) for top in tops]
    if not closure.rigid:
        return Loop(tuple(links), (*one[::-1], CLOSING, *other), closure, ())
    # The last link of one chain and the first of the other are one, without a hinge between.
    k = len(there) - 1
    welded = links.pop(k + 1)
    links[k] += welded
    return Loop(tuple(links), (*one[::-1], *other), closure, welded)


def _chain(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the links from a body's up to the world, each by its topmost body."""
    chain = [int(model.body_weldid[body])]
    while chain[-1] != 0:
        chain.append(int(model.body_weldid[model.body_parentid[chain[-1]]]))
    return chain


def _hinge_of(source: Source, top: int) -> int:
    """Return the hinge that moves a link.

    Raises:
        ConfigError: It moves by another joint, or by several.
    """
    model = source.model
    joints = [int(model.body_jntadr[top]) + k for k in range(model.body_jntnum[top])]
    if len(joints) == 1 and model.jnt_type[joints[0]] == HINGE:
        return joints[0]
    kinds = [mujoco.mjtJoint(model.jnt_type[k]).name.removeprefix("mjJNT_") for k in joints]
    raise ConfigError(
        f"{source.path}: body {model.body(top).name!r} must move by one hinge, got "
        f"{' and '.join(kinds).lower()}"
    )


def _bodies(model: mujoco.MjModel, top: int, tops: Sequence[int]) -> tuple[int, ...]:
    """Return a link's bodies: its topmost one, and all below it that are not below other links.

    What hangs on a link by a joint outside the loop counts as fixed to it. What hangs on the first
    of them, the trunk or the world, is no part of the leg.
    """
    found = {top}
    for body in range(1, model.nbody):
        hangs = model.body_parentid[body] in found and body not in tops and top != tops[0]
        if hangs or model.body_weldid[body] == top:
            found.add(body)
    return tuple(sorted(found))


def _check_hinges(source: Source, loop: Loop) -> None:
    """Raise unless five hinges are around the loop."""
    count = len(loop.hinges)
    if count != FIVE:
        raise ConfigError(
            f"{source.path}: a five-bar has five hinges around its loop, this one has {count}: "
            f"{_hinges(source, loop)}"
        )


def _driven(source: Source, loop: Loop, motors: tuple[str, str] | None) -> list[int]:
    """Return the two driven hinges."""
    joints = list(dict.fromkeys(source.joint(name) for name in motors or source.motors))
    driven = [joint for joint in joints if joint in loop.hinges]
    if motors is not None and len(driven) != 2:
        raise ConfigError(
            f"{source.path}: motors must be two hinges of the loop, {_hinges(source, loop)}; got "
            f"{', '.join(motors)}"
        )

    if len(driven) != 2:
        few = "more than two motors" if len(driven) > 2 else "one motor" if driven else "no motors"
        raise ConfigError(
            f"{source.path}: {few} in the loop of {_hinges(source, loop)}; name the two with "
            "--motors A,E"
        )
    return driven


def _hinges(source: Source, loop: Loop) -> str:
    """Return the names of all hinges around a loop."""
    return ", ".join(hinge_name(source, loop, k) for k in range(len(loop.hinges)))


def hinge_name(source: Source, loop: Loop, k: int) -> str:
    """Return the source's name of hinge k."""
    return _name(source, loop, loop.hinges[k])


def _name(source: Source, loop: Loop, joint: int) -> str:
    if joint == CLOSING:
        return loop.closure.name
    return source.model.joint(joint).name or f"joint {joint}"


def outside_joints(source: Source, loop: Loop) -> list[str]:
    """Return the joints that move something on L1 to L4, but are not the loop's."""
    model = source.model
    inside = {body for link in loop.links[1:] for body in link}
    joints = [k for k in range(model.njnt) if k not in loop.hinges]
    return [model.joint(k).name for k in joints if int(model.jnt_bodyid[k]) in inside]
