"""`fivebar compare`: a log over a run, aligned in time, measured, limited; synthetic logs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from logged_runs import SENSORS, SERVO, SHORT, log_of, ran

from fivebar_sim import run
from fivebar_sim.cli import main
from fivebar_sim.errors import ConfigError, LoopOpenError
from fivebar_sim.logs import Log
from fivebar_sim.overlay import align, page, write
from fivebar_sim.overlay.compare import KEYS, Channel, compare
from fivebar_sim.overlay.play import played


def without(log: Log, *names: str) -> Log:
    kept = {name: values for name, values in log.channels.items() if not name.startswith(names)}
    return log._replace(channels=kept)


# law


def test_a_run_whose_log_is_exact_is_played_again_to_the_bit_but_for_its_start() -> None:
    result = ran()
    log = log_of(result)
    assert set(log.channels) == {
        f"{n}_{m}" for n in ("theta", "theta_dot", "ctrl", "torque", "current") for m in "AE"
    }
    found = compare(result.scenario, log)
    assert abs(found.delay) < 5e-5
    for name in ("theta_A", "theta_E"):
        assert found.metrics[f"{name}.rms"] < 2e-4, name
        assert found.metrics[f"{name}.explained"] > 0.99999
    assert found.metrics["foot_x.max"] < 2e-5
    assert found.metrics["torque_A.explained"] > 0.99
    assert found.metrics["current_E.rms"] == pytest.approx(found.metrics["torque_E.rms"] / 0.5)


def delays(count: int) -> None:
    """Delays of 0 to 8 ms of logs with 200 Hz, 4096 counts and noise are found within 0.3 ms."""
    rng = np.random.default_rng(19)
    result = ran()
    for k, late in enumerate(rng.uniform(0.0, 8e-3, count).tolist()):
        log = log_of(result, *SENSORS, f"sensors.delay={late}", f"sim.seed={k}")
        again = compare(result.scenario, log)
        assert abs(again.delay - late) < 1e-4, late


def test_delays_are_found_within_a_third_of_a_millisecond() -> None:
    delays(3)


@pytest.mark.long
def test_a_hundred_delays_are_found() -> None:
    delays(100)


def test_a_leg_that_is_otherwise_is_seen() -> None:
    result = ran("servo.friction=0.02")
    log = log_of(result, *SENSORS, "sensors.delay=0.004")
    found = compare(ran().scenario, log)
    # A servo of 8 N m/rad with 20 mN m of friction stands up to 2.5 mrad off.
    assert 1e-3 < found.metrics["theta_A.rms"] < 5e-3
    assert found.metrics["torque_A.explained"] < 0.5
    # Friction that the model lacks holds the leg back as a delay does: 0.8 ms too much here.
    assert 0.0043 < found.delay < 0.0052


def test_what_explains_a_difference_is_taken_out_in_turn() -> None:
    t = np.linspace(0.0, 1.0, 201)
    wave = np.sin(2.0 * np.pi * 5.0 * t[:-1])
    channel = Channel(0.3 + 1.2 * wave, wave, 0.9)
    as_logged, rms, varied, left = page.left(channel)
    assert as_logged == 0.9
    assert rms == pytest.approx(np.hypot(0.3, 0.2 * np.sqrt(0.5)))
    assert varied == pytest.approx(0.2 * np.sqrt(0.5))
    assert (left, channel.gain) == (pytest.approx(0.0, abs=1e-12), pytest.approx(1.2))
    assert channel.parts["explained"] == pytest.approx(1.0 - (0.2 / 1.2) ** 2)


def test_a_log_without_commands_is_laid_over_the_scenarios_own_motion() -> None:
    result = ran()
    log = without(log_of(result, *SENSORS), "ctrl")
    cut = Log("cut", log.time[:100], {k: v[60:160] for k, v in log.channels.items()}, 0.005)
    found = compare(result.scenario, cut)
    # It begins 0.3 s and a first row of 5 ms after the run's begin, and the path repeats in 0.5 s.
    assert (found.delay + 0.305) % 0.5 == pytest.approx(0.0, abs=3e-4) or (
        found.delay + 0.305
    ) % 0.5 == pytest.approx(0.5, abs=3e-4)
    assert found.metrics["theta_A.rms"] < 2e-3
    assert not found.is_played


# edge


def test_commands_hold_until_the_next_one() -> None:
    result = ran()
    log = log_of(result)
    again = run(played(result.scenario, log))
    due = log.pair("ctrl")
    sent = np.stack([again.record["ctrl_A"], again.record["ctrl_E"]], axis=-1)
    # The servo's bus has 200 Hz and a delay of 2 steps.
    np.testing.assert_allclose(sent[2 : 2 + 5 * 200], np.repeat(due, 5, axis=0)[:1000], atol=1e-12)


# refusal


def test_logs_that_cannot_be_laid_over_a_leg_are_refused() -> None:
    result = ran()
    log = log_of(result)
    swapped = log._replace(
        channels=log.channels
        | {"theta_A": log.channels["theta_E"], "theta_E": log.channels["theta_A"]}
    )
    with pytest.raises(LoopOpenError, match=r"a guess, .* A and E swapped"):
        compare(result.scenario, swapped)
    with pytest.raises(ConfigError, match="theta_A and theta_E are needed"):
        compare(result.scenario, without(log, "theta_A"))
    still = {name: np.full_like(values, values[0]) for name, values in log.channels.items()}
    with pytest.raises(ConfigError, match="angles hardly move"):
        compare(result.scenario, log._replace(channels=still))
    with pytest.raises(ConfigError, match="overlap in 0 rows"):
        align.delay(
            log.time[:0],
            log.pair("theta")[:0],
            align.hermite(log.time, *2 * [log.pair("theta")]),
            0.1,
        )
    with pytest.raises(ConfigError, match="must last more than that"):
        align.anywhere(
            log.time,
            log.pair("theta"),
            align.hermite(log.time[:50], *2 * [log.pair("theta")[:50]]),
            None,
            0.1,
        )
    with pytest.raises(ConfigError, match=r"limits\.voltage"):
        compare(result.scenario, log).judged({"voltage.rms": (0.0, 1.0)})


# the page and the commands


def test_page_says_what_is_apart_and_what_explains_it() -> None:
    found = compare(ran().scenario, log_of(ran(), *SENSORS))
    judged = found.judged({"theta_A.rms": (-np.inf, 0.002), "delay": (-np.inf, 1e-9)})
    text = page.page(found, judged, [])
    rms = page.shown(found.metrics["foot_z.rms"], "m").replace(" ", "&nbsp;")
    for part in (
        "What explains it",
        ">FAIL<",
        "&lt;= 0.115&nbsp;deg",
        rms,
        "run of classic-ellipse",
    ):
        assert part in text


@pytest.mark.long
def test_page_shows_log_over_run(tmp_path: Path) -> None:
    found = compare(ran().scenario, log_of(ran(), *SENSORS))
    page.write(found, [], tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert [text.count(f'id="{key}"') for key in ("foot-path", "theta", "torque", "current")] == [
        1
    ] * 4
    with pytest.raises(ConfigError, match=r"must end in \.html"):
        page.write(found, [], tmp_path / "page.txt")


def test_compare_guards_that_the_model_still_fits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sets = [part for each in (*SHORT, *SERVO) for part in ("--set", each)]
    write.write(log_of(ran(), *SENSORS, "sensors.delay=0.003"), tmp_path / "log.csv")
    bench = tmp_path / "bench.toml"
    names = ("time", "theta_A", "theta_E", "ctrl_A", "ctrl_E", "torque_A", "torque_E")
    channels = "\n".join(f'{name} = "{name}"' for name in names)
    bench.write_text(f'[log]\nfile = "log.csv"\n{channels}\n[limits]\ntheta_A.rms = 0.002\n')

    assert main(["compare", "classic-ellipse", str(bench), *sets]) == 0
    said = capsys.readouterr().out
    assert "theta_A.rms" in said
    assert "pass" in said
    assert "log is 3" in said

    bound = ["--limit", "delay=0.001", "--json"]
    assert main(["compare", "classic-ellipse", str(bench), *sets, *bound]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["failed"] == ["delay"]
    assert set(found) - {"failed"} <= set(KEYS)
    assert main(["compare", "classic-ellipse", str(bench), "--limit", "theta_B.rms=1"]) == 2
    assert "unknown key 'theta_B.rms'" in capsys.readouterr().err
