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

WHOLE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
CTRL = int(mujoco.mjtState.mjSTATE_CTRL)


def _of_states(kind: mujoco.mjtState) -> property:
    """Return a property of the states' numbers of one kind, a row a leg."""

    def read(batch: Plain) -> np.ndarray:
        return batch.part(int(kind))

    def fill(batch: Plain, values: np.ndarray) -> None:
        batch.part(int(kind))[:] = values

    return property(read, fill)


class Plain:
    """As much of `mujoco.batch.Batch` as the package uses, one MjData a leg, one after another."""

    qpos = _of_states(mujoco.mjtState.mjSTATE_QPOS)
    qvel = _of_states(mujoco.mjtState.mjSTATE_QVEL)
    qacc_warmstart = _of_states(mujoco.mjtState.mjSTATE_WARMSTART)

    def __init__(self, model: Any, nsim: int, nthread: int = 0) -> None:
        del nthread
        self.nsim = nsim
        self.set_models([model] * nsim)

    def set_models(self, models: Sequence[Any]) -> None:
        """Give each leg its own model, and begin anew."""
        self._models = list(models)
        self._expanded: dict[str, np.ndarray] = {}
        self.model = self._models[0]
        self.state = np.zeros((self.nsim, mujoco.mj_stateSize(self.model, WHOLE)))
        self._outputs: dict[str, np.ndarray] = {}
        self._datas = [mujoco.MjData(model) for model in self._models]
        for i, data in enumerate(self._datas):
            mujoco.mj_getState(self._models[i], data, self.state[i], WHOLE)

        self.warning = np.zeros((self.nsim, len(self._datas[0].warning.number), 2), np.int32)

    @property
    def time(self) -> np.ndarray:
        """Time of each leg, (n,)."""
        return self.part(int(mujoco.mjtState.mjSTATE_TIME))[:, 0]

    def bind(self, name: str) -> np.ndarray:
        """Return the commands of all legs, or what every step leaves of another field."""
        if name == "ctrl":
            return self.part(CTRL)

        rows = [getattr(data, name) for data in self._datas]
        return self._outputs.setdefault(name, np.array(rows))

    def expand(self, name: str) -> np.ndarray:
        """Return a field of the model, a row a leg: what a row holds is its leg's in every step."""
        owner, field = _owner(self.model, name)
        rows = np.array([getattr(owner, field)] * self.nsim)
        return self._expanded.setdefault(name, rows)

    def step(self) -> None:
        """Take one step with the commands that `bind` gave to be filled."""
        for i, model in enumerate(self._models):
            data = self._load(i)
            data.ctrl[:] = self.bind("ctrl")[i]
            mujoco.mj_step(model, data)
            self._save(i)
            for name, rows in self._outputs.items():
                rows[i] = getattr(data, name)

    def forward(self, ids: np.ndarray, stage: int) -> None:
        """Compute what follows from the states of some; all stages, for later ones harm none."""
        del stage
        for i in ids.tolist():
            data = self._load(i)
            mujoco.mj_forward(self._models[i], data)
            for name, rows in self._outputs.items():
                rows[i] = getattr(data, name)

    def rollout(
        self,
        steps: int,
        control: np.ndarray,
        control_spec: int = CTRL,
        record: Sequence[Any] = (),
        ids: Any = None,
        out: dict[Any, np.ndarray] | None = None,
    ) -> dict[Any, Any]:
        """Return what is recorded after each of the next steps, (n, steps, ...), or fill `out`."""
        rows: dict[Any, list] = {item: [] for item in record}
        for i, given in zip(range(self.nsim) if ids is None else ids, control, strict=True):
            data = self._load(i)
            stepped = _stepped(self._models[i], data, given, control_spec, record)
            self._save(i)
            for item, recorded in zip(record, stepped, strict=True):
                rows[item].append(recorded)
        found = {item: np.stack(each) for item, each in rows.items()}
        if out is None:
            return found
        for item, each in found.items():
            out[item][:] = each
        return out

    def part(self, kind: int) -> np.ndarray:
        """Return one kind of numbers of all legs' states, in place."""
        first = mujoco.mj_stateSize(self.model, kind - 1)  # of all that comes before
        return self.state[:, first : first + mujoco.mj_stateSize(self.model, kind)]

    def _load(self, i: int) -> Any:
        for name, rows in self._expanded.items():
            owner, field = _owner(self._models[i], name)
            setattr(owner, field, rows[i])

        data = self._datas[i]
        mujoco.mj_setState(self._models[i], data, self.state[i], WHOLE)
        data.warning.lastinfo[:] = self.warning[i, :, 0]
        data.warning.number[:] = self.warning[i, :, 1]
        return data

    def _save(self, i: int) -> None:
        data = self._datas[i]
        mujoco.mj_getState(self._models[i], data, self.state[i], WHOLE)
        self.warning[i, :, 0] = data.warning.lastinfo
        self.warning[i, :, 1] = data.warning.number


def _fields() -> frozenset[str]:
    """Return the names of a model's arrays and of its options, these with "opt." in front."""
    empty = mujoco.MjModel.from_xml_string("<mujoco/>")
    arrays = {name for name in dir(empty) if isinstance(getattr(empty, name), np.ndarray)}
    options = {f"opt.{name}" for name in dir(empty.opt) if not name.startswith("_")}
    return frozenset(arrays | options)


def _owner(model: Any, name: str) -> tuple[Any, str]:
    """Return what has a field of a model, which for "opt.x" are its options, and its name there."""
    option = name.removeprefix("opt.")
    return (model if option == name else model.opt), option


def _stepped(
    model: Any, data: Any, given: np.ndarray, spec: int, record: Sequence[Any]
) -> list[Any]:
    """Return what is recorded of one leg; at a new warning of MuJoCo it stops, and rows repeat."""
    rows = [[] for _ in record]
    warned = data.warning.number.copy()
    for each in given:
        if (data.warning.number == warned).all():
            mujoco.mj_setState(model, data, each, spec)
            mujoco.mj_step(model, data)
        for item, row in zip(record, rows, strict=True):
            row.append(_read(model, data, item))
    return [np.array(row) for row in rows]


def _read(model: Any, data: Any, item: Any) -> np.ndarray:
    if isinstance(item, str):
        return np.array(getattr(data, item))
    state = np.empty(mujoco.mj_stateSize(model, int(item)))
    mujoco.mj_getState(model, data, state, int(item))
    return state


def stand_in() -> ModuleType:
    """Return what takes the place of `mujoco.batch`."""
    module = ModuleType("mujoco.batch")
    module.Batch = Plain  # type: ignore[attr-defined]
    module.MODEL_FIELDS = _fields()  # type: ignore[attr-defined]
    return module


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
        sys.modules["mujoco.batch"] = stand_in()
    json.dump(measure(), sys.stdout)
