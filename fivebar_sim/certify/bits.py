"""The firmware's own answers: what a program that is the firmware gives to the last bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fivebar_sim import firmware
from fivebar_sim.arrays import Array
from fivebar_sim.certify import suite
from fivebar_sim.certify.suite import Case
from fivebar_sim.firmware import Status
from fivebar_sim.geometry import FiveBar

WORDS = {
    Status.UNREACHABLE: "unreachable",
    Status.LOOP_OPEN: "open",
    Status.SINGULAR: "singular",
}
"""How a status is said; any other is "refused"."""


def answers(leg: FiveBar, cases: Sequence[Case]) -> list[str]:
    """Return the firmware's answer to each question as a line, `ok` and hex floats or a refusal."""
    held = firmware.of(leg)
    lines = [""] * len(cases)
    for kind in {case.kind for case in cases}:
        rows = [k for k, case in enumerate(cases) if case.kind == kind]
        inputs = np.array([[float.fromhex(w) for w in cases[k].inputs] for k in rows])
        numbers, statuses = _solve(held, kind, inputs)
        for row, found, status in zip(rows, numbers, statuses, strict=True):
            lines[row] = _line(found, Status(int(status)))
    return lines


def _solve(held: firmware.Leg, kind: str, inputs: Array) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers, (n, m), and statuses, (n,), of questions of one kind."""
    # A number beyond float32 is infinite in it, as it is in C.
    with np.errstate(over="ignore"):
        values = inputs.astype(np.float32)
    if kind == "nearest":
        return firmware.nearest(held, values)

    first = inputs[:, 0].astype(int)
    if kind == "inverse":
        return firmware.inverse(held, values[:, 2:4], first, inputs[:, 1].astype(int))

    theta = values[:, 1:3]
    if kind == "knees":
        B, D, status = firmware.knees(held, theta)
        return np.concatenate([B, D], axis=1), status
    if kind == "forward":
        return firmware.forward(held, theta, first)
    if kind == "torque":
        return firmware.torque(held, theta, first, values[:, 3:5])

    J, status = firmware.jacobian(held, theta, first)
    return J.reshape(-1, 4), status


def _line(numbers: np.ndarray, status: Status) -> str:
    if status != Status.OK:
        return WORDS.get(status, "refused")
    return " ".join(["ok", *(float(number).hex() for number in numbers)])


def same(one: str, other: str) -> bool:
    """Return whether two answers are the same numbers to the bit, or the same refusal."""
    words = [line.split() for line in (one, other)]
    if words[0] == words[1]:
        return True
    try:
        numbers = [np.array([suite.number(w) for w in each[1:]], np.float32) for each in words]
    except (ValueError, OverflowError):
        return False
    return words[0][:1] == words[1][:1] and numbers[0].tobytes() == numbers[1].tobytes()
