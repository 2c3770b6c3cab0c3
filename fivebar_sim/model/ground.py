"""What lies on the floor of a robot's scene, as geoms of MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np

from fivebar_sim.robots.ground import Ground, Rough, Steps

FAR = 10.0
"""How far steps reach to the sides, and the first and the last of them ahead and back [m]."""

THICK = 0.05
"""Of what there is below the lowest surface [m]."""


def lay(spec: mujoco.MjSpec, ground: Ground) -> None:
    """Put the ground on the floor of a robot's scene.

    Args:
        spec: The scene, with its floor.
        ground: What lies on it.
    """
    if isinstance(ground, Steps):
        _steps(spec, ground)
    if isinstance(ground, Rough):
        _rough(spec, ground)


def _steps(spec: mujoco.MjSpec, ground: Steps) -> None:
    """Put a box under every step that is higher than the floor, which goes down with them."""
    floor = min(0.0, ground.count * ground.height)
    spec.geom("floor").pos[2] = floor
    ends = [-FAR, *ground.edges.tolist(), ground.edges[-1] + FAR]
    for k in range(ground.count + 1):
        top = k * ground.height
        if top <= floor:
            continue
        half = np.array([0.5 * (ends[k + 1] - ends[k]), FAR, 0.5 * (top - floor + THICK)])
        middle = (0.5 * (ends[k] + ends[k + 1]), 0.0, top - half[2])
        _geom(spec, f"step_{k}", mujoco.mjtGeom.mjGEOM_BOX, pos=middle, size=half)


def _rough(spec: mujoco.MjSpec, ground: Rough) -> None:
    """Put a field of heights on the floor."""
    half = 0.5 * ground.side
    rows = len(ground.points)
    spec.add_hfield(
        name="rough",
        nrow=rows,
        ncol=rows,
        size=[half, half, ground.height, THICK],
        userdata=ground.points.ravel(),
    )
    _geom(spec, "rough", mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="rough")


def _geom(spec: mujoco.MjSpec, name: str, kind: mujoco.mjtGeom, **more: object) -> None:
    """Add a geom that feet meet, as they do the floor."""
    spec.worldbody.add_geom(
        name=name, type=kind, material="floor", contype=0, conaffinity=1, **more
    )
