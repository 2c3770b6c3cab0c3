"""The command `fivebar`: parses, calls, prints; exit status 0 fine, 1 failed, 2 bad input."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from tyro.conf import Positional, UseAppendAction, arg

from fivebar_sim import __version__
from fivebar_sim.errors import ConfigError, DivergedError, FiveBarError

if TYPE_CHECKING:
    from fivebar_sim.rollout import Plan

Scenarios = Positional[Annotated[tuple[str, ...], arg(metavar="[SCENARIO ...]")]]
Settings = UseAppendAction[Annotated[tuple[str, ...], arg(name="set", metavar="KEY=VALUE")]]

FAILED, WRONG, INTERRUPTED, UNREAD = 1, 2, 130, 141


def run(
    scenarios: Scenarios = (),
    /,
    *,
    out: Annotated[str | None, arg(metavar="DIR")] = None,
    settings: Settings = (),
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Simulate scenarios, judge them by their limits, write their run directories.

    Args:
        scenarios: Names of shipped scenarios or paths of TOML files; none: all that ship.
        out: Run directory of one scenario, or the folder of several (default runs/NAME).
        settings: Change one key of every scenario, as leg.L2=0.07 or "path.radii=[0.02, 0.01]";
            repeats. Another path.kind keeps the keys that both kinds have.
        quiet: Print nothing but errors.
        json: Print the metrics as JSON instead of tables.
    """
    from fivebar_sim import run_directory

    plans = _plans(scenarios, settings)
    places = _places(plans, out)
    for place in places:
        run_directory.check_place(place)
    return _run(plans, places, quiet=quiet, as_json=json)


def _run(plans: list[Plan], places: list[Path], *, quiet: bool, as_json: bool) -> int:
    """Run the plans one after the other; return the highest status."""
    import json

    from fivebar_sim import console, rollout

    status, metrics = 0, {}
    screen = _screen()
    for planned, place in zip(plans, places, strict=True):
        name = planned.scenario.name
        try:
            with _working(f"simulating {name}", quiet=quiet):
                result = rollout.execute(planned)
                result.write(place)
        except DivergedError as error:
            _say(error)
            status = FAILED
            continue
        metrics[name] = result.metrics
        status = max(status, 0 if result.verdict == "pass" else FAILED)
        if not (quiet or as_json):
            console.print_result(result, str(place), screen)
    if as_json:
        shown = next(iter(metrics.values()), None) if len(plans) == 1 else metrics
        print(json.dumps(shown, indent=2, allow_nan=False))  # noqa: T201
    return status


def check(scenarios: Scenarios = (), /, *, settings: Settings = (), quiet: bool = False) -> int:
    """Run scenarios against their limits; exit status 1 if any limit is broken.

    Args:
        scenarios: Names of shipped scenarios or paths of TOML files; none: all that ship.
        settings: Change one key of every scenario, as sim.timestep=0.0005; repeats.
        quiet: Print nothing but errors.
    """
    from fivebar_sim import console, rollout

    status, results = 0, []
    for planned in _plans(scenarios, settings):
        try:
            with _working(f"checking {planned.scenario.name}", quiet=quiet):
                results.append(rollout.execute(planned))
        except DivergedError as error:
            _say(error)
            status = FAILED
    if not quiet:
        console.print_check(results, _screen())
    return max([status, *(0 if r.verdict == "pass" else FAILED for r in results)])


def replay(run_dir: Positional[Annotated[Path, arg(metavar="RUN_DIR")]], /) -> int:
    """Open the recording of a run in the Rerun viewer, on this machine only.

    Args:
        run_dir: A run directory that `fivebar run` wrote.
    """
    import subprocess

    from fivebar_sim import recording, run_directory

    run_directory.check_run(run_dir)
    command = recording.viewer_command(run_dir / "recording.rrd")
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        raise ConfigError(
            f"no screen here: neither DISPLAY nor WAYLAND_DISPLAY is set; open "
            f"{run_dir / 'recording.rrd'} with Rerun on a machine that has one"
        )
    quiet = {**os.environ, "CI": "true"}  # keeps Rerun's analytics off
    return subprocess.run(command, env=quiet).returncode


def workspace(
    leg: Positional[Annotated[str, arg(metavar="LEG")]],
    /,
    *,
    out: Annotated[str | None, arg(metavar="PNG")] = None,
    path: Annotated[str | None, arg(metavar="SCENARIO")] = None,
) -> int:
    """Draw what a leg's foot reaches: distance to the boundary, and singular curves.

    Args:
        leg: A preset's name or a leg's TOML file.
        out: The picture, .png, .svg or .pdf (default workspace-LEG.png).
        path: A scenario whose foot path is drawn on it.
    """
    from fivebar_sim import workspace_map
    from fivebar_sim.geometry import FiveBar
    from fivebar_sim.scenario import Scenario

    drawn = FiveBar.load(leg)
    followed = None if path is None else Scenario.load(path).foot_path
    place = Path(f"workspace-{drawn.name}.png" if out is None else out)
    surveyed = workspace_map.write(drawn, place, followed)
    area, deepest = 1e4 * surveyed.area, 1e3 * float(surveyed.distance.max())
    print(  # noqa: T201
        f"{drawn.name}: the foot reaches {area:.1f} cm2 and gets up to {deepest:.1f} mm inside; "
        f"drawn in {place}"
    )
    return 0


def _plans(scenarios: Iterable[str], settings: Sequence[str]) -> list[Plan]:
    """Return the plans of all scenarios: everything is validated before the first one runs."""
    from fivebar_sim import resources, rollout
    from fivebar_sim.scenario import Scenario

    chosen = list(scenarios) or list(resources.shipped("scenarios"))
    loaded = [(source, Scenario.load(source, settings)) for source in chosen]
    plans = []
    for source, scenario in loaded:
        try:
            plans.append(rollout.plan(scenario))
        except FiveBarError as error:
            raise ConfigError(f"{source}: {error}") from None
    return plans


def _places(plans: list[Plan], out: str | None) -> list[Path]:
    """Return the run directory of every plan.

    Raises:
        ConfigError: --out is empty, or two scenarios of one name would write to one place.
    """
    if out == "":
        raise ConfigError("--out must name a directory, got ''")
    names = [planned.scenario.name for planned in plans]
    if out is not None and len(plans) == 1:
        return [Path(out)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f"two scenarios are called {twice[0]!r} and would write to one place")
    return [Path(out or "runs") / name for name in names]


def _screen():
    from rich.console import Console

    class Screen(Console):
        def on_broken_pipe(self) -> None:  # rich itself would exit with 1, as if a limit failed
            raise BrokenPipeError

    return Screen()


def _working(what: str, *, quiet: bool):
    """Return a context that shows a spinner on a terminal's stderr."""
    from rich.console import Console
    from rich.text import Text

    return Console(stderr=True, quiet=quiet).status(Text(what))


def _say(error: BaseException | str) -> None:
    """Print one line to stderr."""
    print(f"fivebar: {' '.join(str(error).split())}", file=sys.stderr)  # noqa: T201


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    args = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # any name, in any terminal's encoding
    try:
        status = _dispatch(args)
        if sys.stdout:
            sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        _say("interrupted")
        return INTERRUPTED
    except DivergedError as error:
        _say(error)
        return FAILED
    except FiveBarError as error:
        _say(error)
        return WRONG
    except BrokenPipeError:  # who reads has gone, as in `fivebar check | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNREAD
    except OSError as error:
        _say(error)
        return WRONG


def _dispatch(args: list[str]) -> int:
    """Parse the arguments and call their command."""
    if args == ["--version"]:
        print(f"fivebar-sim {__version__}")  # noqa: T201
        return 0
    return tyro.extras.subcommand_cli_from_dict(
        {"run": run, "check": check, "replay": replay, "workspace": workspace},
        prog="fivebar",
        description="Simulate closed-chain five-bar legs; measure tracking and load sharing.",
        args=args,
        config=(tyro.conf.FlagCreatePairsOff,),
    )
