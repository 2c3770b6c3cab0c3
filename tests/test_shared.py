"""What processes of the tests share: made by one of them, and never read half written."""

from __future__ import annotations

from pathlib import Path

import pytest
import shared

TAKEN = {"x": [1.0, None]}


def test_it_is_made_once_and_by_whoever_shares_nothing_every_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def make() -> dict[str, list[float | None]]:
        made.append(1)
        return TAKEN

    monkeypatch.setattr(shared, "folders", [tmp_path])
    assert [shared.once("x", make), shared.once("x", make)] == [TAKEN, TAKEN]
    assert len(made) == 1

    monkeypatch.setattr(shared, "folders", [])
    assert [shared.once("x", make), shared.once("x", make)] == [TAKEN, TAKEN]
    assert len(made) == 3


def test_what_failed_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared, "folders", [tmp_path])

    def fails() -> None:
        raise RuntimeError

    with pytest.raises(RuntimeError):
        shared.once("x", fails)
    (tmp_path / "x.partial").write_bytes(b"\x80half")
    assert shared.once("x", lambda: TAKEN) == TAKEN
