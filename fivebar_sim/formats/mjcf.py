"""Writes what is simulated as one MJCF file, for any program that reads MuJoCo's format."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np

from fivebar_sim.errors import ConfigError
from fivebar_sim.files import whole_file
from fivebar_sim.formats.digits import every_digit, shortest
from fivebar_sim.formats.subject import Subject
from fivebar_sim.model import quiet

HEADING = (
    " Written by fivebar-sim: {words}. SI units, radians; leg plane x-z. qpos of A and E reads "
    "theta_A and theta_E; the keyframe {key} is the rest pose, and holds it. "
)

AUTORESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def write(subject: Subject, place: Path) -> list[str]:
    """Write a leg, a scenario or a robot as one MJCF file.

    Args:
        subject: What is written.
        place: The file.

    Returns:
        What was cleared of it, because MuJoCo Warp refuses it.

    Raises:
        ConfigError: The file cannot be written.
        GeometryError: MuJoCo cannot compile the leg.
    """
    spec = subject.spec()
    cleared = clear_for_warp(spec)
    whole_file.write(place, text(spec, subject.words))
    return cleared


def clear_for_warp(spec: mujoco.MjSpec) -> list[str]:
    """Clear the options of a spec that MuJoCo Warp refuses; return what they were, in words.

    Both matter only to a simulation that breaks down, or not at all: MuJoCo would start a broken
    one again, which `fivebar run` counts as an error.
    """
    cleared = []
    if spec.option.disableflags & AUTORESET:
        spec.option.disableflags &= ~AUTORESET
        cleared.append("flag autoreset=disable")
    if spec.option.noslip_iterations:
        cleared.append(f"noslip_iterations={spec.option.noslip_iterations}")
        spec.option.noslip_iterations = 0
    return cleared


def text(spec: mujoco.MjSpec, words: str) -> str:
    """Return a spec as MJCF that compiles to the same model, bit for bit.

    Args:
        spec: The spec.
        words: What it is, for the comment in front.

    Raises:
        ConfigError: The text does not compile to the same model.
    """
    with quiet(), every_digit():
        compiled = spec.compile()
        root = ET.fromstring(spec.to_xml())
    for defaults in list(root.iter("default")):
        _lift_nameless(defaults)
    for element in root.iter():
        element.attrib = {key: shortest(value) for key, value in element.attrib.items()}

    comment = HEADING.format(words=words.replace("--", "- -"), key=spec.keys[0].name)
    root.insert(0, ET.Comment(comment))
    ET.indent(root)
    written = ET.tostring(root, encoding="unicode") + "\n"
    _check_same(compiled, written)
    return written


def _lift_nameless(defaults: ET.Element) -> None:
    """Put what is in a class without a name into the class around it.

    MuJoCo writes such a class for what was attached without a prefix, and cannot read it.
    """
    for child in list(defaults):
        if child.tag == "default" and not child.get("class"):
            place = list(defaults).index(child)
            defaults.remove(child)
            for k, inner in enumerate(child):
                defaults.insert(place + k, inner)


def _check_same(compiled: mujoco.MjModel, written: str) -> None:
    """Raise unless a text compiles to a model."""
    with quiet():
        again = mujoco.MjModel.from_xml_string(written)
    differing = list(differences(compiled, again))
    if differing:
        raise ConfigError(
            f"this version of MuJoCo, {mujoco.__version__}, reads back another model than it "
            f"writes: {', '.join(differing)} differ"
        )


def differences(one: mujoco.MjModel, other: mujoco.MjModel) -> Iterator[str]:
    """Yield the names of the fields in which two models differ, by a bit or more."""
    for parts in (lambda each: each, lambda each: each.opt):
        for name in dir(parts(one)):
            mine = getattr(parts(one), name)
            if isinstance(mine, np.ndarray | int | float) and not name.startswith("_"):
                if not np.array_equal(mine, getattr(parts(other), name)):
                    yield name
