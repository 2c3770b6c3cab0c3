"""One leg as a dm_control environment: install the extra `control`.

The physics are MuJoCo's own steps of the same model, one command a step; `dm_control.viewer` opens
an environment. Importing this module has no side effects: `load` imports dm_control.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fivebar_sim import tasks
from fivebar_sim.geometry import FiveBar
from fivebar_sim.render import gl
from fivebar_sim.tasks import Randomise, Task
from fivebar_sim.tasks import options as checks
from fivebar_sim.tasks.episodes import Episodes
from fivebar_sim.tasks.legs import prepare

if TYPE_CHECKING:
    from dm_control.rl import control


def load(
    task: str | Task | Mapping[str, Any],
    leg: FiveBar | str | Path | Mapping[str, Any] | None = None,
    *,
    seed: int | None = None,
    randomise: Randomise | Mapping[str, Any] | None = None,
    model_seed: int = 0,
    flat_observation: bool = False,
    **options: Any,
) -> control.Environment:
    """Return a leg with a task as a `dm_env.Environment`.

    `environment.task` has the reward's `terms` by name, the `reason` why an episode ended, and
    `random`, from which starts and sensor noise are drawn.

    Args:
        task: "track", "stand", "hop", "gait", or a Task.
        leg: A leg, a preset's name, a TOML file, or a table; None: the task's own leg.
        seed: Seed of all episodes; None: a different one each time.
        randomise: Ranges of the leg's random parameters, or a table of them; None: no
            randomisation.
        model_seed: Seed of the random parameters.
        flat_observation: Whether the observation's parts are joined in one array.
        options: The task's other keywords: servo, action, period ...; servo, path and sensors
            also as tables with the keys of scenarios.

    Raises:
        ArgumentError: Unknown task or option, a value of the wrong type, or a seed that is not a
            whole number >= 0.
        UnreachableError: The leg cannot follow the path.
        ModuleNotFoundError: dm-control is not installed.
    """
    dm_leg = _dm_leg()
    if seed is not None:
        seed = checks.check_whole("seed", seed, 0)
    drawn_from = checks.check_whole("model_seed", model_seed, 0)
    checks.check_bool("flat_observation", flat_observation)

    named = options if leg is None else {"leg": leg, **options}
    wanted = tasks.task(task, **named).resolved()
    drawn, models, starts = prepare(wanted, [drawn_from], tasks.ranges(randomise))
    return dm_leg.environment(
        models[0],
        Episodes(wanted, drawn, starts),
        np.random.default_rng(seed),
        flat_observation=flat_observation,
    )


def _dm_leg() -> ModuleType:
    """Return the module that needs dm_control."""
    # First, since dm_control loads OpenGL when it is imported.
    gl.set_mujoco_gl()
    try:
        from fivebar_sim.tasks import dm_leg
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"fivebar_sim.environment needs dm-control ({error}): "
            "pip install 'fivebar-sim[control]' on Python 3.11 or 3.12; newer ones have no wheel",
            name=error.name,
        ) from error
    return dm_leg
