"""./.venv/bin/python scripts/train_hop.py [--generations 40] [--seed 0]: learns to hop in minutes.

64 legs of the vector environment try a policy each, and CMA-ES makes the next 64 of what came of
them. With --ray HOST:PORT they do so on a Ray cluster, with the same numbers. Prints the
generations and what the trained policy does beside random setpoints and beside the hop path of the
scenario rail-hop, the tables of docs/environments.md; draws docs/hop-training.svg.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from fivebar_controllers.servo import Servo as PathServo

from fivebar_sim import motion
from fivebar_sim.arrays import Array
from fivebar_sim.control.servo import Servo
from fivebar_sim.errors import FiveBarError
from fivebar_sim.scenario import Scenario
from fivebar_sim.tasks import Hop
from fivebar_sim.tasks.base import clock_hand
from fivebar_sim.vector import LegVectorEnv
from fivebar_sim.workers.cluster import RayCluster
from fivebar_sim.workers.here import Here, Workers

OUT = Path(__file__).resolve().parent.parent / "docs" / "hop-training.svg"
LEGS = 64
BLOCK = 8  # legs that a processor of a cluster plays
THREADS = 2
HARMONICS = 4
WEIGHTS = 2 * (2 * HARMONICS + 1)
SIGMA = 0.15  # [rad], the first policies' deviation
EXCESS = 1.0  # what a square radian beyond the bounds costs, per control step
# [s], episodes
TRAINED = 2.0
SHOWN = 4.0
PATH = "hop path"
FINE = 0.001  # [s], control period of what is measured
RAIL = Scenario.load("rail-hop", ["scene.drop=0"])  # an episode begins on the floor
SERVO = msgspec.structs.replace(RAIL.servo, limit=1.0)  # [N m]

Act = Callable[[int, Array], Array]
"""(control step, observations (n, size)) -> actions (n, 2) [rad]."""


class Cma:
    """CMA-ES, maximising: draws x ~ m + sigma N(0, C), and moves m, sigma, C by the better half.

    N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772 (2016): its steps and its
    default constants, with weights of zero for the worse half.

    x has `size` numbers, a generation `population` points; sigma is the first.
    """

    def __init__(self, size: int, population: int, sigma: float, random: np.random.Generator):
        self.mean = np.zeros(size)
        self.sigma = sigma
        self._population = population
        self._random = random
        self._age = 0
        rank = np.arange(1, population // 2 + 1)
        self._w = np.log((population + 1) / 2) - np.log(rank)
        self._w /= self._w.sum()
        self._C = np.eye(size)
        self._p_c = np.zeros(size)
        self._p_s = np.zeros(size)
        self._mu = mu = 1.0 / float((self._w**2).sum())
        self._c_c = (4.0 + mu / size) / (size + 4.0 + 2.0 * mu / size)
        self._c_s = (mu + 2.0) / (size + mu + 5.0)
        self._c_1 = 2.0 / ((size + 1.3) ** 2 + mu)
        self._c_mu = min(1.0 - self._c_1, 2.0 * (mu - 2.0 + 1.0 / mu) / ((size + 2.0) ** 2 + mu))
        self._d = 1.0 + 2.0 * max(0.0, np.sqrt((mu - 1.0) / (size + 1.0)) - 1.0) + self._c_s
        self._chi = np.sqrt(size) * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size**2))

    def ask(self) -> Array:
        """Return the points of a generation, (population, N)."""
        values, self._B = np.linalg.eigh(self._C)
        self._D = np.sqrt(values)
        # The symmetric root: an eigenvector's sign, and at first all of it, is LAPACK's to choose,
        # and would make of one seed other points on another processor.
        root = (self._B * self._D) @ self._B.T
        shape = (self._population, len(self.mean))
        self._y = self._random.standard_normal(shape) @ root
        return self.mean + self.sigma * self._y

    def tell(self, fitness: Array) -> None:
        """Take note of how good the points were that `ask` returned, (population,)."""
        y = self._y[np.argsort(-fitness)[: len(self._w)]]
        step = self._w @ y
        self.mean = self.mean + self.sigma * step
        self._age += 1
        whitened = self._B @ ((self._B.T @ step) / self._D)  # C^(-1/2) step
        c = self._c_s
        self._p_s = (1.0 - c) * self._p_s + np.sqrt(c * (2.0 - c) * self._mu) * whitened
        length = float(np.linalg.norm(self._p_s)) / self._chi
        far = np.sqrt(1.0 - (1.0 - c) ** (2 * self._age)) * (1.4 + 2.0 / (len(step) + 1.0))
        h = float(length < far)
        c_1 = self._c_1
        c = self._c_c
        self._p_c = (1.0 - c) * self._p_c + h * np.sqrt(c * (2.0 - c) * self._mu) * step
        kept = 1.0 - c_1 - self._c_mu + (1.0 - h) * c_1 * c * (2.0 - c)
        spread = np.einsum("i,ij,ik->jk", self._w, y, y)
        self._C = kept * self._C + c_1 * np.outer(self._p_c, self._p_c) + self._c_mu * spread
        self.sigma *= float(np.exp(self._c_s / self._d * (length - 1.0)))


def wished(legs: LegVectorEnv, weights: Array, phase: Array) -> Array:
    """Return the policies' setpoints before they are kept within the bounds [rad], (n, ..., 2).

        theta_A, theta_E = middle + a_0 + sum over k of a_k cos(k phi) + b_k sin(k phi)

    Weights (n, WEIGHTS) are a_0, a_1.., b_1.. of A and E by turns, phase is (cos phi, sin phi).
    """
    middle = 0.5 * (legs.episodes.low + legs.episodes.high)
    turns = (phase @ np.array([1.0, 1.0j]))[..., None] ** np.arange(HARMONICS + 1)
    waves = np.concatenate([turns.real, turns.imag[..., 1:]], axis=-1)
    return middle + np.einsum("n...f,nfk->n...k", waves, weights.reshape(len(weights), -1, 2))


def policies(legs: LegVectorEnv, weights: Array) -> Act:
    """Return policies, one a leg."""
    low = legs.episodes.low
    high = legs.episodes.high
    phase = legs.layout["phase"]
    return lambda _, seen: np.clip(wished(legs, weights, seen[:, phase]), low, high)


def held(act: Act) -> Act:
    """Return a policy of the task's control period for control steps of `FINE`."""
    kept = np.zeros(0)

    def hold(step: int, seen: Array) -> Array:
        nonlocal kept
        if step % round(Hop().period / FINE) == 0:
            kept = act(step, seen)
        return kept

    return hold


def excess(legs: LegVectorEnv, weights: Array) -> Array:
    """Return the mean square of what a cycle's setpoints are beyond the bounds [rad^2], (n,).

    Without it larger weights would be all the same: setpoints that jump from bound to bound.
    """
    phase = clock_hand(np.arange(100) / 100.0)
    wish = wished(legs, weights, np.tile(phase, (len(weights), 1, 1)))
    beyond = wish - np.clip(wish, legs.episodes.low, legs.episodes.high)
    return (beyond**2).sum(axis=-1).mean(axis=-1)


class Played(NamedTuple):
    """What legs did in an episode, until its end, (n,) each.

    Attributes:
        reward: Mean over the control steps of the whole episode, none after an early end.
        foot: Greatest height of the foot above the floor [m].
        hip: Greatest height of the hip above the floor [m].
        flight: Longest time without contact at the control steps [s].
        torque: RMS of both motors' torque [N m].
        early: Whether the episode ended before its time.
        hip_z: Height of the hip after each control step [m], (steps, n).
    """

    reward: Array
    foot: Array
    hip: Array
    flight: Array
    torque: Array
    early: Array
    hip_z: Array


def play(legs: LegVectorEnv, act: Act, seeds: list[int]) -> Played:
    """Return what legs did in an episode from the starts of some seeds."""
    seen, _ = legs.reset(seed=seeds)
    task = legs.task
    zero = np.zeros(legs.num_envs)
    on = zero == 0.0
    reward, effort, ran, foot, hip, flight, longest = (zero.copy() for _ in range(7))
    rows = list[Array]()
    at = legs.layout

    for step in range(task.periods):
        seen, got, terminated, _, info = legs.step(act(step, seen))
        hip_z, contact = (seen[:, at[name]][:, 0] for name in ("hip_z", "contact"))
        height = hip_z + seen[:, at["foot"]][:, 1] - task.leg.foot_radius
        ran += on
        reward = reward + got * on
        effort = effort + info["terms"]["effort"] * on
        foot = np.maximum(foot, height * on)
        hip = np.maximum(hip, hip_z * on)
        flight = (flight + 1.0) * (on & (contact == 0.0))
        longest = np.maximum(longest, flight)
        rows.append(hip_z)
        on &= ~terminated

    torque = np.sqrt(effort / (2.0 * ran))  # effort is the sum over A and E
    mean = reward / task.periods
    longest = longest * task.period

    return Played(mean, foot, hip, longest, torque, ~on, np.array(rows))


class Generation(NamedTuple):
    """What a generation came to.

    Attributes:
        best, average: Of its policies' rewards a control step, less what `excess` costs.
        foot: Greatest height of the foot with its best policy [m].
        sigma, mean: Step size [rad] and mean policy (WEIGHTS,) after it.
    """

    best: float
    average: float
    foot: float
    sigma: float
    mean: Array


class Trial(NamedTuple):
    """What legs are to try: the task that a worker does.

    Attributes:
        weights: The policies, one a leg, (n, WEIGHTS).
        seed: Of the pose in which all of them start.
        duration: Of the episode [s].
    """

    weights: Array
    seed: int
    duration: float


def tried(trial: Trial) -> tuple[Array, Array]:
    """Return how good policies are, and how high the foot came with each [m], (n,)."""
    n = len(trial.weights)
    legs = LegVectorEnv("hop", n, nthread=THREADS, duration=trial.duration, servo=SERVO)
    played = play(legs, policies(legs, trial.weights), [trial.seed] * n)
    return played.reward - EXCESS * excess(legs, trial.weights), played.foot


def train(
    generations: int,
    seed: int,
    duration: float = TRAINED,
    workers: Workers | None = None,
) -> Iterator[Generation]:
    """Yield the generations; within one all start in the same pose, in the next in another.

    Args:
        generations: How many.
        seed: Of the search, and of the first pose.
        duration: Of an episode [s].
        workers: Who plays `BLOCK` legs at a time; this process plays all at once (None). A leg
            does the same beside any others, so the numbers are the same.
    """
    search = Cma(WEIGHTS, LEGS, SIGMA, np.random.default_rng(seed))
    block = LEGS if workers is None else BLOCK
    doing = workers or Here()

    for age in range(generations):
        weights = search.ask()
        trials = [
            (first, Trial(weights[first : first + block], seed + age, duration))
            for first in range(0, LEGS, block)
        ]
        fitness = np.zeros(LEGS)
        height = np.zeros(LEGS)
        for first, (found, foot) in doing.results(tried, trials):
            fitness[first : first + block] = found
            height[first : first + block] = foot

        search.tell(fitness)
        foot = float(height[np.argmax(fitness)])
        best = float(fitness.max())
        average = float(fitness.mean())
        yield Generation(best, average, foot, search.sigma, search.mean)


def on_path(servo: Servo) -> Played:
    """Return the hop path's one episode, its setpoints as in rail-hop: one every timestep."""
    options = {"path": RAIL.path, "spread": 0.0, "duration": SHOWN, "period": FINE}
    leg = LegVectorEnv("hop", servo=servo, **options)
    plan = motion.plan(RAIL.leg, RAIL.path, leg.task.periods, FINE)
    table = PathServo(feedforward="torque").setpoints(RAIL.leg, servo, plan, "discrete")
    return play(leg, lambda step, _: table[[step]], [0])


def show(weights: Array) -> dict[str, Played]:
    """Return episodes of 4 s: 64 starts of a policy, as many random ones, and the hop path's."""
    legs = LegVectorEnv("hop", LEGS, THREADS, servo=SERVO, duration=SHOWN, period=FINE)
    trained = policies(legs, np.tile(weights, (LEGS, 1)))
    low = legs.episodes.low
    high = legs.episodes.high
    random = np.random.default_rng(0)
    shape = (LEGS, len(low))
    seeds = list(range(LEGS))

    return {
        "trained": play(legs, held(trained), seeds),
        "random setpoints": play(legs, held(lambda *_: random.uniform(low, high, shape)), seeds),
        PATH: on_path(SERVO),
    }


def report(shown: dict[str, Played]) -> str:
    """Return the table of episodes: means over the legs, and the least and the greatest reward."""
    lines = [
        "                    reward a step            foot    hip  flight  torque RMS   ended early"
    ]
    for name, p in shown.items():
        lines.append(
            f"{name:18}{p.reward.mean():7.3f} ({p.reward.min():.3f} to {p.reward.max():.3f})"
            f"{1e3 * p.foot.mean():6.1f} mm{1e3 * p.hip.mean():4.0f} mm"
            f"{1e3 * p.flight.mean():5.0f} ms{1e3 * p.torque.mean():8.0f} mN m"
            f"{int(p.early.sum()):7d} of {len(p.early)}"
        )
    return "\n".join(lines)


def draw(found: list[Generation], shown: dict[str, Played], out: Path) -> None:
    """Draw the rewards over the generations, and the hip's height over 1.5 s."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams.update({"svg.hashsalt": "fivebar", "svg.fonttype": "none", "font.size": 9})
    figure = Figure(figsize=(8.0, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    ages = range(1, len(found) + 1)
    left.plot(ages, [each.best for each in found], color="#1f77b4", label="best of 64")
    left.plot(ages, [each.average for each in found], "--", color="#1f77b4", label="mean of 64")
    left.axhline(shown[PATH].reward[0], color="#e67e22", label="hop path")
    left.set(title="reward a control step, 1 at most", xlabel="generation")
    left.legend(fontsize=8)
    rows = np.arange(0, 1500, 4)

    for name, colour in (("trained", "#1f77b4"), (PATH, "#e67e22")):
        hip = 1e3 * shown[name].hip_z[rows, 0]
        right.plot((rows + 1) * FINE, hip, color=colour, label=name)

    right.set(title="height of the hip [mm]", xlabel="time [s]")
    right.legend(fontsize=8, loc="lower right")
    for ax in (left, right):
        ax.grid(color="#dddddd", linewidth=0.6)

    figure.savefig(out, metadata={"Date": None})


def trained(generations: int, seed: int, ray: str | None) -> list[Generation]:
    """Return the generations, and print some of them.

    Args:
        generations: How many.
        seed: Of the search.
        ray: HOST:PORT of a Ray cluster whose processors play; this process (None).

    Raises:
        FiveBarError: There is no cluster, or it is lost.
    """
    found = list[Generation]()
    with ExitStack() as stack:
        cluster = None if ray is None else stack.enter_context(RayCluster(ray).connected())
        print("generation  best   mean   foot of the best   step size")

        for each in train(generations, seed, workers=cluster):
            found.append(each)
            if len(found) % 5 == 0 or len(found) == 1:
                print(
                    f"{len(found):10d}{each.best:6.3f}{each.average:7.3f}"
                    f"{1e3 * each.foot:14.1f} mm{each.sigma:14.3f} rad"
                )

    return found


def main() -> None:
    """Train, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ray", metavar="HOST:PORT", help="play on this Ray cluster")
    chosen = parser.parse_args()
    start = time.perf_counter()
    try:
        found = trained(chosen.generations, chosen.seed, chosen.ray)
    except FiveBarError as error:
        parser.exit(2, f"error: {error}\n")

    print(f"trained in {time.perf_counter() - start:.0f} s")
    shown = show(found[-1].mean)
    print(report(shown))
    draw(found, shown, OUT)
    print(f"wrote {OUT.name}")


if __name__ == "__main__":
    main()
