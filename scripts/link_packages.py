""".venv/bin/python scripts/link_packages.py FOLDER: links what the wheel in FOLDER asks for.

FOLDER is another environment's site-packages, where nothing but the wheel is installed. What it
asks for, and what that asks for, is in .venv already, as locked; nothing else comes along. So an
environment of the wheel alone is made in a second, without a network.
"""

from __future__ import annotations

import argparse
import re
import sysconfig
from collections.abc import Iterable
from importlib.metadata import Distribution, distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement


def main() -> None:
    """Link the packages."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="site-packages of an environment with the wheel")
    folder = parser.parse_args().folder

    (wheel,) = distributions(name="fivebar-sim", path=[str(folder)])
    asked = asked_for(wheel)
    home = Path(sysconfig.get_path("purelib"))
    for name in sorted(tops(asked.values()) - {".."}):  # programs stay where they are
        (folder / name).symlink_to(home / name)
    print(f"{len(asked)} packages that the wheel asks for, itself or by others")


def asked_for(wheel: Distribution) -> dict[str, Distribution]:
    """Return the packages that a wheel without extras asks for, itself or through others."""
    found: dict[str, Distribution] = {}
    seen = set[tuple[str, str]]()
    rest = fitting(wheel, "")
    while rest:
        asked = rest.pop()
        name = re.sub(r"[-_.]+", "-", asked.name).lower()
        for extra in {"", *asked.extras}:
            if (name, extra) not in seen:
                seen.add((name, extra))
                found[name] = distribution(asked.name)
                rest += fitting(found[name], extra)
    return found


def fitting(package: Distribution, extra: str) -> list[Requirement]:
    """Return what a package asks for on this Python and system, with one of its extras or ""."""
    lines = [Requirement(line) for line in package.requires or []]
    return [line for line in lines if not line.marker or line.marker.evaluate({"extra": extra})]


def tops(packages: Iterable[Distribution]) -> set[str]:
    """Return the files and folders that packages have in site-packages."""
    return {path.parts[0] for package in packages for path in package.files or []}


if __name__ == "__main__":
    main()
