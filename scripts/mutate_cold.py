"""A plugin of pytest that scripts/mutate.py uses: every test begins with empty caches.

mutmut notes which tests reach a function, and tests its mutants in forks of that very process. An
answer that the package remembers from an earlier test would hide both that a test reaches a
function and what a mutant of it does.
"""

from __future__ import annotations

import functools
import sys

CACHE = type(functools.lru_cache(abs))


def pytest_runtest_setup() -> None:
    """Forget the package's answers to all earlier calls, and what tests drew with them."""
    for name, module in [*sys.modules.items()]:
        if name.split(".")[0] in ("fivebar_sim", "poses"):
            for value in vars(module).values():
                if isinstance(value, CACHE):
                    value.cache_clear()
