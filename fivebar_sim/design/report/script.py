"""What makes the page answer to the pointer: styles, and a few lines of script."""

from __future__ import annotations

STYLE = """
text { font: 12px system-ui, sans-serif; fill: var(--ink); text-anchor: middle; }
text.tick { fill: var(--muted); pointer-events: none; paint-order: stroke; stroke: var(--paper);
  stroke-width: 3px; }
text.left { text-anchor: end; }
.axis { stroke: var(--ink); fill: none; }
.grid { stroke: var(--grid); fill: none; }
.equal { stroke: var(--muted); stroke-dasharray: 5 4; fill: none; }
.dot { fill: var(--run-1); fill-opacity: .55; cursor: pointer; }
.dot.best { fill: var(--run-2); fill-opacity: .9; }
.strand { fill: none; stroke: var(--run-1); stroke-opacity: .3; stroke-width: 1.2;
  cursor: pointer; }
.strand.best { stroke: var(--run-2); stroke-opacity: .8; }
.dot.on { fill: var(--foot); fill-opacity: 1; stroke: var(--paper); stroke-width: 2; r: 8px; }
.strand.on { stroke: var(--foot); stroke-opacity: 1; stroke-width: 3; }
.one { visibility: hidden; }
.one.on { visibility: visible; }
.edge { stroke: var(--muted); fill: var(--wash); fill-opacity: .1; }
.cover { stroke: var(--target); fill: var(--target); fill-opacity: .12; }
.way { stroke: var(--target); stroke-width: 3; fill: none; }
.chain { fill: none; stroke-width: 4; stroke-linejoin: round; stroke-linecap: round; }
.chain.A { stroke: var(--A); } .chain.E { stroke: var(--E); }
.joint { fill: var(--paper); stroke-width: 2; }
.joint.A { stroke: var(--A); } .joint.E { stroke: var(--E); }
th small, td small { display: block; color: var(--muted); }
@media (min-width: 40rem) { thead .number { white-space: nowrap; } }
.told { display: none; } .told.on { display: block; }
.wide svg { display: block; }
tr[data-k] { cursor: pointer; }
tr.on { background: color-mix(in srgb, var(--foot) 14%, transparent); }
.bar { display: inline-block; height: .7em; background: var(--run-1); vertical-align: baseline; }
.bars .number { text-align: left; }
.cell { display: inline-block; min-width: 5.5rem; text-align: left; }
"""

SCRIPT = """
const show = k => document.querySelectorAll('[data-k]').forEach(
  one => one.classList.toggle('on', one.dataset.k === k));
const ask = event => {
  const found = event.target.closest('[data-k]:not(.one):not(.told)');
  if (found) show(found.dataset.k);
};
document.addEventListener('pointerover', ask);
document.addEventListener('click', ask);
"""
