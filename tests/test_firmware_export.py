"""`fivebar export LEG --c DIR`: a library that compiles, with the leg's numbers, or one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from firmware_builds import HERE, need, run
from shell import Shell

import fivebar_sim
from fivebar_sim import firmware
from fivebar_sim.errors import ConfigError, GeometryError
from fivebar_sim.files import resources
from fivebar_sim.firmware import example, export, source
from fivebar_sim.firmware.servo import servo_command
from fivebar_sim.geometry import FiveBar

PRESETS = ("airhockey", "classic", "doggo", "extended", "minitaur", "q8bot")
SKETCH = Path(export.SKETCH)


def test_it_writes_a_library(shell: Shell) -> None:
    assert shell("export", "classic", "--c", "out").status == 0
    names = sorted(p.relative_to("out").as_posix() for p in Path("out").rglob("*") if p.is_file())
    assert names == sorted(export.texts(FiveBar.load("classic")))
    library = json.loads(Path("out/library.json").read_text("utf-8"))
    assert library["version"] == fivebar_sim.__version__
    assert f"version={fivebar_sim.__version__}\n" in Path("out/library.properties").read_text()
    # The sources lie in the checkout as an export of the classic leg.
    for name in (export.HEADER, export.SOURCE, export.SKETCH, export.GAIT):
        shipped = resources.file("firmware", name)
        assert Path("out", name).read_bytes() == shipped.read_bytes(), name


@pytest.mark.parametrize("flags", [(), ("-DFIVEBAR_DOUBLE",)])
@pytest.mark.parametrize("leg", ["doggo", "extended"])
def test_the_exported_leg_is_the_prepared_one(
    leg: str, flags: tuple[str, ...], tmp_path: Path
) -> None:
    need("cc")
    place = export.write(FiveBar.load(leg), tmp_path / "out")
    program = tmp_path / "same"
    include = f"-I{place}"
    run("cc", "-O0", *flags, include, HERE / "same.c", place / export.SOURCE, "-o", program)
    run(program)


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_fits(name: str) -> None:
    leg = FiveBar.load(name)
    assert set(PRESETS) == set(resources.shipped("models/legs"))
    text = export.texts(leg)[export.SOURCE]
    made = firmware.of(leg)
    assert f"{source.number(made.L1)}, {source.number(made.L2)}" in text
    assert text.count(source.HEADING) == 1


def test_constants_read_back_as_the_same_bits() -> None:
    rng = np.random.default_rng(1)
    drawn = rng.normal(size=400) * 10.0 ** rng.integers(-25, 25, 400)
    for kind in (np.float32, np.float64):
        for value in (*drawn.astype(kind), kind(2.0), kind(-0.0)):
            text = source.number(value)
            assert "." in text or "e" in text
            assert text.endswith("f") == (kind is np.float32)
            back = kind(text.removesuffix("f"))
            assert back.tobytes() == value.tobytes()


def test_the_sketch_plays_the_gait(tmp_path: Path) -> None:
    need("c++")
    leg = FiveBar.load("extended")
    place = export.write(leg, tmp_path / "out")
    folders = (place, (place / SKETCH).parent, HERE / "stubs")
    include = [f"-I{folder}" for folder in folders]
    program = tmp_path / "play"
    run("cc", "-std=c99", "-O0", "-c", place / export.SOURCE, "-o", tmp_path / "leg.o")
    flags = ("-std=c++11", "-O0", "-Wall", "-Wextra", "-pedantic")
    run("c++", *flags, *include, HERE / "play.cpp", tmp_path / "leg.o", "-o", program)
    played = np.array([line.split() for line in run(program).splitlines()], dtype=int)

    # The same pulses from NumPy, and the foot they put where the gait wants it.
    path, rows = example.table(firmware.of(leg), leg)
    servos = example.servos_of(rows)
    pulses = [servo_command(servo, rows[:, k])[0] for k, servo in enumerate(servos)]
    np.testing.assert_array_equal(played, np.stack(pulses, axis=-1))
    foot, status = firmware.forward(firmware.of(leg), rows, leg.assembly)
    assert not status.any()
    np.testing.assert_allclose(foot, path, rtol=0, atol=2e-6 * leg.size)


def test_an_earlier_export_is_replaced(tmp_path: Path) -> None:
    place = export.write(FiveBar.load("classic"), tmp_path / "out")
    export.write(FiveBar.load("q8bot"), place)
    assert "q8bot" in (place / export.SOURCE).read_text("utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("foreign", ["main.cpp", "src/robot.c", export.SOURCE])
def test_other_peoples_files_are_left_alone(foreign: str, tmp_path: Path) -> None:
    mine = tmp_path / "out" / foreign
    mine.parent.mkdir(parents=True)
    mine.write_text("int main(void);\n")
    with pytest.raises(ConfigError, match="an earlier export"):
        export.write(FiveBar.load("classic"), tmp_path / "out")
    assert [path for path in (tmp_path / "out").rglob("*") if path.is_file()] == [mine]
    assert mine.read_text() == "int main(void);\n"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_current_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="it is the current folder; give one within it"):
        export.write(FiveBar.load("classic"), ".")
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine\n")
    with pytest.raises(ConfigError, match="not a directory"):
        export.write(FiveBar.load("classic"), tmp_path / "out")


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"L1": 4e-5, "L2": 5e-5, "L3": 5e-5, "L4": 4e-5, "L5": 0.0}, r"\[0.0001, 1000\] m"),
        ({"L1": 1e-4, "L2": 0.9, "L3": 0.9, "L4": 1e-4, "L5": 1e-5}, "at least 0.001"),
        ({"L6": 0.06, "bend": 3.1415}, "at least 0.001"),
    ],
)
def test_a_leg_that_float_cannot_hold_is_refused(
    keys: dict[str, Any], told: str, tmp_path: Path
) -> None:
    leg = FiveBar(**keys, scale="any", name="odd")
    with pytest.raises(GeometryError, match=f"cannot hold the leg odd.*{told}"):
        export.write(leg, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_nothing_to_export_is_one_line(shell: Shell) -> None:
    said = shell("export", "classic")
    assert said.status == 2
    options = "--mjcf FILE, --urdf FILE, --c DIR, --table FILE or --mcap FILE"
    assert said.err == f"fivebar: say what to export: {options}\n"


def test_names_cannot_break_the_source() -> None:
    leg = FiveBar(name="*/ int x; /* Bö")
    heading = source.definition(leg).splitlines()[0]
    assert heading.count("*/") == 1
    assert heading.isascii()
