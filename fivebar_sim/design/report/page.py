"""The page of a design study."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from fivebar_sim.arrays import Array
from fivebar_sim.design.evaluation.objectives import CATALOGUE
from fivebar_sim.design.proof.table import Proof
from fivebar_sim.design.report import charts, legs, words
from fivebar_sim.design.report.axes import Axis, amount
from fivebar_sim.design.report.script import SCRIPT, STYLE
from fivebar_sim.design.report.study import Study
from fivebar_sim.design.robust.sensitivity import Sensitivity
from fivebar_sim.design.task.task import Task
from fivebar_sim.report import html
from fivebar_sim.report.html import Cell, text

MOST = 60
"""Designs of the front that are shown beside the best."""


STANDS_OUT = 1.25
"""How many times as much as any other a dimension must be to blame, to be named."""


class Shown(NamedTuple):
    """The designs on the page, the best first.

    Attributes:
        values: (n, d).
        objectives: In SI units, (n, m).
        best: How many of them are best.
    """

    values: Array
    objectives: Array
    best: int

    def kind(self, k: int) -> str:
        """Return the CSS classes of a design; the first is shown at first."""
        return " ".join(["best"] * (k < self.best) + ["on"] * (k == 0))


def page(study: Study) -> str:
    """Return the page of a study."""
    shown = _shown(study)
    parts = [
        f"<h1>{text(study.task.name)}: which leg to build</h1>",
        *_take(study),
        _fronts(study, shown),
        html.section("Every number of each", _parallel(study.task, shown)),
        html.section("The best", _best(study, shown)),
    ]

    if study.built:
        parts.append(_robust(study))
    if study.proof is not None:
        parts.append(_proof(study.proof))
    task = tomli_w.dumps(study.task.table)
    parts.append(html.section("The task", f"<pre>{html.escape(task)}</pre>"))
    return html.page(f"{study.task.name}: design", parts, style=STYLE, script=SCRIPT)


def _shown(study: Study) -> Shown:
    """Return the best designs and others spread along the front."""
    front = study.front.designs
    order = np.argsort(front.objectives[:, 0], kind="stable")
    others = order[np.unique(np.linspace(0, len(order) - 1, MOST).astype(int))]
    known = {row.tobytes() for row in study.best}
    others = [k for k in others if front.values[k].tobytes() not in known]
    mine = [int(np.flatnonzero((front.values == row).all(axis=1))[0]) for row in study.best]
    rows = [*mine, *others]
    return Shown(front.values[rows], front.objectives[rows], len(mine))


def _take(study: Study) -> list[str]:
    """Return the first words: how many designs, and the one to take."""
    front = len(study.front.rows)
    said = [
        f"<p>{front} designs are on the front: no other one beats any of them in everything.</p>"
    ]
    if not study.presets:
        return said

    preset = study.presets[0]
    code = html.escape(study.task.preset(study.best[0]))
    said += [
        f"<p><strong>Take this one</strong>, <code>{text(preset)}</code>: {text(study.sure[0])}"
        "</p>",
        f"<details><summary>The leg as a preset</summary><pre>{code}</pre></details>",
        "<p class='note'>In a scenario beside it, <code>leg = &quot;"
        f"{text(preset)}&quot;</code>; or <code>fivebar run SCENARIO --set "
        f"leg=$PWD/{text(preset)}</code>.</p>",
    ]
    return said


def _axis(name: str, values: Array) -> Axis:
    objective = CATALOGUE[name]
    return Axis.of(objective.name, objective.unit, values)


def _words(task: Task, shown: Shown, k: int) -> str:
    """Return a design in words."""
    told = [
        f"{CATALOGUE[name].name} {amount(float(value), CATALOGUE[name].unit)}"
        for name, value in zip(task.objectives, shown.objectives[k], strict=True)
    ]
    settings = task.settings(shown.values[k])
    told += [words.setting(task, name, settings[name]) for name in task.names]
    return ", ".join(told)


def _fronts(study: Study, shown: Shown) -> str:
    """Return the front, and beside it the leg of the design under the pointer."""
    task = study.task
    x = _axis(task.objectives[0], shown.objectives[:, 0])
    charted = []
    for j in range(1, len(task.objectives)):
        y = _axis(task.objectives[j], shown.objectives[:, j])
        charted.append((x, y, shown.objectives[:, 0], shown.objectives[:, j]))
    if not charted:
        along = words.axis(task, 0, shown.values[:, 0])
        charted.append((along, x, shown.values[:, 0], shown.objectives[:, 0]))

    figures = []
    for across, up, px, py in charted:
        points = [
            (k, float(px[k]), float(py[k]), shown.kind(k), _words(task, shown, k))
            # The best are drawn over the others.
            for k in reversed(range(len(px)))
        ]
        alt = f"{up.label} over {across.label} of {len(px)} designs"
        figures.append(f"<figure>{charts.scatter(across, up, points, alt)}</figure>")

    told = "".join(
        f'<p class="told{" on" if k == 0 else ""}" data-k="{k}">{text(_words(task, shown, k))}</p>'
        for k in range(len(shown.values))
    )
    rows = [(k, row) for k, row in enumerate(shown.values)]
    alt = "the leg of the chosen design over its workspace, with its foot path"
    leg = legs.picture(task, rows, 0, alt)
    note = "Point at a design, or tap it. Orange ones are the best, and spread over the front."
    caption = f"<figcaption>{note}</figcaption>"
    both = "\n".join([*figures, f"<figure>{leg}{told}{caption}</figure>"])
    return html.section("The front", f'<div class="figures">{both}</div>')


def _parallel(task: Task, shown: Shown) -> str:
    """Return variables and objectives side by side."""
    axes = [words.axis(task, k, shown.values[:, k]) for k in range(len(task.names))]
    axes += [_axis(name, shown.objectives[:, k]) for k, name in enumerate(task.objectives)]
    numbers = np.concatenate([shown.values, shown.objectives], axis=1)
    rows = [(k, numbers[k], shown.kind(k)) for k in reversed(range(len(numbers)))]
    alt = "a line a design over axes of its variables and objectives"
    drawn = charts.parallel(axes, rows, alt)
    return f'<div class="scroll wide" role="region" tabindex="0" aria-label="{alt}">{drawn}</div>'


def _best(study: Study, shown: Shown) -> str:
    """Return the table of the best designs."""
    task = study.task
    named = [CATALOGUE[name].name for name in task.objectives]
    head = ["design", *named, *(["built right"] * bool(study.built))]
    rows = []
    for k in range(shown.best):
        numbers = [
            amount(float(value), CATALOGUE[name].unit)
            for name, value in zip(task.objectives, shown.objectives[k], strict=True)
        ]
        made = [f"{100.0 * study.built[k].made.share:.1f} %"] if study.built else []
        preset = Cell(f"{text(study.presets[k])}<small>{text(study.sure[k])}</small>")
        rows.append([preset, *numbers, *made])
    table = html.table("The best designs, as presets.", head, rows, stacked=True)
    # A row answers to the pointer as a point of the chart does.
    top, *bodies = table.split("<tr>")
    marked = [f'<tr data-k="{k - 1}">' if k else "<tr>" for k in range(len(bodies))]
    return top + "".join(a + b for a, b in zip(marked, bodies, strict=True))


def _robust(study: Study) -> str:
    """Return what becomes of the first design when it is built."""
    built = study.built[0]
    made = built.made
    off = f"{1e3 * built.within:g} mm"
    said = [
        f"<p>Of legs like <code>{text(study.presets[0])}</code> whose lengths and holes are off by "
        f"up to {off}, {100.0 * made.share:.1f} % keep to every constraint.</p>"
    ]

    if made.broken:
        broken = ", ".join(f"{name} in {100.0 * part:.1f} %" for name, part in made.broken.items())
        said.append(f"<p>What breaks: {text(broken)}.</p>")
    if built.why:
        said.append(f"<p class='note'>{text(built.why)}</p>")
    for each in built.sensitivities:
        if each.spread > 0.0:
            said.append(f"<p>The {text(_named(each))} {_blame(each)}.</p>")
    if built.sensitivities:
        said.append(_bars(built.sensitivities))
    return html.section("Built a little off", *said)


def _named(found: Sensitivity) -> str:
    return CATALOGUE[found.objective].name


def _blame(found: Sensitivity) -> Cell:
    """Return by how much an objective scatters, and which dimension is to blame."""
    scatters = f"scatters by {100.0 * found.spread:.2g} %"
    most, next_most = sorted(found.total.values(), reverse=True)[:2]
    if most < STANDS_OUT * next_most:
        return Cell(f"{scatters}, for which no dimension alone is to blame")
    worst = text(found.worst)
    return Cell(f"{scatters}: the printer must get <strong>{worst}</strong> right")


def _bars(found: Sequence[Sensitivity]) -> str:
    """Return the total sensitivities as a table of bars."""
    names = list(found[0].total)
    rows = [[_named(each), *(Cell(_bar(each.total[name])) for name in names)] for each in found]
    caption = "Part of each objective's scatter that would go if a dimension were exact (Sobol)."
    return f'<div class="bars">{html.table(caption, ["objective", *names], rows)}</div>'


def _bar(part: float) -> str:
    width = 3.0 * min(part, 1.0)
    return (
        f'<span class="cell"><span class="bar" style="width: {width:.2f}rem"></span> '
        f"{100.0 * part:.0f}&nbsp;%</span>"
    )


def _proof(proof: Proof) -> str:
    """Return predicted against simulated."""
    figures = []
    rows: list[list[Any]] = []
    for key, measured in proof.measured.items():
        name = CATALOGUE[key].name
        unit = CATALOGUE[key].unit
        both = np.concatenate([proof.predicted[key], measured])
        rank = proof.rank[key]
        worst = proof.worst.get(key, float("nan"))
        rank_text = f"{rank:.4f}" if np.isfinite(rank) else "none"
        rows.append([name, rank_text, f"{100.0 * worst:.2g} %"])
        x = Axis.of(f"{name}, predicted", unit, both)
        y = Axis.of(f"{name}, simulated", unit, both)
        points = [
            (k, float(a), float(b), "best", f"design {k + 1}")
            for k, (a, b) in enumerate(zip(proof.predicted[key], measured, strict=True))
        ]
        alt = f"{name} of {len(points)} designs, simulated over predicted"
        figures.append(f"<figure>{charts.scatter(x, y, points, alt, line=True)}</figure>")

    broken = [run.error for run in proof.runs if run.error]
    said = f"{len(proof.runs)} designs in MuJoCo, on the same motions."
    if broken:
        said += f" {len(broken)} broke down, the first: {broken[0]}"
    head = ["objective", "rank correlation", "largest difference"]
    return html.section(
        "Predicted and simulated",
        html.table(said, head, rows),
        f'<div class="figures">{"".join(figures)}</div>',
    )
