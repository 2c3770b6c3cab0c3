"""`fivebar design`: the directory that it writes, what it prints, and its refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from fivebar_sim import Scenario, design
from fivebar_sim.cli.program import main
from fivebar_sim.design.certificate.best import spread

TASK = """
leg = "classic"
samples = 8
servo = "hobby-9g"
objectives = ["torque_peak", "size"]

[vary]
leg.L1 = [0.03, 0.05]
leg.L2 = [0.04, 0.07]

[motion.swing.path]
kind = "ellipse"
centre = [0.0, -0.075]
radii = [0.01, 0.008]
frequency = 2.0

[constraints]
singular = 0.1

[search]
method = "grid"
points = 6
best = 3
"""


def write(folder: Path, text: str = TASK) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def expect_simulated_and_drawn(out: Path) -> None:
    """One design is on the front, and one alone has no rank."""
    simulated = pq.read_table(out / "simulated.parquet").to_pylist()
    assert [row["design"] for row in simulated] == [0]

    page = (out / "report.html").read_text(encoding="utf-8")
    assert "best/mine-01.toml" in page
    assert "1 designs in MuJoCo" in page
    assert not (out / "built.json").exists()


def test_search_leaves_tables_and_legs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write(tmp_path)
    out = tmp_path / "out"
    quick = ["--tolerance", "0", "--simulate", "2"]
    assert main(["design", source, "--out", str(out), "--threads", "1", *quick]) == 0
    shown = capsys.readouterr().out
    assert "mine: 36 designs" in shown
    assert "a minute" in shown
    task = design.load(source)
    table = pq.read_table(out / "designs.parquet")
    assert table.num_rows == 36
    assert table.column_names == [*(each.name for each in design.columns(task)), "feasible"]
    assert "rank correlation" not in shown
    expect_simulated_and_drawn(out)

    front = pq.read_table(out / "front.parquet")
    told = json.loads((out / "best.json").read_text(encoding="utf-8"))
    assert [Path(each["file"]).name for each in told["best"]] == sorted(
        path.name for path in (out / "best").glob("*.toml")
    )
    assert 0 < len(told["best"]) <= 3
    for each in told["best"]:
        assert each["row"] in front.column("row").to_pylist()
        row = np.array([[table.column(name)[each["row"]].as_py() for name in task.names]])
        evaluated = design.evaluate(task, row)
        assert list(each["objectives"].values()) == evaluated.objectives[0].tolist()
        scenario = Scenario.load("classic-ellipse", [f"leg={out / each['file']}"])
        assert scenario.leg == task.leg_of(row[0])

    # Once more: nothing is searched, and the same is written.
    before = (out / "best.json").read_bytes()
    assert main(["design", source, "--out", str(out), "--tolerance", "0", "--simulate", "0"]) == 0
    assert "mine: finished before" in capsys.readouterr().out
    assert (out / "best.json").read_bytes() == before


def test_front_that_cannot_be_certified_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two samples, at the sides: in between the foot leaves the reach of every leg."""
    text = TASK.replace("samples = 8", "samples = 2").replace("0.07]", "0.041]")
    text = text.replace("radii = [0.01, 0.008]", "ramp = 0.0\nradii = [0.001, 0.03]")
    out = tmp_path / "out"
    assert main(["design", write(tmp_path, text), "--out", str(out)]) == 1
    shown = capsys.readouterr().out
    assert "Take this one" not in (out / "report.html").read_text(encoding="utf-8")
    assert "motion.swing: reach is certain to -" in shown
    assert list((out / "best").glob("*.toml")) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[0.03, 0.05]", "[0.05, 0.03]", "the wrong way round"),
        (
            "[constraints]",
            "[constraints]\nreach = 0.5",
            "no feasible design among 36: reach excludes 36",
        ),
        ('"size"]', '"heat2"]', "unknown objective 'heat2'"),
    ],
)
def test_refusal_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, message: str
) -> None:
    source = write(tmp_path, TASK.replace(old, new))
    assert main(["design", source, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--simulate", "-1"], "--simulate must be 0 or more, got -1"),
        (["--tolerance", "-0.1"], "--tolerance must be in [0, inf) mm, got -0.1"),
        (["--ray", "nowhere"], "--ray takes HOST:PORT of a Ray cluster, got 'nowhere'"),
    ],
)
def test_option_out_of_range_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: list[str], message: str
) -> None:
    assert main(["design", write(tmp_path), "--out", str(tmp_path / "out"), *option]) == 2
    assert capsys.readouterr().err == f"fivebar: {message}\n"
    assert not (tmp_path / "out").exists()


def test_best_are_spread_over_the_front() -> None:
    cost = np.array([[0.0, 1.0], [0.01, 0.99], [0.3, 0.3], [0.5, 0.4], [1.0, 0.0]])
    assert spread(cost, 3)[0] == 2
    assert sorted(spread(cost, 3)) == [0, 2, 4]
    assert sorted(spread(cost, 9)) == [0, 1, 2, 3, 4]
    assert spread(cost[:0], 3) == []
