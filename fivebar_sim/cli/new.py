"""`fivebar new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.errors import ConfigError

TEMPLATE = """\
# What this run is for. Run it: fivebar run FILE
duration = 4.0           # [s]
scene = "air"            # or rail, treadmill, payload

[leg]
preset = "classic"       # or another of `fivebar list legs`, or a TOML file beside this one
# L1 = 0.040             # [m] AB, from motor A to the knee B; each of these changes the preset
# L2 = 0.060             # [m] BC, from the knee to the joint C that closes the loop
# L3 = 0.060             # [m] CD
# L4 = 0.040             # [m] DE
# L5 = 0.030             # [m] between the motors A and E
# density = 1200.0       # [kg/m^3] of the links

[path]                   # of the foot; hip frame: x forward, z up, origin midway between A and E
kind = "ellipse"         # or another of `fivebar list paths`
centre = [0.0, -0.072]   # [m]
radii = [0.020, 0.008]   # [m]
frequency = 2.0          # [Hz]
ramp = 0.25              # [s] eases the path in from rest

[servo]                  # preset = "xl330", or another of `fivebar list servos`, or its numbers:
kp = 8.0                 # [N m/rad]
kd = 0.05                # [N m s/rad]
# limit = 0.3            # [N m] the stalled motor's torque; none without this line
# speed = 40.0           # [rad/s] no-load speed, with a limit
# rate = 200.0           # [Hz] commands on the bus
# delay = 0.002          # [s] from a command to its effect
# resolution = 0.0015    # [rad] step of the angles that can be commanded
# friction = 0.005       # [N m] of the gear

[controller]
name = "servo"           # or another of `fivebar list controllers`
feedforward = "none"     # or velocity, torque

[sim]
timestep = 0.001         # [s]
# integrator = "discrete"  # or implicitfast
# seed = 0

# Numbers with a unit work too: L2 = "70 mm", delay = "2 ms", resolution = "0.09 deg".

# [limits]               # `fivebar check` needs some: an upper bound, or [low, high], in SI
# tracking.rms = 1.3e-3  # [m]
# load.share_A = [0.4, 0.6]
# load.torque_peak.A = 0.1  # [N m]
"""
"""A scenario that runs as it is; a test takes every line in that is commented out."""


def new(file: Positional[Annotated[Path, arg(metavar="FILE")]], /) -> int:
    """Write a scenario to start from, with comments and units.

    Args:
        file: The scenario, a .toml that does not exist yet.
    """
    if file.suffix != ".toml":
        raise ConfigError(f"a scenario is a .toml file, got {str(file)!r}")
    try:
        # "x": what is there already may be somebody's work.
        with file.open("x", encoding="utf-8") as text:
            text.write(TEMPLATE.replace("FILE", str(file)))
    except FileExistsError:
        raise ConfigError(f"{file} exists already: choose another name") from None
    print(f"{file} is written: fivebar run {file}")  # noqa: T201
    return 0
