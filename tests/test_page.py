"""`fivebar page`: one file that needs nothing else, the firmware's bits in it, bad input."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from fivebar_sim import firmware, kinematics
from fivebar_sim.files import resources
from fivebar_sim.geometry import MODES, FiveBar
from fivebar_sim.page import bundle, compose, page

ROOT = Path(__file__).resolve().parents[1]
HERE = ROOT / "fivebar_sim" / "page"
MODULES = {path.stem: path.read_text(encoding="utf-8") for path in HERE.glob("*.js")}

SOLVE = """
import fs from "node:fs";
import { Leg } from "./leg.mjs";
const { lengths, modes, feet, force } = JSON.parse(fs.readFileSync(0, "utf-8"));
const leg = await Leg.fromBase64(fs.readFileSync(process.argv[2]).toString("base64"));
const found = modes.map((signs) => {
  const status = leg.prepare(lengths, signs);
  return feet.map((foot) => {
    const pose = leg.inverse(foot, force);
    const of = (pair) => [...new Uint32Array(new Float32Array(pair).buffer)];
    return [status, pose.status, of(pose.theta), pose.tau && of(pose.tau)];
  });
});
console.log(JSON.stringify(found));
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    return Shell(tmp_path, capsys)


def test_page_is_one_file_and_the_same_every_time(shell: Shell, tmp_path: Path) -> None:
    said = shell("page", "q8bot")
    assert said == (0, "q8bot: a page to open in a browser, q8bot.html\n", "")
    text = (tmp_path / "q8bot.html").read_text(encoding="utf-8")
    assert text == page("q8bot")
    assert len(text) < 150_000
    assert "{{" not in text
    assert not re.search(r"^(import|export) ", text, re.MULTILINE)
    # Nothing is asked for: the page's own policy says so, and it names no place.
    assert "default-src 'none'" in text
    assert not re.search(r"(https?:)?//[a-z]+\.", text)
    assert json.dumps([0.025, 0.04, 0.04, 0.025, 0.0195, 0.0, 0.0, 0.0])[1:-1] in text


def test_bundle_gives_each_module_its_own_names() -> None:
    sources = {
        "main": 'import { f } from "./a.js";\nimport * as b from "./b.js";\nf(b.g);\n',
        "a": 'import { g } from "./b.js";\nexport function f(x) {}\nconst g2 = g;\n',
        "b": "export const g = 1;\nexport class H {}\nconst f = 2;\n",
    }
    text = bundle.bundle(sources, "main")
    assert text.index("module_b =") < text.index("module_a =") < text.index("f(b.g)")
    assert text.count("module_b =") == 1
    assert "return { g, H };" in text
    assert "const { f } = module_a;\nconst b = module_b;\n" in text
    # Every module of the page is in it, and every name that one takes is there to take.
    whole = bundle.bundle(MODULES, "main")
    for name, source in MODULES.items():
        assert name == "main" or f"const module_{name} = " in whole
        for names, of in bundle.NAMED.findall(source):
            taken = {each.strip() for each in names.strip("{}").split(",") if each.strip()}
            assert taken <= set(bundle.EXPORT.findall(MODULES[of])), (name, of)


def test_names_cannot_end_the_script_or_the_heading(tmp_path: Path) -> None:
    leg = tmp_path / "odd.toml"
    leg.write_text('name = "</script><b>{{wasm}}"\nL1 = 0.05\ndensity = 900.0\n', encoding="utf-8")
    text = page(leg)
    assert text.count("</script>") == 3
    assert "<b>{{" not in text
    assert "&lt;/script&gt;&lt;b&gt;{{wasm}}</span>" in text
    assert '"rest": ["density = 900.0"]' in text
    assert '"preset": null' in text


def test_refusals(shell: Shell, tmp_path: Path) -> None:
    assert shell.refused("page", "clasic").startswith("unknown leg preset 'clasic'; known: ")
    message = shell.refused("page", "classic", "--out", "leg.txt")
    assert message == "cannot write leg.txt: a page must end in .html"
    (tmp_path / "there.html").mkdir()
    message = shell.refused("page", "classic", "--out", "there.html")
    assert message == "cannot write there.html: a directory is there"
    (tmp_path / "tiny.toml").write_text(
        'scale = "any"\nL1 = 2e-5\nL2 = 2e-5\nL3 = 2e-5\nL4 = 2e-5\nL5 = 0.0\n'
    )
    assert "cannot hold the leg tiny" in shell.refused("page", "tiny.toml")
    (tmp_path / "bad.toml").write_text("L9 = 1.0\n")
    assert "unknown key 'L9'" in shell.refused("page", "bad.toml")


def test_every_preset_starts_on_its_branch() -> None:
    for name in resources.shipped("models/legs"):
        start = compose.start(FiveBar.load(name), name)
        leg = FiveBar.load(name)
        theta = kinematics.inverse(leg, start["foot"])
        assert np.allclose(kinematics.forward(leg, theta), start["foot"])
        assert tuple(start["signs"]) == leg.mode
        assert start["preset"] == name
        # The first force pulls away from the hip.
        assert start["force"][1] * start["foot"][1] > 0.0


def node() -> str:
    found = shutil.which("node")
    if found is None:
        pytest.skip("there is no node on the PATH")
    return found


@pytest.mark.parametrize("name", ["classic", "extended", "doggo"])
def test_wasm_has_the_firmware_s_bits(name: str, tmp_path: Path) -> None:
    """leg.wasm under Node, and `fivebar_sim.firmware` in NumPy: equal to the last bit."""
    program = tmp_path / "solve.mjs"
    program.write_text(SOLVE)
    (tmp_path / "leg.mjs").write_text(MODULES["leg"])
    leg = FiveBar.load(name)
    feet = np.random.default_rng(1).uniform(-leg.size, leg.size, (400, 2)).astype(np.float32)
    force = np.array([2.5, -4.0], dtype=np.float32)
    asked = {
        "lengths": [getattr(leg, key) for key in compose.KEYS],
        "modes": MODES,
        "feet": feet.astype(float).tolist(),
        "force": force.tolist(),
    }
    command = [node(), str(program), str(HERE / "leg.wasm")]
    run = subprocess.run(command, input=json.dumps(asked), capture_output=True, text=True)
    assert run.returncode == 0, run.stderr

    held = firmware.of(leg)
    answers = json.loads(run.stdout)
    reached = 0
    for mode, rows in zip(MODES, answers, strict=True):
        theta, status = firmware.inverse(held, feet, *mode)
        held_by = [firmware.torque(held, theta, sign, force) for sign in (-1, 1)]
        for k, (prepared, came, angles, tau) in enumerate(rows):
            assert prepared == 0
            if status[k] != 0:
                assert came == status[k]
                continue
            assert angles == theta[k].view(np.uint32).tolist()
            if tau is not None:
                reached += 1
                right = [each[k] for each, ok in held_by if ok[k] == 0]
                assert tau in [each.view(np.uint32).tolist() for each in right]
    assert reached > 200


def test_wasm_is_what_the_compiler_makes_of_the_firmware(tmp_path: Path) -> None:
    """Built anew where clang is the one that made it; its bytes name no path of that machine."""
    content = (HERE / "leg.wasm").read_bytes()
    assert content[:4] == b"\0asm"
    assert len(content) < 12_000
    assert b"/" not in content
    if shutil.which("clang") is None or shutil.which("wasm-ld") is None:
        pytest.skip("clang and lld are not installed")
    said = subprocess.run(["clang", "--version"], capture_output=True, text=True).stdout
    if said.splitlines()[0] != (HERE / "leg.wasm.txt").read_text(encoding="utf-8").strip():
        pytest.skip("clang is another than that of leg.wasm.txt")
    spec = importlib.util.spec_from_file_location("built", ROOT / "scripts" / "build_wasm.py")
    assert spec
    assert spec.loader
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    place = tmp_path / "leg.wasm"
    script.build(place)
    assert place.read_bytes() == content


def test_every_module_parses(tmp_path: Path) -> None:
    for name, source in MODULES.items():
        (tmp_path / f"{name}.mjs").write_text(source, encoding="utf-8")
    files = sorted(map(str, tmp_path.glob("*.mjs")))
    code = """process.argv.slice(1).forEach(file => {
        new (require("vm").SourceTextModule)(require("fs").readFileSync(file, "utf-8"));
    });"""
    command = [node(), "--experimental-vm-modules", "--no-warnings", "-e", code, *files]
    assert subprocess.run(command, capture_output=True, text=True).stderr == ""
