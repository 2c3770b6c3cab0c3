"""The shape of the code: its import graph with levels and circles, and how long its parts are."""

from __future__ import annotations

import ast
import functools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

PACKAGES = {"fivebar_sim": "fivebar_sim", "fivebar_controllers": "controllers/fivebar_controllers"}
"""The packages that ship, and where they lie."""

LEVELS = (
    "errors units",
    "arrays checks files workers",
    "links",
    "geometry integrator logs",
    "kinematics",
    "paths",
    "analysis dynamics firmware workspace",
    "certify metrics motion",
    "control",
    "scenario fivebar_controllers",
    "robots setpoints",
    "model",
    "render simulation",
    "formats",
    "recording tasks",
    "walking",
    "runs environment gym",
    "report warp",
    "page rollout vector",
    "identify overlay regression sb3 sweep",
    "design",
    "cli pytest_plugin",
    "fivebar_sim __main__",
)
"""Rooms from the bottom to the top: each may import those of the lines above its own."""

MOST_AT_THE_TOP = 15
MOST_IN_A_ROOM = 14
"""Modules. The commands in `cli`, a file each, are not counted: the program may learn more."""


MOST_IN_A_FUNCTION = 30
MOST_IN_A_FILE = 150
MOST_IN_A_FILE_OF_TESTS = 220
"""Statements. Lines would count too: then code gets dense instead of being split.

A file of tests is a list of them, and may be longer; so may a script.
"""


class Edge(NamedTuple):
    """An import of one module by another; `when` is "", "lazy" or "typing"."""

    by: str
    of: str
    when: str


def modules(root: Path) -> dict[str, Path]:
    """Return the modules that ship, by their dotted names."""
    found = {}
    for package, folder in PACKAGES.items():
        for path in sorted((root / folder).rglob("*.py")):
            parts = path.relative_to(root / folder).with_suffix("").parts
            found[".".join([package, *parts]).removesuffix(".__init__")] = path
    return found


def when(parents: Iterable[ast.AST]) -> str:
    """Return when an import within some nodes happens."""
    kind = ""
    for node in parents:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            return "lazy"
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            kind = "typing"
    return kind


BLOCKS = {"body", "handlers", "cases", "orelse", "finalbody"}
"""Fields of nodes in which statements stand; expressions hold none."""


def blocks(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what stands directly within a node: expressions, which hold no statement, left out."""
    for name in BLOCKS.intersection(node._fields):
        yield from getattr(node, name)


def within(node: ast.AST) -> list[ast.stmt]:
    """Return every statement within a node, in no order."""
    todo = [node]
    found: list[ast.AST] = []
    while todo:
        inner = list(blocks(todo.pop()))
        todo += inner
        found += inner
    return [each for each in found if isinstance(each, ast.stmt)]


@functools.cache
def parsed(source: str) -> ast.Module:
    """Return a source's tree, once for all that is asked of it."""
    return ast.parse(source)


@functools.cache
def written(source: str) -> list[ast.stmt]:
    """Return every statement of a source, once for all that is asked of them."""
    return within(parsed(source))


def statements(node: ast.AST, parents: tuple[ast.AST, ...] = ()) -> Iterator[tuple[ast.AST, str]]:
    """Yield every import within a node, and when it happens."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        yield node, when(parents)
    for child in blocks(node):
        yield from statements(child, (*parents, node))


def named(node: ast.AST, known: Mapping[str, Path]) -> Iterator[str]:
    """Yield the modules that an import names."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        for alias in node.names:
            inner = f"{node.module}.{alias.name}"
            yield inner if inner in known else node.module


def edges(root: Path) -> list[Edge]:
    """Return every import between modules that ship."""
    known = modules(root)
    found = set()
    for name, path in known.items():
        for node, kind in statements(parsed(path.read_text(encoding="utf-8"))):
            found |= {Edge(name, of, kind) for of in named(node, known) if of in known}
    return sorted(found)


def room(module: str) -> str:
    """Return the room of a module: what stands at the top level of the package."""
    parts = module.split(".")
    if parts[0] != "fivebar_sim":
        return parts[0]
    return parts[1] if len(parts) > 1 else "fivebar_sim"


def between_rooms(graph: Iterable[Edge]) -> list[Edge]:
    """Return the edges between rooms."""
    return sorted({Edge(room(e.by), room(e.of), "") for e in graph if room(e.by) != room(e.of)})


def circles(graph: Iterable[Edge]) -> list[list[str]]:
    """Return the strongly connected components of more than one node, by Tarjan's algorithm."""
    ways: dict[str, set[str]] = {}
    for edge in graph:
        ways.setdefault(edge.by, set()).add(edge.of)
        ways.setdefault(edge.of, set())
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for after in sorted(ways[node]):
            if after not in index:
                visit(after)
                low[node] = min(low[node], low[after])
            elif after in stack:
                low[node] = min(low[node], index[after])
        if low[node] == index[node]:
            part = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(part) > 1 or node in ways[node]:
                found.append(sorted(part))

    for node in sorted(ways):
        if node not in index:
            visit(node)
    return found


def unplaced(graph: Iterable[Edge]) -> list[str]:
    """Return the rooms that have no level."""
    placed = {name for line in LEVELS for name in line.split()}
    return sorted({room(name) for edge in graph for name in edge[:2]} - placed)


def upward(graph: Iterable[Edge]) -> list[Edge]:
    """Return the edges that do not go down: into a room of the same level, or of one above."""
    level = {name: k for k, line in enumerate(LEVELS) for name in line.split()}
    return [
        edge
        for edge in graph
        if room(edge.by) != room(edge.of)
        and not level.get(room(edge.of), len(LEVELS)) < level.get(room(edge.by), -1)
    ]


def sizes(root: Path) -> Counter[str]:
    """Return the number of modules of each package, without its __init__; "" is the top level."""
    found: Counter[str] = Counter()
    for name, path in modules(root).items():
        if name.startswith("fivebar_sim") and path.name != "__init__.py":
            parts = name.split(".")
            found[".".join(parts[1:-1])] += 1
    return found


def length(node: ast.AST) -> int:
    """Return the number of statements within a node, without imports and docstrings."""
    return sum(
        not isinstance(each, ast.Import | ast.ImportFrom)
        and not (isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant))
        for each in within(node)
    )


def long_functions(source: str) -> list[str]:
    """Return "name: statements" of the functions that are too long."""
    return [
        f"{node.name}: {length(node)}"
        for node in written(source)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        # Ruff lets no two statements share a line, so fewer lines need no counting.
        and (node.end_lineno or node.lineno) - node.lineno >= MOST_IN_A_FUNCTION
        and length(node) > MOST_IN_A_FUNCTION
    ]


def dense_functions(source: str) -> list[str]:
    """Return the functions whose body has 12 lines or more, none of them blank or a comment."""
    lines = source.splitlines()
    found = []
    for node in written(source):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            text = lines[body[0].lineno - 1 : body[-1].end_lineno] if body else []
            air = any(not line.strip() or line.strip().startswith("#") for line in text)
            if len(text) >= 12 and not air:
                found.append(node.name)
    return found


def double_assignments(source: str) -> list[int]:
    """Return the lines of `a, b = x, y`; a swap, with the left's names on the right, is none."""
    found = []
    for node in written(source):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple):
            target = node.targets[0]
            unpacks = any(isinstance(each, ast.Starred) for each in node.value.elts)
            if isinstance(target, ast.Tuple) and not unpacks:
                old = {name.id for name in ast.walk(node.value) if isinstance(name, ast.Name)}
                new = {ast.unparse(element) for element in target.elts}
                if not old & new:
                    found.append(node.lineno)
    return found
