"""`fivebar render`: the leg where kinematics has it, frames in time, and what is refused.

Without a GL the drawing tests are skipped; where the environment says FIVEBAR_GL=required they
fail instead.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from reports import unrecorded
from shell import ELLIPSE, Shell

from fivebar_sim import FiveBar, kinematics, rollout
from fivebar_sim.arrays import Array
from fivebar_sim.errors import ConfigError, RunDirectoryError
from fivebar_sim.files import resources
from fivebar_sim.metrics import JOINT_COLUMNS, Record
from fivebar_sim.model import HIP_HEIGHT
from fivebar_sim.render import caption, gl
from fivebar_sim.render import film as render
from fivebar_sim.render import frames as render_files
from fivebar_sim.render import scene as render_scene
from fivebar_sim.render.replay import Replay, Span, replay
from fivebar_sim.scenario import Scenario

SMALL = ("--width", "64", "--height", "64")  # the smallest that is legal
SCENES = {
    "air": {"kind": "air"},
    "payload": {"kind": "payload", "mass": 0.1},
    "rail": {"kind": "rail"},
    "treadmill": {"kind": "treadmill", "speed": 0.1},
}
PRESETS = resources.shipped("models/legs")
OTHERS = ("q8bot",)
# the stronger and the weaker channel of the links' colours
BLUE = (0, 2)
ORANGE = (2, 0)


@pytest.fixture(scope="session")
def drawing() -> None:
    """Skip, or fail if it is required, where nothing can be drawn."""
    try:
        gl.find()
    except ConfigError as error:
        if os.environ.get("FIVEBAR_GL") == "required":
            pytest.fail(str(error))
        pytest.skip(str(error))


def posed(leg: FiveBar, scene: str = "air", steps: int = 500) -> Replay:
    """Return a run that holds a leg in its rest pose: no simulation is needed to draw it.

    A ground pushes it upwards in the first half of the run.
    """
    table = {
        "name": "rest",
        "leg": leg.name,
        "scene": SCENES[scene],
        "duration": 1e-3 * steps,
        "path": {"kind": "circle", "centre": [0.0, 0.0], "radius": 0.01, "frequency": 4.0},
    }
    scenario = Scenario.from_table(table, "test", Path())
    q = kinematics.home(leg)
    foot_x, foot_z = (float(x) for x in kinematics.chain_points(leg, q).F)
    full: Array = np.ones(steps)
    record: Record = {name: float(x) * full for name, x in zip(JOINT_COLUMNS, q, strict=True)}
    for what in ("foot", "target"):
        record |= {f"{what}_x": foot_x * full, f"{what}_z": foot_z * full}
    record["time"] = np.linspace(1e-3, 1e-3 * steps, steps)
    if scene != "air":
        record |= {"hip_z": full * (leg.foot_radius - foot_z)}
        record |= {"ground_x": 0.0 * full, "ground_z": np.repeat([5.0, 0.0], steps // 2)}
    if scene == "treadmill":
        record["belt_x"] = -0.1 * record["time"]
    return replay(scenario, record)


def pixel(drawn: render.Stage, point: np.ndarray, size: tuple[int, int]) -> tuple[int, int]:
    """Return (row, column) of a point (x, z) [m], by a pinhole camera of its own."""
    camera = drawn.camera
    width, height = size
    height -= caption.strip_height(*size)
    ray = np.array([point[0], 0.0, point[1]]) - camera.eye
    right = np.array([1.0, 0.0, 0.0])
    forward = camera.forward
    scale = 0.5 * height / np.tan(np.radians(0.5 * camera.field)) / (ray @ forward)
    up = np.cross(right, forward)
    return round(0.5 * height - scale * (ray @ up)), round(0.5 * width + scale * (ray @ right))


def is_link(frame: render.Frame, channels: tuple[int, int]) -> np.ndarray:
    """Return where the colour of a side's links is."""
    weak = frame[..., channels[0]].astype(int)
    strong = frame[..., channels[1]].astype(int)
    return strong - weak > 90


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize(
    ("name", "scene"),
    # every preset in the air, one in every other scene
    [(name, scene) for name in PRESETS for scene in SCENES if scene == "air" or name in OTHERS],
)
def test_links_and_target_are_where_kinematics_has_them(name: str, scene: str) -> None:
    leg = FiveBar.load(name)
    size = (200, 150)
    shown = posed(leg, scene)
    points = kinematics.chain_points(leg, kinematics.home(leg))
    A, E = kinematics.bases(leg)
    hip = np.array([0.0, shown.hip[0]])
    with render.stage(shown, *size) as drawn:
        frame = drawn.frame(0.4)
        for start, end, channels in (
            (A, points.B, BLUE),
            (points.B, points.C_left, BLUE),
            (E, points.D, ORANGE),
            (points.D, points.C_right, ORANGE),
        ):
            at = pixel(drawn, start + 0.6 * (end - start) + hip, size)
            around = is_link(frame, channels)[at[0] - 2 : at[0] + 3, at[1] - 2 : at[1] + 3]
            assert around.any(), (name, scene, at)
        row, column = pixel(drawn, points.F + hip, size)
        near = frame[row - 2 : row + 3, column - 2 : column + 3].astype(int)
        green = near[..., 1] - np.maximum(near[..., 0], near[..., 2])
        assert green.max() > 40, (name, scene)
    frame = frame[: -caption.strip_height(*size)]
    edge = np.concatenate([frame[[0, -1]].reshape(-1, 3), frame[:, [0, -1]].reshape(-1, 3)])
    assert not (is_link(edge, BLUE) | is_link(edge, ORANGE)).any()  # nothing is cut off


@pytest.mark.usefixtures("drawing")
def test_ground_pushes_the_foot_with_an_arrow() -> None:
    leg = FiveBar.load("classic")
    size = (200, 150)
    shown = posed(leg, "rail")
    half_way = kinematics.chain_points(leg, kinematics.home(leg)).F
    half_way = half_way + np.array([0.0, shown.hip[0] + 0.3 * leg.size])
    with render.stage(shown, *size) as drawn:
        row, column = pixel(drawn, half_way, size)
        near = np.s_[row - 2 : row + 3, column - 2 : column + 3]
        stance, flight = (drawn.frame(time)[near].astype(int) for time in (0.1, 0.4))
    for frame, seen in ((stance, True), (flight, False)):  # violet: little green
        assert (np.minimum(frame[..., 0], frame[..., 2]) - frame[..., 1] > 40).any() == seen


@pytest.mark.usefixtures("drawing")
def test_pictures_share_a_context_and_nothing_else() -> None:
    """Drawn in turns, and after one of them is gone: each as it is drawn alone."""
    legs = [FiveBar.load(name) for name in ("classic", "doggo")]
    sizes = [(64, 64), (96, 80)]
    alone = []
    for leg, size in zip(legs, sizes, strict=True):
        with render.stage(posed(leg, "rail"), *size) as drawn:
            alone.append(drawn.frame(0.1))

    with render.stage(posed(legs[0], "rail"), *sizes[0]) as first:
        with render.stage(posed(legs[1], "rail"), *sizes[1]) as second:
            for _ in range(2):
                np.testing.assert_array_equal(first.frame(0.1), alone[0])
                np.testing.assert_array_equal(second.frame(0.1), alone[1])
        np.testing.assert_array_equal(first.frame(0.1), alone[0])
    assert gl.context() is gl.context()


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize(("name", "scene"), [("classic", "rail"), ("minitaur", "air")])
def test_letters_scale_and_time_are_in_a_picture(name: str, scene: str) -> None:
    """A stands left of its motor in blue, E right of its own in orange, also where both are one."""
    leg = FiveBar.load(name)
    size = (640, 480)
    shown = posed(leg, scene)
    strip = caption.strip_height(*size)
    with render.stage(shown, *size) as drawn:
        early, late = (drawn.frame(time) for time in (0.1, 0.4))
        again = drawn.frame(0.4)
        length = drawn.camera.scale(size[1] - strip) * caption.round_length(
            caption.BAR * size[0] / drawn.camera.scale(size[1] - strip)
        )
        for base, side, channels in zip(
            kinematics.bases(leg), (-1, 1), (BLUE, ORANGE), strict=True
        ):
            row, column = pixel(drawn, base + np.array([0.0, shown.hip[0]]), size)
            beside = early[row - 9 : row + 10, slice(*sorted((column, column + side * 60)))]
            paper = (beside == 255).all(axis=-1)
            assert paper.any()
            # the letter is on the paper: between its first and last column
            inside = beside[:, paper.any(axis=0)]
            assert is_link(inside, channels).any()
    np.testing.assert_array_equal(late, again)
    below = np.s_[-strip:]
    dark = early[below].max(axis=-1) < 120
    edges = [np.flatnonzero(np.diff([0, *line, 0])).reshape(-1, 2) for line in dark]
    widest = max(int(np.diff(each).max(initial=0)) for each in edges)
    assert widest == pytest.approx(length, abs=2.5)
    changed = (early[below] != late[below]).any(axis=(0, 2))
    assert 0 < np.flatnonzero(changed)[-1] < 120  # the time, and nothing beside it


def test_legend_explains_what_is_there() -> None:
    air = caption.legend(posed(FiveBar.load("classic")))
    assert [entry.colour for entry in air] == ["target", "foot"]
    grounded = caption.legend(posed(FiveBar.load("classic"), "rail"))
    assert [entry.colour for entry in grounded] == ["target", "foot", "force"]
    assert grounded[-1].label == "ground, max 5 N"
    assert air[1].label == "foot, last 0.2 s"  # 0.8 of a period of 0.25 s


@pytest.mark.parametrize(
    ("most", "length"), [(0.0199, 0.01), (0.02, 0.02), (0.049, 0.02), (0.05, 0.05), (1.3, 1.0)]
)
def test_scale_bars_are_1_2_or_5(most: float, length: float) -> None:
    assert caption.round_length(most) == pytest.approx(length)


@pytest.mark.usefixtures("drawing")
def test_marks_of_the_belt_are_back_in_place_after_a_period() -> None:
    shown = posed(FiveBar.load("classic"), "treadmill", steps=1000)  # nothing else moves
    with render.stage(shown, 200, 150) as drawn:
        # the strip below says the time, which goes on
        leg = np.s_[: -caption.strip_height(200, 150)]
        before, within, after = (drawn.frame(t)[leg].astype(int) for t in (0.6, 0.7, 0.85))
    assert np.abs(after - before).max() < 20 < np.abs(within - before).max()


def test_camera_sees_all_of_the_motion() -> None:
    shown = posed(FiveBar.load("classic"))
    for aspect in (0.3, 1.0, 3.0):
        camera = render_scene.fit(shown, aspect)
        seen = shown.points_to_fit()
        ray = np.stack([seen[:, 0], 0.0 * seen[:, 0], seen[:, 1]], axis=-1) - camera.eye
        depth = ray @ camera.forward
        tangent = np.tan(np.radians(0.5 * camera.field))
        across = np.abs(ray[:, 0]) / depth / (tangent * aspect)
        up = np.abs(ray @ np.cross([1.0, 0.0, 0.0], camera.forward)) / depth / tangent
        assert 0.6 < max(across.max(), up.max()) < 1.0


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the run directory of a short run, whose Rerun recording no picture needs."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "short.toml").write_text(ELLIPSE, encoding="utf-8")
    with unrecorded():
        return rollout.run(Scenario.load(folder / "short.toml")).write(folder / "mine")


@pytest.fixture
def recorded(shell: Shell, written: Path) -> Shell:
    """Return a shell in whose folder it is."""
    shutil.copytree(written, shell.folder / "mine")
    return shell


@pytest.mark.usefixtures("drawing")
def test_files_of_a_run(recorded: Shell) -> None:
    shell = recorded
    command = ("render", "mine", "--out", "leg.gif", "--fps", "12", *SMALL)
    said = shell(*command)
    assert said.status == 0
    assert said.out.startswith("drew 3 frames of short into leg.gif: ")  # of 0.25 s
    with Image.open("leg.gif") as film:
        assert (film.size, film.info["loop"]) == ((64, 64), 0)
        shown = []
        for k in range(getattr(film, "n_frames", 1)):
            film.seek(k)
            shown.append(film.info["duration"])
    assert (len(shown), sum(shown)) == (3, 250)
    first = Path("leg.gif").read_bytes()
    assert shell(*command).status == 0
    assert Path("leg.gif").read_bytes() == first
    assert shell("render", "mine", "--out", "at.PNG", "--at", "0.3", *SMALL).status == 0
    with Image.open("at.PNG") as picture:
        assert picture.size == (64, 64)
    assert {"leg.gif", "at.PNG"} <= shell.names()
    assert not [name for name in shell.names() if name.startswith(".")]


@pytest.mark.usefixtures("drawing")
@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="no ffmpeg here")
def test_film_shows_all_of_the_run(recorded: Shell) -> None:
    options = ("--fps", "5", "--speed", "0.5", *SMALL)
    assert recorded("render", "mine", "--out", "leg.mp4", *options).status == 0
    wanted = "stream=width,height,r_frame_rate,nb_frames"
    probe = ["ffprobe", "-v", "error", "-show_entries", wanted, "-of", "csv=p=0", "leg.mp4"]
    told = subprocess.run(probe, capture_output=True, text=True, check=True).stdout
    assert told.strip() == "64,64,5/1,6"


def test_a_gif_shows_the_last_whole_period_and_others_all_of_the_run() -> None:
    shown = posed(FiveBar.load("classic"), steps=950)  # ramp 0.25 s, period 0.25 s
    assert render.span(shown, ".gif") == pytest.approx((0.5, 0.25))
    assert render.span(shown, ".mp4") == pytest.approx((0.0, 0.95))
    times = render.moments(Span(0.5, 0.25), render.Film(fps=40.0, speed=0.5))
    assert times == pytest.approx(0.5 + 0.0125 * np.arange(20))


def test_each_moment_of_a_gif_is_drawn_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also those from whose colours the palette is made; they are shown in their turn."""
    drawn: list[float] = []

    def frame(time: float) -> render.Frame:
        drawn.append(time)
        return np.full((64, 64, 3), round(1e3 * time) % 251, np.uint8)

    stage = SimpleNamespace(frame=frame)
    monkeypatch.setattr(render, "stage", lambda *asked: nullcontext(stage))
    shown = posed(FiveBar.load("classic"), steps=950)
    film = render.Film(64, 64, fps=40.0)
    assert render.write(shown, tmp_path / "leg.gif", film) == 10
    times = render.moments(render.span(shown, ".gif"), film)
    assert sorted(drawn) == times

    frames = [frame(time) for time in times]
    lasts = render_files.durations(10, 0.25)
    render_files.write_gif(tmp_path / "alone.gif", frames, frames[::2], lasts)
    assert (tmp_path / "leg.gif").read_bytes() == (tmp_path / "alone.gif").read_bytes()


def test_rows_are_the_states_nearest_in_time() -> None:
    shown = posed(FiveBar.load("classic"), steps=500)
    assert [shown.row(t) for t in (0.0, 0.001, 0.0024, 0.25, 0.5)] == [0, 0, 1, 249, 499]
    assert shown.hip[0] == HIP_HEIGHT * shown.scenario.leg.size


def test_a_record_without_the_columns_of_its_scene_is_refused() -> None:
    shown = posed(FiveBar.load("classic"), "rail")
    with pytest.raises(RunDirectoryError, match="'rail': it lacks the column hip_z"):
        replay(shown.scenario, {})


REFUSED = [
    (("--out", "leg.jpg"), "cannot draw leg.jpg: the picture must end in .gif, .mp4, .png"),
    (("--width", "63"), "width must be in [64, 4096] pixels, got 63"),
    (("--height", "5000"), "height must be in [64, 4096] pixels, got 5000"),
    (("--out", "a.mp4", "--width", "101"), "width of a .mp4 must be even, got 101"),
    (("--fps", "0"), "fps must be in [0.1, 50] 1/s, got 0.0"),
    (("--fps", "60"), "fps must be in [0.1, 50] 1/s, got 60.0"),
    (("--speed", "nan"), "speed must be in [0.0001, 10000], got nan"),
    (("--out", "a.png", "--at", "9"), "at must be in [0, 0.6] s, got 9.0"),
    (("--at", "0.3"), "at is the time of a single .png, got short.gif"),
    (("--speed", "1e-4"), "a .gif of 640 x 480 may have up to 813 frames, got 75000"),
    (("--out", "no/leg.gif"), "cannot write no/leg.gif: No such file or directory"),
    (("--out", "mine.gif"), "cannot write mine.gif: a directory is there"),
]


def test_what_cannot_be_drawn_is_one_line(recorded: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    shell = recorded
    Path("mine.gif").mkdir()
    monkeypatch.setattr(gl, "find", lambda: "egl")  # refused before anything is drawn
    for arguments, line in REFUSED:
        assert shell.refused("render", "mine", *arguments).startswith(line)
    assert shell.refused("render", "no") == "no is not a run directory: no such directory"
    Path("mine/rollout.parquet").write_bytes(b"no")
    assert "mine/rollout.parquet is not a record" in shell.refused("render", "mine")
