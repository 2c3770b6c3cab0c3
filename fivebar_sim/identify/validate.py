"""Whether numbers that were identified carry over to a log that was not fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fivebar_sim.identify.fit import Fit
from fivebar_sim.identify.measured import Measured
from fivebar_sim.identify.parameters import put
from fivebar_sim.identify.predict import predict
from fivebar_sim.scenario import Scenario


def explained(
    scenario: Scenario, fit: Fit, logs: Sequence[Measured], nthread: int = 0
) -> list[tuple[float, float]]:
    """Return the RMS of the angles' residuals in each log, before and after the fit [rad].

    Args:
        scenario: The scenario that the fit started from.
        fit: What was identified.
        logs: Logs that were not fitted.
        nthread: Threads.
    """
    if not logs:
        return []

    start = np.array([each.start for each in fit.parameters])
    cases = [put(scenario, fit.parameters, values) for values in (start, fit.values)]
    before, after = (
        [
            float(np.sqrt(np.mean((log.theta - each.theta)[log.used] ** 2)))
            for log, each in zip(logs, predicted, strict=True)
        ]
        for predicted in predict(cases, logs, nthread)
    )
    return list(zip(before, after, strict=True))
