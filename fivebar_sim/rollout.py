"""Runs scenarios: plans, simulates, measures and judges them, all legs of one call at once."""

from __future__ import annotations

import importlib
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple, cast, overload

import numpy as np

from fivebar_sim import units
from fivebar_sim.errors import ArgumentError, DivergedError
from fivebar_sim.metrics import tracking
from fivebar_sim.metrics.columns import Record
from fivebar_sim.metrics.limits import Limit, judge
from fivebar_sim.metrics.measured import Judged, Verdict, with_verdict
from fivebar_sim.robots import measured as robots
from fivebar_sim.robots.scenario import RobotScenario
from fivebar_sim.runs import coarse
from fivebar_sim.scenario import Scenario
from fivebar_sim.simulation import feedback, measure
from fivebar_sim.simulation.plan import Plan, period_steps
from fivebar_sim.simulation.plan import plan as plan_leg
from fivebar_sim.simulation.provenance import provenance
from fivebar_sim.simulation.recorder import Recorder
from fivebar_sim.simulation.steps import States, Watch, simulated
from fivebar_sim.walking.measure import measure as measure_robot
from fivebar_sim.walking.plan import RobotPlan, plan_scenario
from fivebar_sim.walking.walk import walk

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fivebar_sim.runs.stored import StoredRun

AnyPlan = Plan | RobotPlan
"""A checked scenario of a leg or of a robot."""


class Result(NamedTuple):
    """The result of a run.

    Attributes:
        scenario: The scenario that was run.
        record: The columns of rollout.parquet, each (N,), SI.
        measured: All of metrics.json, with types.
        limits: Every limit with its value.
    """

    scenario: Scenario
    record: Record
    measured: Judged
    limits: list[Limit]

    def __repr__(self) -> str:
        """Return name and verdict: the record would fill pages."""
        return f"Result({self.scenario.name!r}: {self.verdict}, {self.scenario.steps} steps)"

    @classmethod
    def read(cls, path: str | Path) -> Result:
        """Return the result that a run directory holds.

        Raises:
            RunDirectoryError: It is incomplete, or a file of it is damaged or foreign; names the
                file.
        """
        # Reading a run needs pyarrow, running one does not.
        from fivebar_sim.runs import stored

        found = stored.read(Path(path))
        # Judged again: the scenario decides what counts, not a list that was written once.
        limits = judge(found.metrics, found.scenario.limits)
        return cls(found.scenario, found.record, found.measured, limits)

    @property
    def metrics(self) -> dict[str, Any]:
        """All of metrics.json as nested dictionaries; the same object every time."""
        return self.measured.table

    @property
    def verdict(self) -> Verdict:
        """Either "pass", "fail", or "not judged" where guards hold but no limits are set."""
        return self.measured.verdict

    @property
    def remarks(self) -> list[str]:
        """Warnings for people, which change no verdict.

        The foot does not follow its path, or numbers owe something to the timestep: for that the
        scenario is run again in shorter steps, each time that this is read. It takes two or three
        times as long as the run itself, seldom ten times.
        """
        if isinstance(self.scenario, RobotScenario):
            return []
        astray = tracking.astray(self.scenario.leg, self.record, self.scenario.window)
        owed = coarse.warnings(self, run)
        return owed if astray is None else [astray, *owed]

    def write(self, path: str | Path) -> Path:
        """Write the run directory; see `run_directory.write`."""
        from fivebar_sim.runs import directory

        return directory.write(self, Path(path))

    def plot(self, name: str = "foot-path") -> Figure:
        """Return a Matplotlib figure of the run, one of its report's.

        Args:
            name: angles, error, error-parts, foot-path, gap, ground, leg, load-share, power,
                speeds, torque or torque-speed.

        Raises:
            ArgumentError: Another name, a robot's run, or nothing to draw.
        """
        from fivebar_sim.report import notebook

        return notebook.plot(self._stored, name)

    def to_pandas(self) -> Any:
        """Return the record as a pandas DataFrame, SI; pandas must be installed."""
        return _library("pandas").DataFrame(self.record)

    def to_polars(self) -> Any:
        """Return the record as a polars DataFrame, SI; polars must be installed."""
        return _library("polars").DataFrame(dict(self.record))

    def report(self, path: str | Path) -> Path:
        """Write the HTML page that explains the run, and return its place.

        Raises:
            RunDirectoryError: The place does not end in .html, or cannot be written.
        """
        from fivebar_sim.report.write import write

        with self._kept() as place:
            return write([place], Path(path))[-1]

    def replay(self) -> None:
        """Show the run in Rerun's viewer until its window is closed.

        In a notebook it is shown below the cell, where `pip install "rerun-sdk[notebook]"` was.

        Raises:
            ConfigError: There is no screen.
        """
        from fivebar_sim.recording import viewer
        from fivebar_sim.render import screen
        from fivebar_sim.runs import inline, recording_file

        if inline.fits():
            inline.show(self)
            return
        screen.check("`fivebar replay RUN_DIR --web` shows a run in a browser")
        with self._kept() as place, recording_file.opened((place,)) as file:
            command = viewer.native_command(file)
            subprocess.run(command, env=viewer.quiet_environment())

    def _repr_html_(self) -> str:
        """Return what a notebook shows: verdict, metrics, and the leg over its path."""
        from fivebar_sim.report import notebook

        return notebook.fragment(self._stored)

    @property
    def _stored(self) -> StoredRun:
        """The run as reports take it."""
        from fivebar_sim.runs.stored import StoredRun

        return StoredRun(Path(self.scenario.name), self.scenario, self.record, self.measured)

    @contextmanager
    def _kept(self) -> Iterator[Path]:
        """Have the run directory in a temporary folder within."""
        with TemporaryDirectory(prefix="fivebar-") as folder:
            yield self.write(Path(folder) / self.scenario.name)


def _library(name: str) -> Any:
    """Return a library that fivebar-sim does not bring."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"to_{name} needs {name} ({error}): pip install {name}", name=error.name
        ) from error


class Kind(NamedTuple):
    """What plans must have in common to be simulated together.

    Attributes:
        timestep: h [s].
        steps: Timesteps of the run.
        scene: The scene's kind.
        extended: Whether the leg has an extension: its model then has one geom more.
        period: Timesteps of the control period; None where all commands are known before.
    """

    timestep: float
    steps: int
    scene: str
    extended: bool
    period: int | None

    @classmethod
    def of(cls, planned: Plan) -> Kind:
        """Return the kind of a plan."""
        scenario = planned.scenario
        return cls(
            timestep=planned.motion.timestep,
            steps=scenario.steps,
            scene=scenario.scene.kind,
            extended=scenario.leg.L6 > 0.0,
            period=period_steps(planned) if planned.setpoints is None else None,
        )


# A robot's scenario is one of a kind of its own: who has it as a mere Scenario is told of a leg's
# plan, which nearly everybody has.
@overload
def plan(scenario: RobotScenario) -> RobotPlan: ...  # pyright: ignore[reportOverlappingOverload]
@overload
def plan(scenario: Scenario) -> Plan: ...
def plan(scenario: Scenario) -> AnyPlan:
    """Return the plan of a scenario, without simulating anything.

    Raises:
        FiveBarError: What `simulation.plan.plan` and `walking.plan.plan` raise.
    """
    if isinstance(scenario, RobotScenario):
        return plan_scenario(scenario)
    return plan_leg(scenario)


def run(scenario: Scenario) -> Result:
    """Return the result of one scenario.

    Raises:
        UnreachableError: The path leaves what the leg can reach.
        DivergedError: The simulation broke down; says when.
    """
    return execute(plan(scenario))


def execute(planned: AnyPlan, watch: Watch | None = None) -> Result:
    """Return the result of one plan; see `run`.

    Args:
        planned: The plan.
        watch: Called with the states as they come.
    """
    if isinstance(planned, RobotPlan):
        return _walked(planned, watch)
    return _result(planned, _recorded([planned], 1, watch)[0])


def run_all(plans: Sequence[AnyPlan], nthread: int = 1, device: str | None = None) -> list[Result]:
    """Return the results of plans, those of one timestep and length simulated together.

    The bits are the same as one by one. On a device MuJoCo Warp takes the steps, in single
    precision; record, metrics and verdict are then made of its states as of any others.

    Args:
        plans: The plans.
        nthread: Number of threads; 0 is one for every processor.
        device: None for MuJoCo on the processor, "cuda:0" for a card, "cpu-warp" for Warp on the
            processor.

    Raises:
        ArgumentError: A device of another name.
        ConfigError: The device is not there, cannot run a plan, or has too little memory.
        ExtraError: MuJoCo Warp is not installed.
        DivergedError: A simulation broke down; says which, and when.
    """
    if device is not None:
        return _run_on(device, plans)

    # Groups mix the order of the plans; results go back to it at the end.
    results: dict[int, Result] = {}
    groups: dict[Kind, dict[int, Plan]] = {}
    for i, planned in enumerate(plans):
        # A robot fills a processor by itself.
        if isinstance(planned, RobotPlan):
            results[i] = _walked(planned)
        else:
            groups.setdefault(Kind.of(planned), {})[i] = planned

    for members in groups.values():
        recorders = _recorded([*members.values()], nthread)
        for i, planned in members.items():
            # Each is freed once it is measured.
            results[i] = _result(planned, recorders.pop(0))
    return [results[i] for i in range(len(plans))]


def _run_on(device: str, plans: Sequence[AnyPlan]) -> list[Result]:
    """Return the results of plans that are simulated on a device; see `run_all`."""
    # Warp is an extra, and slow to import.
    from fivebar_sim.warp.batch import simulated_on

    recorders = [Recorder(planned) for planned in plans if isinstance(planned, Plan)]
    for rows, states in simulated_on(device, plans):
        for row, i in enumerate(rows):
            recorders[i].add(states.rows(slice(row, row + 1)))
    pairs = zip(plans, recorders, strict=True)
    return [_result(cast(Plan, planned), _unbroken(each)) for planned, each in pairs]


def _walked(planned: RobotPlan, watch: Watch | None = None) -> Result:
    """Return what a robot did, measured and judged."""
    went = walk(planned, watch)
    scenario = planned.scenario
    measured = measure_robot(went)
    limits = judge(measured.table, scenario.limits)
    judged = robots.with_verdict(measured, limits, provenance(scenario))
    return Result(scenario, went.record, judged, limits)


def _recorded(plans: Sequence[Plan], nthread: int, watch: Watch | None = None) -> list[Recorder]:
    """Return the records of plans that may be simulated together.

    Raises:
        DivergedError: A simulation broke down; says which, and when.
    """
    recorders = [Recorder(planned) for planned in plans]
    try:
        for states in _simulated(plans, nthread, watch):
            for row, recorder in enumerate(recorders):
                recorder.add(states.rows(slice(row, row + 1)))
    except feedback.NoAnswerError as stopped:
        raise recorders[stopped.row].broken(stopped) from stopped.__cause__

    return [_unbroken(recorder) for recorder in recorders]


def _unbroken(recorder: Recorder) -> Recorder:
    """Return a recorder whose simulation did not break down."""
    if recorder.error is not None:
        raise recorder.broken(recorder.error)
    return recorder


def _simulated(plans: Sequence[Plan], nthread: int, watch: Watch | None = None) -> Iterator[States]:
    """Yield the states of plans that may be simulated together, some steps after the other."""
    # Only a controller that waits for observations needs Python between the steps.
    if plans[0].setpoints is None:
        return feedback.steer(plans, nthread, watch)
    return simulated(
        [p.model for p in plans],
        np.stack([p.start for p in plans]),
        plans[0].scenario.steps,
        lambda rows: np.stack([p.commands(rows) for p in plans]),
        nthread,
        watch,
    )


def _result(planned: Plan, recorder: Recorder) -> Result:
    scenario = planned.scenario
    try:
        _check_resolution(scenario)
    except DivergedError as error:
        raise recorder.broken(error) from None

    record = recorder.record
    # A foot that is gone leaves finite numbers behind, and metrics of nothing.
    lost = tracking.lost_path(scenario.leg, record)
    if lost is not None:
        far = f"it was {units.text(1e3 * scenario.leg.size, 'mm')} away from it at t = {lost:g} s"
        raise recorder.broken(DivergedError(far, lost))

    try:
        measured = measure.measure(scenario, record, recorder.unrecorded)
    except ArgumentError as error:
        # Torques that no motor could have.
        raise recorder.broken(DivergedError(str(error), scenario.sim.timestep)) from error

    limits = judge(measured.table, scenario.limits)
    judged = with_verdict(measured, limits, provenance(scenario))
    return Result(scenario, record, judged, limits)


def _check_resolution(scenario: Scenario) -> None:
    """Raise if a run has too few steps a period to tell how the foot followed."""
    h = scenario.sim.timestep
    period = scenario.path.period
    if period is not None and not h < period / 4:
        raise DivergedError(
            f"the simulation cannot follow the path: the timestep must be below a quarter of its "
            f"period of {period:g} s, got {h:g} s",
            h,
        )
