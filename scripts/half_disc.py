""".venv/bin/python scripts/half_disc.py  # the half disc of 1 m radius: a public design and ours.

Certifies the five-bar of https://github.com/unswei/fivebar (configs/default.toml, read 2026-11),
whose foot is on an extension of L2, all over the half disc that it was searched for; then searches
the shipped task half-disc and certifies what comes out. Prints both.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from fivebar_sim import FiveBar, design
from fivebar_sim.design.certificate.certify import Certified, certify, certify_region
from fivebar_sim.design.search.run import search
from fivebar_sim.design.task.motions import HalfDisc

PUBLIC = FiveBar(
    L1=0.5829,
    L2=0.4632,
    L3=0.7360,
    L4=0.3308,
    L5=0.1917,
    L6=0.3790,
    mode=(1, -1),
    assembly=1,
    name="public",
)
DISC = HalfDisc(centre=(0.0, 0.3745), radius=1.0, side="up")
"""It is 0.3745 m above the motors."""


def told(name: str, leg: FiveBar, sure: Certified) -> str:
    """Return a line of the table."""
    rod = leg.L2 + leg.L6
    lengths = " ".join(f"{each:.4f}" for each in (leg.L1, rod, leg.L3, leg.L4, leg.L5))
    return (
        f"{name:8}{lengths}{1e3 * sure.reach:8.1f}{sure.singular:8.4f}{sure.condition:11.3f}"
        f"{sure.found[2]:10.3f}"
    )


def main() -> None:
    """Print the table."""
    print("        L1     L2+L6  L3     L4     L5 [m]  reach    sine  condition     found")
    print("                                             [mm]            at most  at points")
    print(told("public", PUBLIC, certify_region(PUBLIC, DISC, "half-disc")))
    task = design.load("half-disc")
    with tempfile.TemporaryDirectory() as place:
        front = search(task, Path(place) / "out").front
    assert front is not None
    row = front.designs.values[0]
    print(told("ours", task.leg_of(row), certify(task, row)[0]))
    depth = task.covers_of(row)[0].region.box()[0][1]
    print(f"ours is {1e3 * depth:.1f} mm below the straight side of the half disc")


if __name__ == "__main__":
    main()
