"""What all shipped scenarios come to, as JSON; scripts/determinism.py runs it in each environment.

With --plain every leg is stepped by mj_step; so it needs no `mujoco.batch`, which MuJoCo has from
3.17 on.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import mujoco
import numpy as np


class Plain:
    """As much of `mujoco.batch.Batch` as the package uses, one MjData a leg, one after another."""

    def __init__(self, model: Any, nsim: int, nthread: int = 0) -> None:
        del nthread
        self.nsim = nsim
        self.set_models([model] * nsim)

    def set_models(self, models: Sequence[Any]) -> None:
        """Give each leg its own model, and begin anew."""
        self._models = list(models)
        self._datas = [mujoco.MjData(model) for model in self._models]

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "qpos":
            return object.__setattr__(self, name, value)
        for data, row in zip(self._datas, value, strict=True):
            data.qpos[:] = row
        return None

    @property
    def warning(self) -> np.ndarray:
        """(last info, count) of every kind of warning, (nsim, n, 2)."""
        return np.array([[d.warning.lastinfo, d.warning.number] for d in self._datas]).swapaxes(
            1, 2
        )

    def rollout(self, steps: int, ctrl: np.ndarray, record: Sequence[Any]) -> dict[Any, Any]:
        """Return what is recorded after each of the next steps, (nsim, steps, ...)."""
        rows: dict[Any, list] = {item: [] for item in record}
        for model, data, commands in zip(self._models, self._datas, ctrl, strict=True):
            for item, recorded in zip(record, _stepped(model, data, commands, record), strict=True):
                rows[item].append(recorded)
        return {item: np.stack(each) for item, each in rows.items()}


def _stepped(model: Any, data: Any, commands: np.ndarray, record: Sequence[Any]) -> list[Any]:
    """Return what is recorded of one leg; at MuJoCo's first warning it stops, and rows repeat."""
    rows = [[] for _ in record]
    for command in commands:
        if not data.warning.number.any():
            data.ctrl[:] = command
            mujoco.mj_step(model, data)
        for item, each in zip(record, rows, strict=True):
            each.append(_read(model, data, item))
    return [np.array(each) for each in rows]


def _read(model: Any, data: Any, item: Any) -> np.ndarray:
    if isinstance(item, str):
        return np.array(getattr(data, item))
    state = np.empty(mujoco.mj_stateSize(model, int(item)))
    mujoco.mj_getState(model, data, state, int(item))
    return state


def measure() -> dict[str, Any]:
    """Return the metrics of all shipped scenarios with their tolerances, and their bits."""
    from fivebar_sim import rollout
    from fivebar_sim.files import resources
    from fivebar_sim.metrics import look_up
    from fivebar_sim.regression import baseline
    from fivebar_sim.scenario import Scenario

    plans = [rollout.plan(Scenario.load(name)) for name in resources.shipped("scenarios")]
    runs = {}
    for result in rollout.run_all(plans, nthread=0):
        name = result.scenario.name
        digest = hashlib.sha256()
        for key in sorted(result.record):
            digest.update(result.record[key].tobytes())
        recorded = baseline.read(baseline.place(name)) or baseline.record(result.metrics)
        metrics = {
            key: (look_up(result.metrics, key), each.tolerance)
            for key, each in recorded.metrics.items()
        }
        runs[name] = {"metrics": metrics, "bits": digest.hexdigest()}

    return runs


if __name__ == "__main__":
    if "--plain" in sys.argv[1:]:
        stand_in = ModuleType("mujoco.batch")
        stand_in.Batch = Plain  # type: ignore[attr-defined]
        sys.modules["mujoco.batch"] = stand_in
    json.dump(measure(), sys.stdout)
