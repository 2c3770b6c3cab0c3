"""Numbers on a page besides the metrics."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from fivebar_sim.arrays import Array
from fivebar_sim.control import Feedback
from fivebar_sim.control.servo import Drive
from fivebar_sim.files import tables
from fivebar_sim.metrics import load
from fivebar_sim.metrics.catalogue import LISTED, SHOWN
from fivebar_sim.metrics.columns import motors
from fivebar_sim.metrics.limits import Limit, has, judge
from fivebar_sim.metrics.tracking import tracking_error
from fivebar_sim.recording.plots import SHARE_WINDOW
from fivebar_sim.runs.stored import StoredRun

PERCENTILE = 95.0
"""Percentile of the tracking error that is shown beside its RMS."""

IN_VIEW = 3.0
"""A torque limit is drawn if it is at most this many times the largest torque."""


def name_of(run: StoredRun) -> str:
    """Return the name of a run's directory, with printable characters only."""
    # Path.resolve raises on a loop of links.
    name = os.path.basename(os.path.realpath(run.path))
    return "".join(letter if letter.isprintable() else "?" for letter in name)


def keys(run: StoredRun) -> list[str]:
    """Return the keys of the metrics to list of a run, in reading order.

    Those that the run has, and those that repeat another if they have a limit.
    """
    listed = {*LISTED, *run.scenario.limits}
    return [key for key in SHOWN if key in listed and has(run.metrics, key)]


def limits(run: StoredRun) -> list[Limit]:
    """Return every limit of the scenario with its value."""
    return judge(run.metrics, run.scenario.limits)


def percentile(run: StoredRun) -> float:
    """Return the tracking error that 95 % of the measured steps stay below [m]."""
    error = tracking_error(run.record)[run.scenario.window]
    return float(np.percentile(error, PERCENTILE))


def share(run: StoredRun) -> Array:
    """Return A's share of the load in a moving window, NaN where there is no load, (N,)."""
    torque = motors(run.record, "torque")
    half = round(0.5 * SHARE_WINDOW / run.scenario.sim.timestep)
    values, loaded = load.moving_share(torque, half)
    drawn = np.full(len(loaded), np.nan)
    drawn[loaded] = values
    return drawn


def drive(run: StoredRun) -> Drive:
    """Return whether the motors were sent angles or torques."""
    controller = run.scenario.controller
    return controller.drive if isinstance(controller, Feedback) else "position"


def torque_band(run: StoredRun, motor: str) -> tuple[Array, Array] | None:
    """Return the least and the largest torque of a motor at its rate [N m], (N,) each.

    MuJoCo clips by the state at the start of a step, so a step may end a little beyond. Returns
    None for a servo without a limit.
    """
    if run.scenario.servo.limit is None:
        return None
    return band_at(run, run.record[f"theta_dot_{motor}"])


def band_at(run: StoredRun, rate: Array) -> tuple[Array, Array]:
    """Return the least and the largest torque of the run's servo at some rates [N m].

    With the servo's limit and its damping c at the rate v (see `servo.Servo`):

        -limit - c v,   limit - c v

    Args:
        run: A run whose servo has a limit.
        rate: v [rad/s].
    """
    servo = run.scenario.servo
    assert servo.limit is not None
    lost = servo.passive(drive(run)) * rate
    return -servo.limit - lost, servo.limit - lost


def power(run: StoredRun, motor: str) -> Array:
    """Return the mean mechanical power of a motor in each step [W], (N,).

    The torque is constant over a step, which turns the motor by the difference of its angles.
    """
    h = run.scenario.sim.timestep
    theta = run.record[f"theta_{motor}"]
    # The record begins after the first step: its turn is that of the rate it ended with.
    turned = np.diff(theta, prepend=theta[0] - h * run.record[f"theta_dot_{motor}"][0])
    return run.record[f"torque_{motor}"] * turned / h


def flat_metrics(run: StoredRun) -> dict[str, Any]:
    """Return every metric by its dotted key, but for those with tables of their own."""
    apart = ("verdict", "limits", "guards", "provenance")
    return dict(tables.flat({key: value for key, value in run.metrics.items() if key not in apart}))
