"""`fivebar identify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, UseAppendAction, arg

from fivebar_sim.cli.common import NO_WORDS, Maybe, Settings, Words, screen, spinner
from fivebar_sim.cli.terminal import FAILED
from fivebar_sim.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fivebar_sim.identify.measured import Measured
    from fivebar_sim.identify.motions import Suggestion

Keys = UseAppendAction[Annotated[Words, arg(metavar="KEY")]]
Files = UseAppendAction[Annotated[Words, arg(metavar="LOG")]]


def identify(
    scenario: Positional[Annotated[str, arg(metavar="SCENARIO")]],
    logs: Positional[Annotated[Words, arg(metavar="LOG ...")]],
    /,
    *,
    fit: Keys = NO_WORDS,
    held_out: Files = NO_WORDS,
    settings: Settings = NO_WORDS,
    out: Maybe[Path] = None,
    motion: Maybe[Path] = None,
    threads: int = 0,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Find the numbers of a real leg and its servos from logs.

    The scenario's leg is sent what the logs say the real one was sent, and its numbers are changed
    until it does what the logs say it did. Each number comes with its 95 % interval; what the
    motion could not tell is said, and which motion could. Exit status 1 if the held-out logs are
    explained worse than before.

    Args:
        scenario: Leg, servo and scene to start from: a shipped scenario, or a TOML file.
        logs: Logs to fit, data files or TOML files with a table [log].
        fit: A number to find, such as leg.L1, servo.delay, servo.friction.base or offset.A; may be
            repeated. Without it: L1 to L4, armature, kp, delay and friction.base.
        held_out: A log that is not fitted, to see whether the numbers carry over; may be repeated.
        settings: Change one key of the scenario, e.g. servo.friction.model=load; may be repeated.
        out: Write the scenario as identified here, with presets of leg and servo beside it.
        motion: Write the setpoints of the motion that would tell most here, as CSV.
        threads: Threads of the simulation; 0 is one for every processor.
        quiet: Print nothing but errors.
        json: Print JSON instead of tables.
    """
    from fivebar_sim.cli.identified import Told, print_json, print_told
    from fivebar_sim.files import whole_file
    from fivebar_sim.identify import motions, written
    from fivebar_sim.identify.fit import fit as fitted
    from fivebar_sim.identify.parameters import parameters
    from fivebar_sim.identify.reading import read
    from fivebar_sim.identify.validate import explained
    from fivebar_sim.scenario import Scenario

    if not logs:
        raise ConfigError("identify needs at least one LOG")
    loaded = Scenario.load(scenario, settings)
    chosen = parameters(loaded, fit)
    measured = [read(each, loaded) for each in logs]
    kept = [read(each, loaded) for each in held_out]
    if out is not None:
        written.check(out)
    if motion is not None:
        whole_file.check_place(motion)

    with spinner(f"simulating {loaded.name} until it does what the logs say", quiet=quiet):
        found = fitted(loaded, chosen, measured, threads)
        checked = explained(loaded, found, kept, threads)
        better = motions.suggest(loaded, found, measured[0], threads)

    if out is not None:
        written.write(out, loaded, found, [each.name for each in measured])
    if motion is not None and better:
        _write_motion(motion, better[0])

    told = Told(found, [each.name for each in measured], _named(kept, checked), better)
    if json:
        print_json(told)
    elif not quiet:
        print_told(told, screen())
    return FAILED if any(after > before for before, after in checked) else 0


def _named(
    kept: Sequence[Measured], checked: Sequence[tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    return {log.name: each for log, each in zip(kept, checked, strict=True)}


def _write_motion(path: Path, best: Suggestion) -> None:
    """Write the setpoints of a motion as CSV."""
    from fivebar_sim.files import whole_file

    rows = [
        f"{t:.6g},{a:.9g},{e:.9g}" for t, (a, e) in zip(best.time, best.ctrl.tolist(), strict=True)
    ]
    with whole_file.stage(path) as place:
        place.write_text("time,ctrl_A,ctrl_E\n" + "\n".join(rows) + "\n", encoding="utf-8")
