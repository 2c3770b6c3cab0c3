"""Frames as files: how long a GIF shows each, and a film without ffmpeg or with one that fails."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fivebar_sim.errors import ConfigError
from fivebar_sim.render import frames as render_files


def test_times_of_a_gif_do_not_add_up_their_rounding() -> None:
    shown = render_files.durations(7, 0.2273)
    assert sum(shown) == 230
    assert np.abs(np.cumsum(shown) - 227.3 / 7 * np.arange(1, 8)).max() <= 5.0
    assert set(render_files.durations(300, 10.0)) == {30, 40}


@pytest.mark.parametrize(
    ("program", "line"),
    [
        (None, "a .mp4 needs the program ffmpeg (Debian package ffmpeg); a .gif does not"),
        ("#!/bin/sh\necho first >&2; echo 'disk full' >&2; exit 1\n", "ffmpeg failed: disk full"),
        ("#!/bin/sh\ncat >/dev/null; exit 3\n", "ffmpeg failed: exit status 3"),
    ],
)
def test_no_ffmpeg_or_one_that_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str | None, line: str
) -> None:
    if program is not None:
        (tmp_path / "ffmpeg").write_text(program)
        (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin" if program else str(tmp_path))
    frames = (np.zeros((96, 128, 3), np.uint8) for _ in range(100))
    with pytest.raises(ConfigError) as error:
        render_files.write_mp4(tmp_path / "leg.mp4", frames, 30.0)
    assert str(error.value) == line
