"""Formulas of the documentation as MathML, which browsers draw by themselves.

A site that opens from disk and asks no other host has no place to load a library from.
"""

from __future__ import annotations

from typing import Any

from latex2mathml.converter import convert


def block(source: str, *_: Any, **__: Any) -> str:
    """Return the HTML of a block of LaTeX: what pymdownx.superfences calls for ```math."""
    return f'<div class="formula" role="math">{convert(source.strip(), display="block")}</div>'
