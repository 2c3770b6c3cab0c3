"""Scenarios: defaults, changes, the measured window, the way back from TOML, and refusals."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
import tomli_w
from shipped import NAMES, in_short, shortened

from fivebar_sim import rollout
from fivebar_sim.control import Setpoints
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import ConfigError
from fivebar_sim.files import resources
from fivebar_sim.geometry import FiveBar
from fivebar_sim.paths import Circle, Csv, Ellipse
from fivebar_sim.scenario import Scenario
from fivebar_sim.scenario.scenario import Sim, copied_name
from fivebar_sim.scenario.scenes import Air
from fivebar_sim.scenario.together import MOST_STEPS

ELLIPSE = """
duration = 0.6
[path]
kind = "ellipse"
centre = [0.0, -0.072]
radii = [0.02, 0.008]
frequency = 4.0
ramp = 0.1
"""
CSV = "time_s,x_m,z_m\n0,0,-0.08\n0.2,0.01,-0.075\n0.4,0,-0.07\n0.6,-0.01,-0.075\n"


def scenario(folder: Path, *settings: str, text: str = ELLIPSE) -> Scenario:
    (folder / "short.toml").write_text(text, encoding="utf-8")
    return Scenario.load(folder / "short.toml", settings)


def refused(folder: Path, *settings: str, text: str = ELLIPSE) -> str:
    """Return the message without the file's name, which it must begin with."""
    with pytest.raises(ConfigError) as caught:
        scenario(folder, *settings, text=text)
    where, message = str(caught.value).split(": ", 1)
    assert where == str(folder / "short.toml")
    assert "\n" not in message
    return message


# law


def test_what_is_left_out_takes_defaults(tmp_path: Path) -> None:
    loaded = scenario(tmp_path)
    assert loaded.name == "short"  # as the file
    assert loaded.leg == FiveBar.load("classic")
    assert (loaded.scene, loaded.duration, loaded.controller_name) == (Air(), 0.6, "servo")
    assert (loaded.servo, loaded.sim, loaded.limits) == (Servo(), Sim(), {})
    assert loaded.steps == 600
    assert scenario(tmp_path, text=ELLIPSE.replace("duration = 0.6", "")).duration == 4.0


@pytest.mark.parametrize(
    "limits",
    [
        "[limits]\ntracking.rms = 1e-3\nload.share_A = [0.4, 0.6]\n",
        '[limits]\n"tracking.rms" = 1e-3\n"load.share_A" = [0.4, 0.6]\n',
        "[limits.tracking]\nrms = 1e-3\n[limits.load]\nshare_A = [0.4, 0.6]\n",
    ],
)
def test_limits_may_be_dotted_quoted_or_nested(tmp_path: Path, limits: str) -> None:
    assert scenario(tmp_path, text=ELLIPSE + limits).limits == {
        "tracking.rms": (-math.inf, 1e-3),
        "load.share_A": (0.4, 0.6),
    }


def test_leg_is_a_preset_a_table_with_changes_or_a_file_beside(tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text("L1 = 0.05\nL4 = 0.05\n", encoding="utf-8")
    q8bot = scenario(tmp_path, text='leg = "q8bot"\n' + ELLIPSE.replace("-0.072", "-0.05")).leg
    assert q8bot == FiveBar.load("q8bot")
    changed = scenario(tmp_path, text=ELLIPSE + '[leg]\npreset = "classic"\nL2 = 0.07\n').leg
    assert (changed.L2, changed.L3, changed.name) == (0.07, 0.06, "classic")
    for text in ('leg = "long.toml"\n' + ELLIPSE, ELLIPSE + '[leg]\npreset = "long.toml"\n'):
        beside = scenario(tmp_path, text=text).leg
        assert (beside.L1, beside.L4, beside.name) == (0.05, 0.05, "long")


def test_the_rotor_comes_with_the_servo_unless_the_leg_says_otherwise(tmp_path: Path) -> None:
    servo = Servo.load("xl330")
    assert servo.armature is not None

    def armature(*settings: str) -> float:
        return Scenario.load("classic-ellipse", settings).leg.armature

    own = FiveBar.load("classic").armature
    assert armature() == armature("servo=ideal") == own != servo.armature
    assert armature("servo=xl330") == armature("leg=minitaur", "servo=xl330") == servo.armature
    assert armature("servo=xl330", "servo.armature=3e-4") == 3e-4
    assert armature("servo=xl330", "leg.armature=2e-5") == 2e-5

    # Who writes a leg's file knows its motors; a shipped leg has none of its own.
    lengths = "L1 = 0.04\nL2 = 0.06\nL3 = 0.06\nL4 = 0.04\nL5 = 0.03\n"
    for text, wanted in ((lengths, servo.armature), (lengths + "armature = 2e-5\n", 2e-5)):
        file = tmp_path / "own.toml"
        file.write_text(text, "utf-8")
        assert armature("servo=xl330", f"leg={file.as_posix()}") == wanted


@pytest.mark.parametrize("name", ["xl330", "hobby-9g", "t-motor"])
def test_the_rotor_of_a_servo_is_that_of_its_resolved_scenario(name: str) -> None:
    scenario = Scenario.load("classic-ellipse", [f"servo={name}"])
    again = Scenario.from_table(scenario.table(), "again", Path())
    assert again.leg.armature == scenario.leg.armature == Servo.load(name).armature


@pytest.mark.parametrize("timestep", [0.001, 0.00025, 0.0003, 0.01])
@pytest.mark.parametrize(("ramp", "duration"), [(0.1, 0.6), (0.0, 0.5), (0.2, 1.0), (0.25, 4.0)])
def test_window_is_whole_periods_after_the_ramp(
    tmp_path: Path, timestep: float, ramp: float, duration: float
) -> None:
    loaded = scenario(
        tmp_path, f"sim.timestep={timestep}", f"path.ramp={ramp}", f"duration={duration}"
    )
    rows = loaded.window
    period = 0.25
    time = (np.arange(loaded.steps) + 1) * timestep
    assert np.all(time[rows] > ramp - timestep / 2)
    periods = math.floor((duration - ramp) / period + 1e-9)
    assert (rows.stop - rows.start) * timestep == pytest.approx(periods * period, abs=timestep)
    assert rows.stop <= loaded.steps
    assert loaded.steps == pytest.approx(duration / timestep, abs=0.5)


def test_window_of_a_path_without_period_is_all_after_the_ramp(tmp_path: Path) -> None:
    (tmp_path / "foot.csv").write_text(CSV, encoding="utf-8")
    loaded = scenario(tmp_path, "path.kind=csv", "path.file=foot.csv")
    assert loaded.window == slice(100, 600)


@pytest.mark.parametrize(
    ("drop", "start", "stop"), [(0.0, 100, 600), (0.9e-3, 100, 600), (1e-3, 0, 500), (0.5, 0, 500)]
)
def test_landing_is_measured_from_its_drop_on(
    tmp_path: Path, drop: float, start: int, stop: int
) -> None:
    """The impact may come before the ramp ends; a foot that falls less than 1 mm just stands."""
    loaded = scenario(tmp_path, "scene.kind=rail", f"scene.drop={drop}", "duration=0.6")
    assert loaded.window == slice(start, stop)


@pytest.mark.parametrize("name", [*NAMES, "odd"])
def test_resolved_table_gives_the_same_run(tmp_path: Path, name: str) -> None:
    if name == "odd":
        (tmp_path / "feet.txt").write_text(CSV, encoding="utf-8")
        settings = ["path.kind=csv", "path.file=feet.txt", "leg.mass=[0.1, 0.2, 0.3, 0.4]"]
        first = scenario(
            tmp_path, *settings, "servo.limit=0.2", "limits.load.share_A=[0.4,0.6]", "leg.tilt=0.1"
        )
    else:
        first = shortened(name)
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "scenario.toml").write_text(tomli_w.dumps(first.table()), encoding="utf-8")
    for file, content in first.files.items():
        (folder / file).write_bytes(content)
    again = Scenario.load(folder / "scenario.toml")
    assert again.table() == first.table()
    if isinstance(first.path, Csv) and isinstance(again.path, Csv):
        assert Path(again.path.file) == folder / str(copied_name(first.path))
        again = msgspec.structs.replace(again, path=first.path)
    assert again == first
    if not isinstance(first.controller, Setpoints):
        return  # as long as ten others; test_record.py runs one of them again
    one = rollout.run(first) if name == "odd" else in_short(name)
    two = rollout.run(Scenario.load(folder / "scenario.toml"))
    for column in one.record:
        np.testing.assert_array_equal(two.record[column], one.record[column])
    assert two.metrics == one.metrics


@pytest.mark.parametrize("name", ["foot.csv", "metrics.json", "scenario.toml", ".hidden"])
def test_copied_csv_is_called_as_no_other_file_of_a_run(name: str) -> None:
    assert copied_name(Csv(file=f"/somewhere/{name}")) == name.removesuffix(".csv") + ".csv"


# edge


def test_settings_are_applied_in_order(tmp_path: Path) -> None:
    loaded = scenario(tmp_path, "sim.seed=1", "duration=1", "sim.seed=2", "servo={kp=4}")
    assert (loaded.sim.seed, loaded.duration, loaded.servo.kp) == (2, 1.0, 4.0)
    assert isinstance(loaded.duration, float)


def test_settings_reach_into_a_short_leg(tmp_path: Path) -> None:
    for text in (ELLIPSE, 'leg = "classic"\n' + ELLIPSE, ELLIPSE + '[leg]\npreset = "classic"\n'):
        leg = scenario(tmp_path, "leg.L2=0.07", "leg.L3=0.065", text=text).leg
        assert (leg.L1, leg.L2, leg.L3) == (0.04, 0.07, 0.065)
    small = scenario(tmp_path, "leg.L5=0.02", "leg.preset=q8bot", "path.centre=[0,-0.05]").leg
    assert (small.L1, small.L5, small.name) == (0.025, 0.02, "q8bot")


def test_settings_reach_into_limits_however_written(tmp_path: Path) -> None:
    for head in ("tracking.rms = 1", '"tracking.rms" = 1'):
        text = f"{ELLIPSE}[limits]\n{head}\nwarnings = 0\n"
        for key in ("limits.tracking.rms", 'limits."tracking.rms"'):
            loaded = scenario(tmp_path, f"{key}=[0,2]", "limits.tracking.max=3", text=text)
            assert loaded.limits == {
                "tracking.rms": (0.0, 2.0),
                "warnings": (-math.inf, 0.0),
                "tracking.max": (-math.inf, 3.0),
            }
    assert scenario(tmp_path, "limits={}", text=text).limits == {}


def test_another_kind_keeps_the_keys_that_both_have(tmp_path: Path) -> None:
    circle = scenario(tmp_path, "path.kind=circle", "path.radius=0.01").path
    assert circle == Circle(centre=(0.0, -0.072), radius=0.01, frequency=4.0, ramp=0.1)
    back = scenario(tmp_path, "path.kind=circle", "path.kind=ellipse", "path.radii=[0.01,0.01]")
    assert isinstance(back.path, Ellipse)
    # set before the switch, a key of the new kind is kept as well
    assert scenario(tmp_path, "path.radius=0.01", "path.kind=circle").path == circle


def test_shipped_scenarios_load_by_name() -> None:
    for name, path in resources.shipped("scenarios").items():
        assert Scenario.load(name) == Scenario.load(path)
        assert Scenario.load(name).name == name


@pytest.mark.parametrize("name", ["two words", "é⌘", "L2=70mm", "-x", "[red]", "x" * 200])
def test_name_may_be_any_plain_file_name(tmp_path: Path, name: str) -> None:
    assert scenario(tmp_path, f"name='{name}'").name == name


# refusal


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "a/b", "../a", ".hidden", " x", "x ", "a\\\\b", "a\\nb", "a\\u0000", "x" * 201],
)
def test_name_that_is_no_file_name_is_refused(tmp_path: Path, name: str) -> None:
    message = refused(tmp_path, f'name="{name}"')
    assert message.startswith("name must be a plain file name of 1 to 200 bytes, got '")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("duratoin=1", "unknown key 'duratoin'; known: controller, converge, duration, force,"),
        ("name=1", "name must be a plain file name of 1 to 200 bytes, got 1"),
        (
            "scene=aire",
            "unknown scene 'aire'; known: air, payload, rail, treadmill (did you mean 'air'?)",
        ),
        (
            "sim.Timestep=1e-3",
            "[sim]: unknown key 'Timestep'; known: integrator, seed, timestep (did you mean "
            "'timestep'?)",
        ),
        ("scene=[1]", "scene must be the name of a kind or a table, got [1]"),
        ("duration=0", "duration must be in (0, inf) s, got 0"),
        ("duration=true", "duration must be in (0, inf) s, got True"),
        ("duration='4'", "duration must be in (0, inf) s, got '4'"),
        ("duration=inf", "duration must be finite, got inf"),
        ("duration=1e9", f"duration must be 2 to {MOST_STEPS} timesteps of 0.001 s, got 1e+09 s"),
        ("duration=0.3", "duration must be longer than the ramp of 0.1 s and one period of 0.25 s"),
        ("sim.timestep=0", "sim.timestep must be in (0, inf) s, got 0.0"),
        ("sim.timestep=1e-12", f"duration must be 2 to {MOST_STEPS} timesteps of 1e-12 s, got 0.6"),
        ("sim.timestp=1", "[sim]: unknown key 'timestp'; known: integrator, seed, timestep (did"),
        ("sim.seed=-1", "sim.seed must be in [0, inf), got -1"),
        ("sim.integrator=euler", "sim.integrator must be one of 'discrete', 'implicitfast', got"),
        ("leg=clasic", "leg.preset: unknown leg preset 'clasic'; known: airhockey, classic,"),
        ("leg=1", "leg must be the name of a preset or a table, got 1"),
        ("leg.preset=[]", "leg.preset must be a preset's name, got []"),
        ("leg=no.toml", "leg.preset: cannot read leg "),
        ("leg=folder.toml", "leg.preset: cannot read leg "),
        ("leg.L7=1", "[leg]: unknown key 'L7'; known: L1, L2,"),
        ("leg.L1=0", "[leg]: L1 must be in (0, 1000) m, got 0"),
        ("leg.L1=-0.1", "[leg]: L1 must be in (0, 1000) m, got -0.1"),
        ("leg.L1=true", "[leg]: L1 must be in (0, 1000) m, got True"),
        ("leg.L1=nan", "leg.L1 must be finite, got nan"),
        ("leg.L2=2", "[leg]: L2: the links can never close: the longest may be at most"),
        ("leg.gravity=[nan,0]", "leg.gravity must be finite, got [nan, 0]"),
        ("path=1", "[path] needs a kind; known: angles, circle, csv, ellipse, figure-eight, gait"),
        (
            "path.kind=elipse",
            "path.kind: unknown path 'elipse'; known: angles, circle",
        ),
        ("path.kind=[]", "path.kind: unknown path '[]'; known: angles"),
        ("path.kind=circle", "path.radius is missing"),
        ("path.kind.a=1", "path.kind is a value, so it has no path.kind.a"),
        ("path.radii=[0.02]", "path.radii must be an array of length 2, got [0.02]"),
        ("path.radii=[0.02,nan]", "path.radii must be finite, got [0.02, nan]"),
        ("path.radii=[0.02,0]", "path.radii"),
        ("path.frequency=1e9", "path.frequency must be in (0, 1e+06) Hz, got 1000000000.0"),
        ("path.frequency=5e-324", "duration must be longer than the ramp of 0.1 s and one period"),
        ("path.ramp=1e308", "duration must be longer than the ramp of 1e+308 s"),
        ("servo.kp=0", "servo.kp must be in (0, inf) N m/rad, got 0.0"),
        ("servo.kd=-1", "servo.kd must be in [0, inf) N m s/rad, got -1.0"),
        ("servo.limit=0", "servo.limit must be in (0, inf) N m, got 0.0"),
        ("servo.rate=3000", "servo.rate must be in (0, 1000] Hz, at most one command a timestep"),
        ("servo.preset=xl", "servo.preset: unknown servo preset 'xl'; known: hobby-9g, ideal,"),
        ("controller=servo", "controller must be a table, got 'servo'"),
        ("controller.name=servoo", "controller.name: unknown controller 'servoo'; known: computed"),
        ("controller.name={}", "controller.name: unknown controller '{}'; known: computed"),
        ("controller.gain=1", "[controller]: unknown key 'gain'; known: arithmetic, feedforward"),
        ("controller.feedforward=all", "controller.feedforward must be one of 'none', 'velocity'"),
        ("limits.tracking.rm=1", "[limits]: unknown key 'tracking.rm'; known: branch.flips,"),
        ("limits.tracking.rms=[1,0]", "limits.tracking.rms must be an upper bound or [low, high]"),
        ("limits.warnings=nan", "limits.warnings must be finite, got nan"),
    ],
)
def test_illegal_key_is_refused(tmp_path: Path, setting: str, message: str) -> None:
    (tmp_path / "folder.toml").mkdir()
    assert refused(tmp_path, setting).startswith(message)


def test_leg_file_is_checked_by_itself(tmp_path: Path) -> None:
    file = tmp_path / "leg.toml"
    for text, message in {
        "L9 = 1": "unknown key 'L9'; known: L1, L2,",
        "L1 = -1": "L1 must be in (0, 1000) m, got -1",
        "L1 = nan": "L1 must be finite, got nan",
        f"L1 = {10**400}": "L1 must fit in 64 bits, has 1329",
        "L1 = ": "not TOML: Invalid value",
    }.items():
        file.write_text(text, encoding="utf-8")
        assert refused(tmp_path, "leg=leg.toml").startswith(f"leg.preset: {file}: {message}")


def test_path_that_ends_before_the_run_is_refused(tmp_path: Path) -> None:
    (tmp_path / "foot.csv").write_text(CSV, encoding="utf-8")
    csv = ["path.kind=csv", "path.file=foot.csv"]
    beyond = refused(tmp_path, *csv, "duration=1")
    assert beyond == "duration must be at most the path's 0.65 s, got 1 s"
    # nine steps of 0.07 s, as the duration is rounded to, are longer than the path
    beyond = refused(tmp_path, *csv, "path.ramp=0", "sim.timestep=0.07")
    assert beyond.startswith("duration must be at most")


def test_unknown_source_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^unknown scenario 'classic-elipse'; known: .*\(did"):
        Scenario.load("classic-elipse")
    with pytest.raises(ConfigError, match=r"^cannot read scenario .*no\.toml: No such file"):
        Scenario.load(tmp_path / "no.toml")
    with pytest.raises(ConfigError, match=r"^x: name must be a plain file name"):
        Scenario.from_table({}, "x", tmp_path)


def test_own_bars_of_convergence_survive_a_run_directory() -> None:
    scenario = Scenario.load("classic-ellipse", ["converge.tracking.rms=0.5"])
    assert scenario.converge == {"tracking.rms": 0.5}
    table = scenario.table()
    assert table["converge"] == {"tracking.rms": 0.5}
    assert Scenario.from_table(table, "again", Path()).converge == scenario.converge
    assert "converge" not in Scenario.load("classic-ellipse").table()
