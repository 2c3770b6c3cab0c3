"""`fivebar render`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe, spinner


def render(
    run_dir: Positional[Annotated[Path, arg(metavar="RUN_DIR")]],
    /,
    *,
    out: Annotated[Maybe[str], arg(metavar="FILE")] = None,
    fps: float = 30.0,
    speed: float = 1.0,
    width: int = 640,
    height: int = 480,
    at: Annotated[Maybe[float], arg(metavar="SECONDS")] = None,
) -> int:
    """Draw a run: leg, target path, the foot's trail, the ground's force.

    The motors have their letters, A and E; below the leg are the time, a scale bar and what the
    colours mean, as far as they fit.

    A .gif shows the last whole period of a periodic path and repeats without a jump; a .mp4 (which
    needs the program ffmpeg) shows the whole run; a .png shows one moment.

    Args:
        run_dir: A run directory that `fivebar run` wrote.
        out: The picture, .gif, .mp4 or .png (default NAME.gif, in the current folder).
        fps: Frames a second, at most 50 in a .gif.
        speed: Simulated time over time on screen; 0.25 is four times slower than real time.
        width: Width of the picture [pixels].
        height: Height of the picture [pixels].
        at: Time of a .png [s] (default: the middle of the run).
    """
    from fivebar_sim.render import gl
    from fivebar_sim.runs import stored

    run = stored.read(run_dir)
    # before mujoco is imported, which fails where MUJOCO_GL names what is not there
    gl.check_available()

    from fivebar_sim.render import film as render
    from fivebar_sim.render.replay import replay

    place = Path(f"{run.scenario.name}.gif" if out is None else out)
    film = render.Film(width, height, fps, speed, at)
    with spinner(f"drawing {place}", quiet=False):
        frames = render.write(replay(run.scenario, run.record), place, film)

    size = place.stat().st_size / 1e3
    what = "1 frame" if frames == 1 else f"{frames} frames"
    print(f"drew {what} of {run.scenario.name} into {place}: {size:.0f} kB")  # noqa: T201

    return 0
