"""Which way the leg is folded, and whether that changed during a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from fivebar_sim import kinematics
from fivebar_sim.arrays import Array, blocks
from fivebar_sim.geometry import FiveBar
from fivebar_sim.metrics.columns import JOINT_COLUMNS, side_by_side
from fivebar_sim.metrics.json_types import Amount, Count, Sign, Table


class Branch(Table, frozen=True):
    """The branch of a run's last step.

    Attributes:
        working_mode: (s_A, s_E).
        assembly: Side of the line B-D that C is on.
        flips: Steps after which the branch was another one.
        first_flip: When it first changed [s]; None if it never did.
    """

    working_mode: Annotated[list[Sign], msgspec.Meta(min_length=2, max_length=2)]
    assembly: Sign
    flips: Count
    first_flip: Amount


def signs(leg: FiveBar, points: kinematics.Points) -> NDArray[np.int8]:
    """Return s_A, s_E and the assembly of poses, given their joints, (3, N)."""
    return np.array(kinematics.branch(leg, points), dtype=np.int8)


def signs_of(leg: FiveBar, record: Mapping[str, Array]) -> NDArray[np.int8]:
    """Return the `signs` of a record's poses, (3, N)."""
    found = np.empty((3, len(record["time"])), dtype=np.int8)
    for rows in blocks(found.shape[1]):
        q = side_by_side({name: record[name][rows] for name in JOINT_COLUMNS}, JOINT_COLUMNS)
        found[:, rows] = signs(leg, kinematics.chain_points(leg, q))
    return found


def measure(
    leg: FiveBar, record: Mapping[str, Array], known: NDArray[np.int8] | None = None
) -> Branch:
    """Return the branch of the last step, how often it flipped, and when first.

    Every step is compared with the one before, the first with the leg's own branch.

    Args:
        leg: The leg.
        record: The columns of rollout.parquet.
        known: Its `signs_of`, if somebody has them already.
    """
    every = signs_of(leg, record) if known is None else known
    # Beginning with the leg's own branch, a start in another one counts as a flip.
    own = np.array([[*leg.mode, leg.assembly]], dtype=np.int8).T
    flipped = np.any(np.diff(every, axis=1, prepend=own) != 0, axis=0)
    s_A, s_E, assembly = every[:, -1].tolist()
    return Branch(
        working_mode=[s_A, s_E],
        assembly=assembly,
        flips=int(flipped.sum()),
        first_flip=float(record["time"][np.argmax(flipped)]) if flipped.any() else None,
    )
