"""Geometry: the presets, link inertias against plain integration, and every refusal."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fivebar_sim.errors import ConfigError, GeometryError
from fivebar_sim.files import resources
from fivebar_sim.geometry import MODES, FiveBar, read_table
from fivebar_sim.links import Link, ball, capsule, combined, moved

CLASSIC = FiveBar()
LUMPED = FiveBar(
    mass=(0.1, 0.2, 0.3, 0.4), com=(0.01, 0.02, -0.03, 0.0), inertia=(1e-5, 2e-5, 3e-5, 4e-5)
)


def integrated(*bodies: tuple[tuple[float, float], tuple[float, float], float]) -> Link:
    """Return the inertia of capsules (start, end, radius) of density 1 by adding up a fine grid.

    At a planar distance d from its axis a capsule is 2 sqrt(r^2 - d^2) thick. Overlaps count twice.
    """
    h = 1e-4
    axes = [np.arange(low + h / 2, high, h) for low, high in ((-0.01, 0.09), (-0.01, 0.03))]
    p = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = np.zeros(len(p))
    for start, end, r in bodies:
        a = np.subtract(p, start)
        b = np.subtract(end, start)
        along = np.clip((a @ b) / max(float(b @ b), 1e-300), 0.0, 1.0)
        d2 = np.sum((a - along[:, None] * b) ** 2, axis=-1)
        cells += 2.0 * np.sqrt(np.maximum(r * r - d2, 0.0)) * h**2
    mass = float(cells.sum())
    x, y = (cells @ p / mass).tolist()
    return Link(mass, (x, y), float(cells @ np.sum((p - [x, y]) ** 2, axis=-1)))


def assert_links_equal(link: Link, other: Link, rtol: float) -> None:
    size = math.sqrt(other.inertia / other.mass)  # radius of gyration
    np.testing.assert_allclose(link.mass, other.mass, rtol=rtol)
    np.testing.assert_allclose(link.com, other.com, rtol=0, atol=rtol * size)
    np.testing.assert_allclose(link.inertia, other.inertia, rtol=rtol)


# law


def test_moved_there_and_back_is_the_same_body() -> None:
    body = Link(0.3, (0.01, -0.02), 1e-4)
    back = moved(moved(body, (0.0, 0.0), 0.7), (0.0, 0.0), -0.7)
    assert_links_equal(back, body, 1e-14)
    assert moved(body, (0.5, 0.25)).com == pytest.approx((0.51, 0.23))
    assert moved(body, (0.0, 0.0), math.pi / 2).com == pytest.approx((0.02, 0.01))


def test_combined_keeps_mass_moment_and_inertia_about_any_point() -> None:
    rng = np.random.default_rng(1)
    bodies = [Link(m, (x, y), i) for m, x, y, i in rng.uniform(0.1, 1.0, (5, 4)).tolist()]
    whole = combined(*bodies)
    for about in ((0.0, 0.0), (3.0, -2.0)):
        parts = [b.inertia + b.mass * math.dist(b.com, about) ** 2 for b in bodies]
        assert whole.inertia + whole.mass * math.dist(whole.com, about) ** 2 == pytest.approx(
            sum(parts)
        )
    assert_links_equal(combined(*bodies[::-1]), whole, 1e-14)
    assert_links_equal(combined(combined(*bodies[:2]), *bodies[2:]), whole, 1e-14)
    assert_links_equal(combined(bodies[0]), bodies[0], 1e-14)
    assert combined(Link(0.0, (0.1, 0.0), 0.0), Link(0.0, (0.3, 0.0), 0.0)).mass == 0.0


# oracle


def test_capsule_and_ball_against_integration() -> None:
    assert_links_equal(
        capsule(0.06, 0.004, 1.0), integrated(((0.0, 0.0), (0.06, 0.0), 0.004)), 1e-3
    )
    assert_links_equal(ball(0.006, 1.0), integrated(((0.0, 0.0), (0.0, 0.0), 0.006)), 1e-3)


def test_L2_carries_foot_and_extension_against_integration() -> None:
    """The link, the ball at F and the bent extension, as bodies that overlap at C."""
    F = (0.06 + 0.02 * math.cos(0.7), 0.02 * math.sin(0.7))
    parts = [((0.0, 0.0), (0.06, 0.0), 0.004), ((0.06, 0.0), F, 0.004), (F, F, 0.006)]
    leg = FiveBar(L6=0.02, bend=0.7, density=1.0)
    assert leg.foot_offset == pytest.approx(F)
    assert_links_equal(leg.links[1], integrated(*parts), 1e-3)
    straight = [((0.0, 0.0), (0.06, 0.0), 0.004), ((0.06, 0.0), (0.06, 0.0), 0.006)]
    assert_links_equal(FiveBar(density=1.0).links[1], integrated(*straight), 1e-3)


def test_classic_masses_by_hand() -> None:
    """Masses are rho pi r^2 (L + 4 r / 3): 2.73 g, 3.94 g, and 1.09 g of foot on L2."""
    L1, L2, L3, L4 = CLASSIC.links
    assert L1.mass == pytest.approx(1200 * math.pi * 16e-6 * (0.04 + 0.016 / 3), rel=1e-14)
    assert [round(1e3 * m, 2) for m in (L1.mass, L3.mass, L2.mass - L3.mass)] == [2.73, 3.94, 1.09]
    assert (L1, L1.com, L3.com) == (L4, (0.02, 0.0), (0.03, 0.0))
    # parallel axes, by the reduced mass
    foot = L2.mass - L3.mass
    d = 0.03
    reduced = foot * L3.mass / L2.mass
    assert L2.inertia == pytest.approx(
        L3.inertia + 0.4 * foot * 0.006**2 + reduced * d**2, rel=1e-13
    )
    assert L2.com[0] == pytest.approx(0.03 + foot / L2.mass * d)


def test_given_masses_are_the_whole_links() -> None:
    assert [link.mass for link in LUMPED.links] == [0.1, 0.2, 0.3, 0.4]
    assert [link.com for link in LUMPED.links] == [
        (0.01, 0.0),
        (0.02, 0.0),
        (-0.03, 0.0),
        (0.0, 0.0),
    ]
    assert [link.inertia for link in LUMPED.links] == [1e-5, 2e-5, 3e-5, 4e-5]
    rods = FiveBar(mass=(0.12, 0.12, 0.24, 0.24)).links
    assert [link.com for link in rods] == [(0.02, 0.0), (0.03, 0.0), (0.03, 0.0), (0.02, 0.0)]
    assert [link.inertia for link in rods] == pytest.approx([1.6e-5, 3.6e-5, 7.2e-5, 3.2e-5])


def test_centres_may_lie_off_the_lines() -> None:
    across = (0.001, -0.002, 0.003, -0.004)
    beside = replace(LUMPED, com_across=across)
    assert [link.com for link in beside.links] == [
        (0.01, 0.001),
        (0.02, -0.002),
        (-0.03, 0.003),
        (0.0, -0.004),
    ]
    assert [link.inertia for link in beside.links] == [link.inertia for link in LUMPED.links]


@pytest.mark.parametrize("bend", [0.0, 0.35, -1.2, 3.0])
def test_rod_of_the_foot_link_goes_on_to_the_foot(bend: float) -> None:
    """Mass spread evenly along B-C-F, added up in pieces; the other rods end at their joints."""
    leg = FiveBar(L6=0.025, bend=bend, mass=(0.12, 0.17, 0.24, 0.24))
    pieces = 200_000
    s = (np.arange(pieces) + 0.5) / pieces * (leg.L2 + leg.L6)
    turn = np.exp(1j * bend)
    place = np.where(s < leg.L2, s, leg.L2 + (s - leg.L2) * turn)
    centre = place.mean()
    L1, L2, L3, L4 = leg.links
    assert L2.mass == 0.17
    assert complex(*L2.com) == pytest.approx(centre, abs=1e-12)
    assert L2.inertia == pytest.approx(0.17 * np.mean(np.abs(place - centre) ** 2), rel=1e-8)
    straight = FiveBar(mass=leg.mass).links
    assert (L1, L3, L4) == (straight[0], straight[2], straight[3])


def test_straight_extension_is_one_longer_rod() -> None:
    leg = FiveBar(L6=0.02, mass=(0.12, 0.12, 0.24, 0.24))
    assert leg.links[1].com == pytest.approx((0.04, 0.0))
    assert leg.links[1].inertia == pytest.approx(0.12 * 0.08**2 / 12)


# presets and files


def test_every_preset_loads_under_its_name() -> None:
    presets = resources.shipped("models/legs")
    assert {"classic", "q8bot"} <= set(presets)
    for name, path in presets.items():
        leg = FiveBar.load(name)
        assert leg.name == name
        assert FiveBar.load(path) == FiveBar.load(str(path)) == leg
        assert all(link.mass > 0.0 and link.inertia > 0.0 for link in leg.links)


def test_classic_is_the_defaults() -> None:
    assert FiveBar.load("classic") == FiveBar(name="classic")


def test_leg_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text("L2 = 1\nmode = [1, -1]\nL4 = 0.9\nmass = [1, 2, 3, 4]\n", encoding="utf-8")
    leg = FiveBar.load(path)
    assert (leg.L2, leg.mode, leg.mass, leg.name) == (1, (1, -1), (1.0, 2.0, 3.0, 4.0), "long")
    assert read_table(path) == {
        "name": "long", "L2": 1, "mode": [1, -1], "L4": 0.9, "mass": [1, 2, 3, 4]
    }  # fmt: skip


def test_leg_is_frozen_and_a_value() -> None:
    with pytest.raises(FrozenInstanceError):
        CLASSIC.L1 = 1.0  # pyright: ignore[reportAttributeAccessIssue]
    assert hash(FiveBar()) == hash(CLASSIC)
    assert FiveBar() == CLASSIC != FiveBar(bend=0.1)


# edge


@pytest.mark.parametrize(
    ("lengths", "message"),
    [
        ({"L1": 40, "L2": 60}, r"^L1 must be in \[0.001, 3\] m, got 40: .*; did you mean 0.04\?"),
        ({"L4": 4e-5}, r"^L4 must be in \[0.001, 3\] m, got 4e-05: .*; did you mean 0.04\?"),
        ({"L5": 30}, r"^L5 must be in \[0, 3\] m, got 30: .*; did you mean 0.03\?"),
        ({"L6": 90}, r"^L6 must be in \[0, 3\] m, got 90: .*; did you mean 0.09\?"),
        ({"scale": "mm"}, r"^scale must be one of \('leg', 'any'\), got 'mm'$"),
    ],
)
def test_lengths_in_another_unit_are_asked_about(lengths: dict[str, Any], message: str) -> None:
    with pytest.raises(GeometryError, match=message):
        FiveBar(**lengths)


def test_any_scale_is_legal_where_it_is_meant() -> None:
    assert FiveBar(40.0, 60.0, 60.0, 40.0, 30.0, scale="any").size == 100.0


@pytest.mark.parametrize(
    "legal",
    [
        {"L5": 0.0},
        {"L1": 0.25, "L2": 0.25, "L3": 0.25, "L4": 0.25, "L5": 1.0},  # only one pose: stretched
        {"L1": 0.1875, "L2": 0.0625, "L3": 0.0625, "L4": 0.0625, "L5": 0.0},
        {"bend": math.pi, "tilt": -math.pi, "L6": 1.0},
        {"armature": 0.0, "gravity": (0, 0), "L1": 1e-6, "L4": 1e-6, "scale": "any"},
        {"com": (-0.1, 0.5, 0.0, 1.0), "mass": (1, 1, 1, 1)},
        *({"mode": mode, "assembly": 1} for mode in MODES),
    ],
)
def test_limits_themselves_are_legal(legal: dict[str, Any]) -> None:
    leg = FiveBar(**legal)
    assert leg.size == max(leg.L1 + leg.L2 + leg.L6, leg.L4 + leg.L3)


# refusal


@pytest.mark.parametrize("key", ["L1", "L2", "L3", "L4", "radius", "density", "foot_radius"])
@pytest.mark.parametrize("bad", [0, 0.0, -0.01, math.nan, math.inf, "0.04", True, None, [0.04]])
def test_lengths_must_be_positive_numbers(key: str, bad: object) -> None:
    legal = "(0, 1e+06) kg/m^3" if key == "density" else "(0, 1000) m"
    with pytest.raises(GeometryError) as info:
        FiveBar(**{key: bad})  # pyright: ignore[reportArgumentType]
    assert str(info.value) == f"{key} must be in {legal}, got {bad!r}"


@pytest.mark.parametrize("bad", [-0.01, math.nan, math.inf, "0", False, None])
def test_the_rest_must_be_in_range(bad: object) -> None:
    for key, legal in (
        ("L5", r"\[0, 1000\] m"),
        ("L6", r"\[0, 1000\] m"),
        ("armature", r"\[0, 1e\+06\] kg m\^2"),
    ):
        with pytest.raises(GeometryError, match=rf"^{key} must be in {legal}, got "):
            FiveBar(**{key: bad})  # pyright: ignore[reportArgumentType]
    for key in ("bend", "tilt"):
        with pytest.raises(GeometryError, match=rf"^{key} must be in \[-3\.\d+, 3\.\d+\] rad, got"):
            FiveBar(**{key: 4.0 if bad == -0.01 else bad})  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("key", ["L1", "L2", "L3", "L4", "L5"])
def test_links_that_can_never_close_name_the_longest(key: str) -> None:
    lengths = {"L1": 0.01, "L2": 0.02, "L3": 0.03, "L4": 0.04, "L5": 0.05}
    others = sum(lengths.values()) - lengths[key]
    FiveBar(**{**lengths, key: others - 1e-9})  # pyright: ignore[reportArgumentType]
    with pytest.raises(
        GeometryError, match=rf"^{key}: the links can never close: .* together, {others:g} m"
    ):
        FiveBar(**{**lengths, key: others + 1e-9})  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    "bad", [(1,), (1, 0), (1, 1, 1), (2, -1), "ab", 1, None, (0.5, 1), (1, "x")]
)
def test_mode_is_one_of_four(bad: Any) -> None:
    with pytest.raises(
        GeometryError, match=r"^mode must be one of \(\(-1, -1\), .*\(1, 1\)\), got "
    ):
        FiveBar(mode=bad)


@pytest.mark.parametrize("bad", [0, 2, None, "1", math.nan, (1,)])
def test_assembly_is_a_sign(bad: Any) -> None:
    with pytest.raises(GeometryError, match=r"^assembly must be -1 or 1, got "):
        FiveBar(assembly=bad)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"mass": (1.0, 1.0)}, r"^mass must be 4 numbers \[kg\], got \(1\.0, 1\.0\)"),
        ({"mass": 1.0}, r"^mass must be 4 numbers \[kg\], got 1\.0"),
        ({"mass": (1.0, 1.0, 0.0, 1.0)}, r"^mass must be in \(0, 1e\+06\) kg, got 0\.0"),
        ({"mass": (1.0, 1.0, "1", 1.0)}, r"^mass must be in .* kg, got '1'"),
        ({"mass": (1, 1, 1, 1), "com": (0, 0, 0)}, r"^com must be 4 numbers \[m\], got"),
        ({"mass": (1, 1, 1, 1), "com": (0, 0, 0, math.nan)}, r"^com must be in .* m, got nan"),
        (
            {"mass": (1, 1, 1, 1), "inertia": (0, 1, 1, 1)},
            r"^inertia must be in \(0, .* kg m\^2, got 0",
        ),
        ({"com": (0, 0, 0, 0)}, "^com needs mass beside it: four numbers"),
        ({"com_across": (0, 0, 0, 0)}, "^com_across needs mass beside it: four numbers"),
        (
            {"mass": (1, 1, 1, 1), "com_across": (0, 0, 0, 0)},
            r"^com_across needs com beside it: four numbers \[m\]",
        ),
        ({"inertia": (1, 1, 1, 1)}, "^inertia needs mass beside it"),
        ({"L6": 0.06, "bend": math.pi}, "^L6: the foot lies on B"),
        ({"gravity": -9.81}, r"^gravity must be 2 numbers \[m/s\^2\], got -9\.81"),
        ({"gravity": (0.0, math.inf)}, r"^gravity must be in .* m/s\^2, got inf"),
    ],
)
def test_masses_gravity_and_foot_are_checked(table: dict[str, Any], message: str) -> None:
    with pytest.raises(GeometryError, match=message):
        FiveBar(**table)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("l1 = 0.04", r"leg\.toml: unknown key 'l1'; known: L1, L2, "),
        ("densty = 1", r"leg\.toml: unknown key 'densty'; .* \(did you mean 'density'\?\)$"),
        ("L1 = 0", r"leg\.toml: L1 must be in \(0, 1000\) m, got 0$"),
        ("L1 = 'forty'", r"leg\.toml: L1 must be in \(0, 1000\) m, got 'forty'$"),
        ("L1 = {}", r"leg\.toml: L1 must be in \(0, 1000\) m, got \{\}$"),
        ("L1 = ", r"leg\.toml: not TOML: Invalid value"),
        ("L1 = 1\nL1 = 2", r"leg\.toml: not TOML: "),
        ("\xff", r"leg\.toml: not TOML: "),
    ],
)
def test_files_are_refused_by_name_and_key(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "leg.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigError, match=message):
        FiveBar.load(path)


def test_unknown_presets_and_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError,
        match=r"unknown leg preset 'clasic'; known: .*classic.*\(did you mean 'classic'\?\); or a",
    ):
        FiveBar.load("clasic")
    with pytest.raises(
        ConfigError, match=r"^cannot read leg .*none\.toml: No such file or directory$"
    ):
        FiveBar.load(tmp_path / "none.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(ConfigError, match=r"^cannot read leg .*folder\.toml: "):
        FiveBar.load(tmp_path / "folder.toml")


OVERFLOWING = [{"L1": 10**400}, {"mode": (math.inf, 1)}]
UNTYPED = [{"assembly": True}, {"mode": (True, -1)}, {"name": 5}]


@pytest.mark.parametrize("table", OVERFLOWING + UNTYPED)
def test_overflowing_and_untyped_values_are_refused(table: dict[str, Any]) -> None:
    with pytest.raises(GeometryError):
        FiveBar(**table)
