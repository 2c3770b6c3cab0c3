"""What a run is judged by: its metrics, their limits, and the columns that they are taken from."""

from fivebar_sim.metrics.catalogue import GROUND_KEYS, LIMIT_KEYS
from fivebar_sim.metrics.columns import JOINT_COLUMNS, Record
from fivebar_sim.metrics.limits import Limit, judge, look_up
from fivebar_sim.metrics.tracking import left_path, lost_path, tracking_error

__all__ = [
    "GROUND_KEYS",
    "JOINT_COLUMNS",
    "LIMIT_KEYS",
    "Limit",
    "Record",
    "judge",
    "left_path",
    "look_up",
    "lost_path",
    "tracking_error",
]
