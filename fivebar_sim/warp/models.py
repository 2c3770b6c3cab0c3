"""Models of legs on a device: one structure, with each leg's own numbers."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np

from fivebar_sim.simulation.lean import lean
from fivebar_sim.warp.device import mujoco_warp, on, warp

UNKNOWN_FLAGS = (
    mujoco.mjtDisableBit.mjDSBL_AUTORESET.value | mujoco.mjtDisableBit.mjDSBL_MIDPHASE.value
)
"""Flags that MuJoCo Warp refuses: it never resets a leg by itself, and knows no such phase."""

UNREAD = ("dof_length", "key_qpos", "key_ctrl")
"""What no step reads: lengths for legs that sleep, which none does, and the keyframes."""

ITERATIONS = 20
"""Most iterations of the solver on the processor, where Warp takes all of them, needed or not.

A leg's steps take up to 5; on a card a loop ends with the last leg, and the model's own limit
holds.
"""


def lean_models(models: Sequence[mujoco.MjModel], *, forces: bool = True) -> list[mujoco.MjModel]:
    """Return copies without what nobody sees, as on the processor, that Warp does not refuse.

    Args:
        models: The models.
        forces: Whether the ground's force is recorded.
    """
    found: dict[int, mujoco.MjModel] = {}
    shorts = lean(models, forces=forces)
    for short in shorts:
        if id(short) not in found:
            known = copy.copy(short)
            known.opt.disableflags &= ~UNKNOWN_FLAGS
            found[id(short)] = known
    return [found[id(short)] for short in shorts]


def put(models: Sequence[mujoco.MjModel], device: Any) -> Any:
    """Return the model of some legs on a device, each with its own numbers.

    Args:
        models: The lean models, of one structure (`structure`).
        device: Warp's device.
    """
    with on(device):
        whole = mujoco_warp().put_model(models[0])
        # It would print at each step that ends at the limit; the guards see these steps.
        whole.opt.warn_overflow = 0
        if device.is_cpu:
            whole.opt.iterations = ITERATIONS
        for owner, name in _numbers(whole):
            _spread(owner, name, models)
    return whole


def structure(model: mujoco.MjModel) -> tuple[bytes, ...]:
    """Return what models must have in common to be stepped together on a device.

    That is all of a model that Warp keeps once for all legs.
    """
    types = mujoco_warp().Model
    options = mujoco_warp().Option
    found = []
    for owner, kind in ((model, types), (model.opt, options)):
        for field in dataclasses.fields(kind):
            if field.name in UNREAD or _is_number(field) or not hasattr(owner, field.name):
                continue
            value = getattr(owner, field.name)
            if isinstance(value, int | np.ndarray):
                found.append(np.asarray(value).tobytes())
    return tuple(found)


def _numbers(whole: Any) -> Iterator[tuple[Any, str]]:
    """Yield the fields of a model on a device that may differ from leg to leg, with their owner."""
    for owner in (whole, whole.opt):
        for field in dataclasses.fields(owner):
            if _is_number(field):
                yield owner, field.name


def _is_number(field: dataclasses.Field[Any]) -> bool:
    """Return whether a field may differ from leg to leg: its first length is a "*" there."""
    shape = getattr(field.type, "shape", ())
    return bool(shape) and shape[0] == "*"


def _spread(owner: Any, name: str, models: Sequence[mujoco.MjModel]) -> None:
    """Give each leg its own values of a field, if they differ."""
    each = {id(model): _value(model, name) for model in models}
    first = each[id(models[0])]
    if first is None or all(np.array_equal(first, value) for value in each.values()):
        return

    now = getattr(owner, name)
    values = np.stack([each[id(model)] for model in models])
    one = now.numpy()
    host = values.reshape(len(models), *one.shape[1:]).astype(one.dtype)
    setattr(owner, name, warp().array(host, dtype=now.dtype))


def _value(model: mujoco.MjModel, name: str) -> Any:
    """Return a model's field, or its options'; None if it has none of that name."""
    owner = model if hasattr(model, name) else model.opt
    found = getattr(owner, name, None)
    return None if found is None else np.asarray(found)


def most_rows(model: mujoco.MjModel) -> int:
    """Return the most rows that the constraints of a leg can have at once.

    The loop's three, one for each limit and each friction, and three of the foot on the floor.
    """
    limits = int(model.jnt_limited.sum() + model.tendon_limited.sum())
    return 3 * int(model.neq) + limits + int(model.nv) + 3
