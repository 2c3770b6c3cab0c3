"""Put the page's modules into one script: each becomes a function that returns its exports.

The files are plain ES modules, which Node runs as they are. A page from a file may not import
others, so what they import is taken from the functions before.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

NAMED = re.compile(r'^import (\{[^}]*\}) from "\./(\w+)\.js";$', re.MULTILINE)
WHOLE = re.compile(r'^import \* as (\w+) from "\./(\w+)\.js";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:const|function|class) (\w+))", re.MULTILINE)


def bundle(sources: Mapping[str, str], main: str) -> str:
    """Return one script of modules.

    Args:
        sources: The text of each module by its name, without ".js".
        main: Name of the module that is run; the others come as it needs them.
    """
    done: list[str] = []
    parts: list[str] = []

    def add(name: str) -> None:
        if name in done:
            return
        done.append(name)
        text = sources[name]
        for needed in [*NAMED.findall(text), *WHOLE.findall(text)]:
            add(needed[1])
        parts.append(_module(name, text, is_main=name == main))

    add(main)
    return "\n".join(parts)


def _module(name: str, text: str, *, is_main: bool) -> str:
    """Return a module as a constant with its exports; the main one as it is."""
    names = EXPORT.findall(text)
    text = NAMED.sub(r"const \1 = module_\2;", text)
    text = WHOLE.sub(r"const \1 = module_\2;", text)
    text = EXPORT.sub("", text).strip()
    if is_main:
        return f"{text}\n"
    return f"const module_{name} = (() => {{\n{text}\nreturn {{ {', '.join(names)} }};\n}})();\n"
