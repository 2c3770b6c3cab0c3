"""How a report's figures look: few points that hide nothing, colours that stand out."""

from __future__ import annotations

import itertools
import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fivebar_sim.report import draw, html, look

VALUES = st.integers(1, 400).flatmap(
    lambda rows: arrays(
        np.float64, rows, elements=st.one_of(st.floats(-1e6, 1e6), st.just(float("nan")))
    )
)


@given(VALUES, st.integers(1, 30))
def test_envelope_keeps_what_sticks_out(values: np.ndarray, bins: int) -> None:
    rows = draw.envelope(values, bins)
    assert (np.diff(rows) > 0).all()
    assert (rows[0], rows[-1]) == (0, len(values) - 1)
    kept = values[rows]
    gap = np.isnan(values)
    # no gap is bridged, none is made: runs of NaN stay as many
    assert np.count_nonzero(np.diff(np.isnan(kept))) == np.count_nonzero(np.diff(gap))
    edge = np.flatnonzero(np.diff(gap))
    assert np.isin([*edge, *(edge + 1)], rows).all()
    if len(values) <= 2 * bins:
        np.testing.assert_array_equal(kept, values)
        return
    assert len(rows) <= 2 * bins + 2 + 2 * np.count_nonzero(np.diff(gap))
    ends = np.linspace(0, len(values), bins + 1).astype(int)
    for start, stop in pairwise(ends):
        part = values[start:stop]
        drawn = kept[(rows >= start) & (rows < stop)]
        if not np.isnan(part).all():
            assert (np.nanmin(drawn), np.nanmax(drawn)) == (np.nanmin(part), np.nanmax(part))


@pytest.mark.parametrize("row", [0, 1, 4999, 7777, 9999])
@pytest.mark.parametrize("peak", [-5.0, 5.0])
def test_a_peak_of_one_row_is_drawn(row: int, peak: float) -> None:
    values = np.sin(np.arange(10_000) / 300.0)
    values[row] = peak
    assert row in draw.envelope(values)
    assert (row in draw.highest(values)) == (peak > 0.0)


def luminance(colour: str) -> float:
    """Return the relative luminance of "#rrggbb", as WCAG 2 defines it."""
    share = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    dark, light = sorted([luminance(one), luminance(other)])
    return (light + 0.05) / (dark + 0.05)


def test_colours_stand_out_from_light_and_dark_paper() -> None:
    """WCAG 2 asks for 4.5 to 1 of letters, and 3 to 1 of lines."""
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    for dark, paper in enumerate(look.PAPER):
        for name, pair in look.COLOURS.items():
            letters = name in ("ink", "muted", "target", "foot")
            assert contrast(pair[dark], paper) >= (4.5 if letters else 3.0), name
        for tint in draw.time_colours(24):
            assert contrast(tint, paper) >= 3.0, tint


def test_a_light_colour_stands_for_one_thing() -> None:
    light = [pair[0] for pair in (look.COLOURS | look.SOFT).values()]
    assert len(set(light)) == len(light)
    assert not set(light) & {*draw.time_colours(24), "#ffffff"}


def test_svg_of_two_figures_in_one_page() -> None:
    found = []
    for key in ("one", "two"):
        with look.project_style():
            figure, (ax,) = draw.panels(1, height=2.0)
            draw.line(ax, np.arange(9.0), np.array([*range(8), 1e-7]), "A", label="_$x$ <&>")
            found.append(look.svg(figure, key, 'a "line"'))
    for key, text in zip(("one", "two"), found, strict=True):
        assert 'aria-label="a &quot;line&quot;"' in text
        assert "var(--A)" in text
        assert look.colour("A") not in text
        ids = re.findall(r' id="([^"]*)"', text)
        assert ids
        assert all(each.startswith(f"{key}-") for each in ids)
        assert set(re.findall(r'(?:url\(#|href="#)([^")]+)', text)) == set(ids)
        assert "http" not in text
        assert not re.search(r' d="[^"]*\.\d{3}', text)


@pytest.mark.parametrize("legend", [False, True])
def test_words_of_panels_are_on_the_paper_and_apart(legend: bool) -> None:
    """Wide numbers, a factor above them, titles, a legend: each has its own place."""
    with look.project_style():
        figure, panels = draw.panels(1, 1, height=4.6)
        for ax, size in zip(panels, (1e-9, -123456.0), strict=True):
            ax.plot([0.0, 0.7], [0.0, size], label="a line")
            ax.set(ylabel="force on the foot [N]")
            ax.set_title("A: RMS", loc="left")
        if legend:
            figure.legend(loc="outside upper center")
        figure.draw_without_rendering()

    found = [ax.get_tightbbox() for ax in panels]
    boxes = [box for box in found if box is not None]
    boxes += [shown.get_window_extent() for shown in figure.legends]
    assert len(boxes) == 2 + legend
    for box in boxes:
        assert box.x0 >= figure.bbox.x0
        assert box.x1 <= figure.bbox.x1
        assert box.y0 >= figure.bbox.y0
        assert box.y1 <= figure.bbox.y1
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def test_shading_of_stance_is_where_the_foot_stands() -> None:
    time = np.arange(1.0, 6001.0)
    down = np.zeros(6000, dtype=bool)
    down[1000:2000] = down[5999] = True
    with look.project_style():
        _, (ax,) = draw.panels(1, height=2.0)
        draw.shade_stance(ax, time, down)
    spans = [path.get_extents().intervalx for path in ax.collections[0].get_paths()]
    np.testing.assert_allclose(spans, [[1000.0, 2000.0], [5990.0, 6000.0]])


@pytest.mark.parametrize(
    ("peak", "unit"),
    [(1.0, "mm"), (1e-4, "mm"), (9e-5, "um"), (2e-7, "um"), (9e-8, "nm"), (0.0, "nm")],
)
def test_unit_of_a_length(peak: float, unit: str) -> None:
    assert draw.length_unit(peak)[1] == unit


def test_text_is_escaped_once() -> None:
    assert html.text("<b>\n'a' & b") == "&lt;b&gt; &#x27;a&#x27; &amp; b"
    assert html.text(html.text("<")) == "&lt;"
    assert "&lt;i&gt;" in html.table("<i>", ["<i>"], [["<i>", "<i>"]])
    assert "<i>" not in html.table("<i>", ["<i>"], [["<i>", "<i>"]])
    assert "<title>&lt;i&gt;</title>" in html.page("<i>", [])


def test_only_long_lines_of_a_table_wrap() -> None:
    cells = ["0.1188 um", html.Cell("3.338 mN m<small>+12.5 points</small>"), "a" * 17, "&" * 16]
    table = html.table("", ["", *"1234"], [["row", *cells]])
    assert re.findall(r'<td class="(\w+)"', table) == ["number", "number", "words", "number"]


def test_no_line_ends_within_a_number_and_its_unit() -> None:
    cells = ["17.9 to 19.8 mN m", "543.5 mN m at 0.009 s", "25 to 27.5 deg C", "0.5 mm mobile"]
    table = html.table("", ["", *"1234"], [["of 5 mN m", *cells]])
    assert "17.9 to 19.8&nbsp;mN&nbsp;m<" in table
    assert "543.5&nbsp;mN&nbsp;m at 0.009&nbsp;s<" in table
    assert "25 to 27.5&nbsp;deg&nbsp;C<" in table
    assert "0.5&nbsp;mm mobile" in table


def test_plain_values() -> None:
    values = [True, None, 0.123456789, [1, 2.0], [], "a"]
    assert [html.plain(v) for v in values] == ["yes", "none", "0.12346", "1, 2", "none", "a"]
