"""`fivebar design`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from tyro.conf import Positional, arg

from fivebar_sim.cli.common import Maybe, screen, spinner
from fivebar_sim.cli.progress import Progress
from fivebar_sim.cli.terminal import FAILED, say
from fivebar_sim.errors import ArgumentError

if TYPE_CHECKING:
    from rich.console import Console

    from fivebar_sim.design import Task
    from fivebar_sim.design.certificate.best import Chosen
    from fivebar_sim.design.search.front import Front
    from fivebar_sim.design.search.run import Progress as Searched
    from fivebar_sim.workers.here import Workers

WIDEST = 1000
"""Columns that the table of the best may take."""

WORTH = 12
"""Simulated designs that are worth a process."""


class Asked(NamedTuple):
    """What is asked about the best designs.

    Attributes:
        simulate: How many run in MuJoCo.
        tolerance: How far lengths and holes may be off [m].
        workers: A cluster that simulates; None is this machine.
    """

    simulate: int
    tolerance: float
    workers: Workers | None


def design(
    task: Positional[Annotated[str, arg(metavar="TASK")]],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    threads: int = 0,
    simulate: Maybe[int] = None,
    tolerance: float = 0.2,
    ray: Annotated[Maybe[str], arg(metavar="HOST:PORT")] = None,
    quiet: bool = False,
) -> int:
    """Search which leg should be built for a task, and certify the best.

    DIR/designs.parquet gets every evaluated design, DIR/front.parquet those that no other one
    beats, DIR/best/*.toml the best of them as legs for `fivebar run`, certified to keep to the
    constraints between the samples too. The best are simulated, and built a little off:
    DIR/simulated.parquet, DIR/built.json, and all of it on a page, DIR/report.html. Broken
    off, the same command goes on where it was. Exit status 1 if no design of the front could be
    certified.

    Args:
        task: Name of a shipped task, or path of a TOML file.
        out: The directory of the search.
        threads: How many threads evaluate; 0 is one for every processor.
        simulate: How many designs of the front run in MuJoCo: by default the best.
        tolerance: How far lengths and holes of a built leg may be off [mm]; 0 leaves it out.
        ray: Simulate on the Ray cluster at this address (extra `ray`).
        quiet: Print nothing but errors.
    """
    from fivebar_sim import design as room
    from fivebar_sim.design.certificate import best
    from fivebar_sim.design.search.run import search
    from fivebar_sim.workers.cluster import RayCluster
    from fivebar_sim.workers.processes import processors

    if threads < 0:
        raise ArgumentError(f"--threads must be 0 or more, got {threads}")
    if simulate is not None and simulate < 0:
        raise ArgumentError(f"--simulate must be 0 or more, got {simulate}")
    if not 0.0 <= tolerance < float("inf"):
        raise ArgumentError(f"--tolerance must be in [0, inf) mm, got {tolerance:g}")
    workers = None if ray is None else RayCluster(ray)
    loaded = room.load(task)
    with _kept(out), Progress("designs", quiet=quiet) as progress:

        def watch(searched: Searched) -> None:
            front = 0 if searched.front is None else len(searched.front.rows)
            progress.tell(searched.designs, searched.total, f", {front} on the front")

        searched = search(loaded, out, threads=threads or processors(), watch=watch)

    assert searched.front is not None
    with spinner("certifying the best", quiet=quiet):
        chosen = best.choose(loaded, searched.front)
        files = best.write(loaded, chosen, out)
    if not quiet:
        _print(loaded, searched, chosen, files, screen())
    count = len(files) if simulate is None else simulate
    asked = Asked(count, 1e-3 * tolerance, workers)
    _study(loaded, searched.front, chosen, files, out, asked, quiet=quiet)
    return 0 if chosen.best or not loaded.search.best else FAILED


def _study(
    task: Task,
    front: Front,
    chosen: Chosen,
    files: list[Path],
    out: Path,
    asked: Asked,
    *,
    quiet: bool,
) -> None:
    """Simulate the best, build them a little off, and write the page."""
    from rich.text import Text

    from fivebar_sim.design.report import study, write

    presets = [str(file.relative_to(out)) for file in files]
    with Progress("designs simulated", quiet=quiet) as progress:
        found = study.study(
            task,
            front,
            chosen,
            presets,
            simulate=asked.simulate,
            tolerance=asked.tolerance,
            workers=_workers(asked),
            watch=progress.tell,
        )
    study.write_tables(found, out)
    page = write.write(found, out)
    console = screen(quiet=quiet)
    if found.proof is not None and len(found.proof.runs) > 1:
        rank = ", ".join(f"{key} {value:.4f}" for key, value in found.proof.rank.items())
        count = len(found.proof.runs)
        console.print(Text(f"rank correlation of {count} simulated: {rank}"), soft_wrap=True)
    console.print(Text(f"all of it: {page}"), soft_wrap=True)


def _workers(asked: Asked) -> Workers | None:
    """Return who simulates; None is this process."""
    from fivebar_sim.workers.processes import Processes, processors

    if asked.workers is not None:
        return asked.workers
    # Each needs about a second to start: a few designs are done before.
    count = min(processors(), asked.simulate // WORTH)
    return Processes(count) if count > 1 else None


def _print(
    task: Task, searched: Searched, chosen: Chosen, files: list[Path], console: Console
) -> None:
    """Print what came out of a search."""
    from rich.text import Text

    assert searched.front is not None
    front = f"{len(searched.front.rows)} on the front"
    if searched.designs:
        rate = f"; {searched.rate:,.3g} a minute" if searched.fresh else ""
        text = f"{searched.designs:,} designs, {searched.feasible:,} feasible, {front}{rate}"
        console.print(Text(f"{task.name}: {text}"), soft_wrap=True)
        lost = [f"{name} {count:,}" for name, count in searched.excluded.most_common()]
        if lost:
            console.print(Text(f"excluded by {', '.join(lost)}"), soft_wrap=True)
    else:
        console.print(Text(f"{task.name}: finished before, {front}"), soft_wrap=True)

    if chosen.best:
        table = _table(task, chosen)
        # As wide as its numbers, which would be cut on a terminal of few columns.
        wide = console.options.update(max_width=WIDEST)
        console.width = max(console.width, console.measure(table, options=wide).maximum)
        console.print(table)
    if chosen.unknown:
        console.print(Text(f"not certified: {chosen.unknown}"), soft_wrap=True)
    if chosen.refused:
        count = f"{len(chosen.refused)} of {len(chosen.refused) + len(chosen.best)} tried"
        console.print(Text(f"refused: {count}, as {chosen.refused[0]}"), soft_wrap=True)
    if files:
        console.print(Text(f"written to {files[0].parent}"), soft_wrap=True)


def _table(task: Task, chosen: Chosen):
    """Return the table of the best designs, with what is certain of them at worst."""
    from rich import box
    from rich.table import Table

    from fivebar_sim.design.certificate.best import shown
    from fivebar_sim.design.evaluation.objectives import CATALOGUE

    table = Table(box=box.SIMPLE_HEAD)
    for name in ("best", *task.objectives, "reach", "sine", "condition"):
        table.add_column(name, justify="right", no_wrap=True)
    for k, each in enumerate(chosen.best):
        cells = [
            shown(value, CATALOGUE[name].unit)
            for name, value in zip(task.objectives, each.objectives.tolist(), strict=True)
        ]
        sure = ["", "", ""]
        if each.certified:
            sure = [
                ">= " + shown(min(c.reach for c in each.certified), "m", 3),
                f">= {min(c.singular for c in each.certified):.3f}",
                f"<= {max(c.condition for c in each.certified):.4g}",
            ]
        table.add_row(str(k + 1), *cells, *sure)
    return table


@contextmanager
def _kept(out: Path) -> Iterator[None]:
    """Say where a search goes on that is broken off within."""
    try:
        yield
    except KeyboardInterrupt:
        say(f"what is found is kept in {out}; the same command goes on from there")
        raise
