"""The search over designs: its front, its methods, and that it goes on where it was ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from fivebar_sim import design
from fivebar_sim.arrays import Array
from fivebar_sim.design.search import methods
from fivebar_sim.design.search.front import Front, beaten_by_none, costs
from fivebar_sim.design.search.run import Progress, search
from fivebar_sim.errors import ConfigError, RunDirectoryError

TWO = """
leg = "classic"
servo = "hobby-9g"
samples = 16
objectives = ["torque_peak", "size"]

[vary]
leg.L1 = [0.03, 0.06]
leg.L2 = [0.04, 0.09]
leg.L4 = "leg.L1"
leg.L3 = "leg.L2"

[motion.walk]
path = { kind = "ellipse", centre = [0.0, -0.072], radii = [0.015, 0.008], frequency = 2.0 }

[constraints]
reach = 0.002
singular = 0.2

[search]
"""


def load(folder: Path, text: str) -> design.Task:
    path = folder / "task.toml"
    path.write_text(text, encoding="utf-8")
    return design.load(path)


def front_of(progress: Progress) -> Front:
    assert progress.front is not None
    return progress.front


def assert_same_tables(one: Path, other: Path) -> None:
    """Assert that two searches wrote the same, bit for bit: Arrow's own comparison knows no NaN."""
    for file in ("designs.parquet", "front.parquet"):
        a = pq.read_table(one / file)
        b = pq.read_table(other / file)
        assert a.schema.equals(b.schema, check_metadata=True)
        for name in a.column_names:
            assert a.column(name).to_numpy().tobytes() == b.column(name).to_numpy().tobytes()


def brute(cost: Array) -> list[int]:
    """Return the front by comparing every pair; of equal rows the first."""
    kept = []
    for i, row in enumerate(cost):
        as_good = (cost <= row).all(axis=1)
        better = as_good & (cost < row).any(axis=1)
        twin = (cost[:i] == row).all(axis=1).any()
        if not better.any() and not twin:
            kept.append(i)
    return kept


@pytest.mark.parametrize("objectives", [1, 2, 3, 4])
def test_front_is_what_no_other_beats(rng: np.random.Generator, objectives: int) -> None:
    # Few different values, so that ties and twins come up.
    cost = rng.integers(0, 6, size=(80, objectives)).astype(float)
    assert beaten_by_none(cost).tolist() == brute(cost)
    assert beaten_by_none(cost[:0]).tolist() == []


@pytest.mark.parametrize("method", ["nsga2", "nsga3"])
def test_front_has_that_of_a_grid_within_a_cell(tmp_path: Path, method: str) -> None:
    (tmp_path / "a").mkdir()
    fine = load(tmp_path / "a", TWO + 'method = "grid"\npoints = 21')
    exact = front_of(search(fine, tmp_path / "grid"))
    bred = load(tmp_path, f'{TWO}method = "{method}"\npopulation = 40\ngenerations = 15')
    found = costs(bred, front_of(search(bred, tmp_path / "bred")).designs)
    cells = np.array([0.03, 0.05]) / 20

    for values, cost in zip(exact.designs.values, costs(fine, exact.designs), strict=True):
        # What changes within a cell about a design of the grid's front.
        corner = values + cells * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1], [0, 0]])
        near = design.evaluate(fine, np.clip(corner, *fine.bounds))
        worst = np.nanmax(costs(fine, near), axis=0)
        assert (found <= np.maximum(worst, cost)).all(axis=1).any(), values


# The import of cma alone takes three seconds.
@pytest.mark.long
def test_cma_finds_the_best_of_a_grid(tmp_path: Path) -> None:
    one = TWO.replace('["torque_peak", "size"]', '["torque_peak"]')
    (tmp_path / "a").mkdir()
    fine = load(tmp_path / "a", one + 'method = "grid"\npoints = 16')
    best = front_of(search(fine, tmp_path / "grid")).designs.objectives[0, 0]
    task = load(tmp_path, one + 'method = "cma-es"\npopulation = 8\ngenerations = 25')
    found = front_of(search(task, tmp_path / "cma")).designs.objectives[0, 0]
    # The best is in a corner of the bounds, which it comes near and never quite reaches.
    assert best <= found <= 1.001 * best


CMA = TWO.replace('["torque_peak", "size"]', '["torque_peak"]')
CMA += 'method = "cma-es"\npopulation = 8\ngenerations = 9'


@pytest.fixture
def light_cma() -> Iterator[None]:
    """Import cma without what it draws and fits with: that takes it 3 s, and searches need none."""
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Could not import matplotlib")
        for name in [n for n in sys.modules if n.partition(".")[0] == "cma"]:
            patch.delitem(sys.modules, name)
        for name in ("matplotlib", "matplotlib.pyplot", "scipy.stats"):
            patch.setitem(sys.modules, name, None)
        yield
        for name in [n for n in sys.modules if n.partition(".")[0] == "cma"]:
            del sys.modules[name]


@pytest.mark.usefixtures("light_cma")
def test_cma_that_is_ended_goes_on(tmp_path: Path) -> None:
    """Its step size and its covariance are not kept: they come again from what it was told."""
    task = load(tmp_path, CMA)
    search(task, tmp_path / "whole")
    for blocks in (1, 5, 8):
        ended = tmp_path / f"ended-{blocks}"

        def stop(progress: Progress, last: int = blocks) -> None:
            if progress.blocks == last:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            search(task, ended, watch=stop)
        again = search(task, ended)
        assert (again.designs, again.fresh) == (72, 72 - 8 * blocks)
        assert_same_tables(tmp_path / "whole", ended)


@pytest.mark.parametrize(
    "options",
    [
        'method = "nsga2"\npopulation = 12\ngenerations = 5',
        'method = "nsga3"\npopulation = 12\ngenerations = 5',
        'method = "sobol"\ndesigns = 200',
        'method = "grid"\npoints = 13',
    ],
)
def test_search_that_is_ended_goes_on(
    tmp_path: Path, options: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(methods, "BLOCK", 40)
    task = load(tmp_path, TWO + options)
    whole = front_of(search(task, tmp_path / "whole"))

    def stop(progress: Progress) -> None:
        if progress.blocks == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(task, tmp_path / "ended", watch=stop)
    # What it had found is there to be read.
    assert len(pq.read_table(tmp_path / "ended" / "designs.parquet")) > 0
    again = search(task, tmp_path / "ended", threads=2)
    assert 0 < again.fresh < again.designs
    assert front_of(again).rows.tolist() == whole.rows.tolist()
    assert front_of(again).designs.values.tobytes() == whole.designs.values.tobytes()
    assert_same_tables(tmp_path / "whole", tmp_path / "ended")
    # A finished one is only read.
    assert search(task, tmp_path / "ended").fresh == 0


KILLED = """
import os, signal, sys
from pathlib import Path
from fivebar_sim import design
from fivebar_sim.design.search import methods, run
methods.BLOCK = 64
def watch(progress):
    if progress.blocks == 3:
        os.kill(os.getpid(), signal.SIGKILL)
run.search(design.load(sys.argv[1]), Path(sys.argv[2]), watch=watch)
"""


def test_killed_search_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "BLOCK", 64)
    task = load(tmp_path, TWO + 'method = "grid"\npoints = 20')
    command = [sys.executable, "-c", KILLED, task.where, str(tmp_path / "killed")]
    ended = subprocess.run(command, check=False, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert ended.returncode == -signal.SIGKILL
    assert not (tmp_path / "killed" / "front.parquet").exists()

    again = search(task, tmp_path / "killed")
    whole = search(task, tmp_path / "whole")
    assert (again.designs, again.fresh) == (400, 400 - 3 * 64)
    assert_same_tables(tmp_path / "whole", tmp_path / "killed")
    assert (
        front_of(again).designs.objectives.tobytes() == front_of(whole).designs.objectives.tobytes()
    )


@pytest.mark.long
def test_killed_cma_goes_on(tmp_path: Path) -> None:
    task = load(tmp_path, CMA)
    command = [sys.executable, "-c", KILLED, task.where, str(tmp_path / "killed")]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    assert search(task, tmp_path / "killed").fresh == 72 - 3 * 8
    search(task, tmp_path / "whole")
    assert_same_tables(tmp_path / "whole", tmp_path / "killed")


def test_damaged_block_is_evaluated_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "BLOCK", 64)
    task = load(tmp_path, TWO + 'method = "sobol"\ndesigns = 192')

    def stop(progress: Progress) -> None:
        if progress.blocks == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(task, tmp_path / "out", watch=stop)
    block = tmp_path / "out" / "blocks" / "000001.parquet"
    block.write_bytes(block.read_bytes()[:100])
    assert search(task, tmp_path / "out").fresh == 128


def test_front_that_was_changed_is_no_front(tmp_path: Path) -> None:
    task = load(tmp_path, TWO + 'method = "grid"\npoints = 3')
    search(task, tmp_path / "out")
    front = tmp_path / "out" / "front.parquet"
    sound = pq.read_table(front)
    numbers = sound.set_column(0, sound.schema.names[0], [0.5 + sound.column(0).to_numpy()])
    for damaged in (numbers, sound.slice(0, 0), sound.drop_columns(["row"])):
        pq.write_table(damaged, front)
        with pytest.raises(RunDirectoryError, match=r"front\.parquet is damaged, or was changed"):
            search(task, tmp_path / "out")
    front.unlink()
    with pytest.raises(RunDirectoryError, match=r"front\.parquet is damaged, or was changed"):
        search(task, tmp_path / "out")


def test_search_killed_at_its_very_start_goes_on(tmp_path: Path) -> None:
    task = load(tmp_path, TWO + 'method = "grid"\npoints = 3')
    (tmp_path / "half").mkdir()
    (tmp_path / "half" / ".fivebar-abc.json").write_text("{")
    assert search(task, tmp_path / "half").designs == 9
    # With its state and nothing else.
    (tmp_path / "state").mkdir()
    state = (tmp_path / "half" / "state.json").read_text().replace("true", "false")
    (tmp_path / "state" / "state.json").write_text(state)
    assert search(task, tmp_path / "state").fresh == 9


def test_no_feasible_design_says_what_excludes_how_many(tmp_path: Path) -> None:
    task = load(
        tmp_path, TWO.replace("reach = 0.002", "reach = 0.2") + 'method = "grid"\npoints = 4'
    )
    for _ in range(2):
        with pytest.raises(ConfigError, match="no feasible design among 16: reach excludes 16"):
            search(task, tmp_path / "out")
    assert pq.read_table(tmp_path / "out" / "designs.parquet").num_rows == 16


def test_directory_of_another_task_is_refused(tmp_path: Path) -> None:
    task = load(tmp_path, TWO + 'method = "grid"\npoints = 3')
    search(task, tmp_path / "out")
    other = load(tmp_path, TWO + 'method = "grid"\npoints = 4')
    with pytest.raises(RunDirectoryError, match="the search of another task"):
        search(other, tmp_path / "out")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "note").write_text("keep")
    with pytest.raises(RunDirectoryError, match="no directory of a search"):
        search(other, tmp_path / "mine")


def test_methods_are_refused_that_a_task_cannot_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ConfigError, match='"cma-es" follows one objective, this task has 2'):
        search(load(tmp_path, TWO + 'method = "cma-es"'), tmp_path / "out")
    monkeypatch.setitem(sys.modules, "pymoo", None)
    monkeypatch.setitem(sys.modules, "pymoo.core.problem", None)
    with pytest.raises(
        ConfigError, match=r"needs the package pymoo: pip install 'fivebar-sim\[design\]'"
    ):
        search(load(tmp_path, TWO + 'method = "nsga2"'), tmp_path / "out")
    assert not (tmp_path / "out").exists()
