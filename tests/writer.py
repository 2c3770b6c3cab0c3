"""A process that writes one run again and again, each time in a child that may be killed.

Usage: writer.py PLACE. Prints how long a run takes to write [s] when it is ready; for each line on
stdin it forks a child that writes to PLACE in a loop, and prints the child's id.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from fivebar_sim import rollout
from fivebar_sim.scenario import Scenario

if __name__ == "__main__":
    place = Path(sys.argv[1])
    results = [
        rollout.run(Scenario.load("classic-ellipse", [f"duration={duration}"]))
        for duration in (1.0, 1.2)
    ]
    results[0].write(place.with_name("first"))  # imports what writes
    begun = time.monotonic()
    results[0].write(place.with_name("first"))
    sys.stdout.write(f"{time.monotonic() - begun}\n")
    sys.stdout.flush()
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            while True:
                for result in results:
                    result.write(place)
        sys.stdout.write(f"{child}\n")
        sys.stdout.flush()
        os.waitpid(child, 0)
