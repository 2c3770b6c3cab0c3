"""What a URDF lacks: the YAML of its closed loops, and what MuJoCo's reader would drop."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import msgspec

from fivebar_sim.errors import ConfigError, ExtraError

ENDS = (".closures.yaml", ".yaml", ".closures.yml", ".yml")
"""Ends of the YAML's name beside the URDF."""

SHARED = "robot.yaml"
"""Its name where each robot has a folder."""

KINDS = ("3d", "6d")


class Said(msgspec.Struct, frozen=True, kw_only=True):
    """What a YAML of closures says; keys that it has besides are of other programs.

    Attributes:
        closed_loop: Pairs of links that coincide.
        type: "3d" for the origins of a pair, "6d" for their axes too; of each pair.
        name_mot: The driven joints.
        joint_name: Joints that are not what the URDF says.
        armature: Rotor inertia by joint [kg m^2].
        rest: A pose that closes the loops, angle by joint [rad].
        gravity: [m/s^2]; None for that of the earth along -z.
    """

    closed_loop: tuple[tuple[str, str], ...] = ()
    type: tuple[str, ...] = ()
    name_mot: tuple[str, ...] = ()
    joint_name: tuple[str, ...] = ()
    armature: dict[str, float] = {}
    rest: dict[str, float] = {}
    gravity: tuple[float, float, float] | None = None


def find(path: Path, given: Path | None) -> Path:
    """Return the YAML of a URDF.

    Raises:
        ConfigError: There is none.
    """
    if given is not None:
        return given
    beside = [path.with_name(path.stem + end) for end in ENDS] + [path.with_name(SHARED)]
    for each in beside:
        if each.is_file():
            return each
    raise ConfigError(
        f"{path} has no closed loop: a URDF needs a YAML of closures, {beside[0].name} beside it, "
        "or with --closures"
    )


def read(path: Path) -> Said:
    """Return what a YAML of closures says.

    Raises:
        ConfigError: It cannot be read, or a key has an illegal value.
        ExtraError: PyYAML is not installed.
    """
    try:
        import yaml
    except ImportError:
        raise ExtraError("a YAML needs PyYAML: pip install 'fivebar-sim[urdf]'") from None
    try:
        table = yaml.safe_load(path.read_text("utf-8"))
        said = msgspec.convert(table, Said, strict=False)
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror or error}") from None
    except (yaml.YAMLError, UnicodeDecodeError, msgspec.ValidationError) as error:
        raise ConfigError(f"{path}: {' '.join(str(error).split())}") from None

    # Without kinds, whole frames coincide, as in Pinocchio's toolbox.
    kinds = tuple(each.lower() for each in said.type) or ("6d",) * len(said.closed_loop)
    if len(kinds) != len(said.closed_loop) or not set(kinds) <= set(KINDS):
        raise ConfigError(
            f"{path}: type must be one of {', '.join(KINDS)} for each of the "
            f"{len(said.closed_loop)} pairs of closed_loop, got {list(said.type)}"
        )
    if said.joint_name:
        raise ConfigError(
            f"{path}: joint_name makes {', '.join(said.joint_name)} another joint than the URDF's; "
            "a planar leg has hinges alone"
        )
    return msgspec.structs.replace(said, type=kinds)


def root_link(root: ET.Element) -> str:
    """Return the link of a URDF that no joint moves."""
    children = {child.get("link") for child in root.iterfind("joint/child")}
    links = [link.get("name", "") for link in root.iterfind("link")]
    return next((link for link in links if link not in children), "")


def for_mujoco(root: ET.Element, path: Path) -> tuple[str, list[str]]:
    """Return a URDF as MuJoCo should read it, and what was left out.

    Frames without mass are kept, since a loop closes at them; meshes are left out of links that
    say what they weigh.
    """
    left = 0
    for link in root.iterfind("link"):
        if link.find("inertial") is None:
            continue
        for shape in [each for each in link if each.find("geometry/mesh") is not None]:
            link.remove(shape)
            left += 1

    extension = root.find("mujoco")
    if extension is None:
        extension = ET.SubElement(root, "mujoco")
    compiler = extension.find("compiler")
    if compiler is None:
        compiler = ET.SubElement(extension, "compiler")
    compiler.set("fusestatic", "false")
    if "meshdir" not in compiler.attrib:
        compiler.set("meshdir", str(path.absolute().parent))
    notes = [f"{left} meshes are not looked at: their links say what they weigh"] if left else []
    return ET.tostring(root, encoding="unicode"), notes
