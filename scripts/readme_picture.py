"""./.venv/bin/python scripts/readme_picture.py: draws docs/leg.gif, the README's moving picture.

The classic leg on its treadmill, one stride at a quarter of its speed. Equal machines give equal
bytes.
"""

from __future__ import annotations

from pathlib import Path

from fivebar_sim import rollout
from fivebar_sim.render import film as render
from fivebar_sim.render.replay import replay
from fivebar_sim.scenario import Scenario

OUT = Path(__file__).resolve().parent.parent / "docs" / "leg.gif"

if __name__ == "__main__":
    result = rollout.run(Scenario.load("treadmill-trot"))
    film = render.Film(width=480, height=360, fps=30.0, speed=0.25)
    count = render.write(replay(result.scenario, result.record), OUT, film)
    print(f"wrote {OUT.name}: {count} frames, {OUT.stat().st_size / 1e3:.0f} kB")
