"""Arrow's tables without pandas, which pyarrow would import to ask whether an array is a Series.

That takes as long as a short run, in every program that reads or writes a table, where pandas is
installed; ours has none to ask about. A controller of the user's may still import it.
"""

from __future__ import annotations

import sys

USED_BY = frozenset(
    {"compare", "design", "identify", "log", "render", "replay", "report", "run", "sweep"}
)
"""The commands that read or write tables."""


class _NoPandas:
    """Tells those who import pandas that there is none."""

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError("pyarrow does without it here", name=fullname)


def leave_pandas_out() -> None:
    """Have pyarrow look for pandas now, and find none; what needs it later imports it then.

    It looks twice: once in Python, with the first array that it is given, and once in C++, with the
    first list or number, as Rerun gives it one.
    """
    if "pandas" in sys.modules:
        return
    import numpy as np
    import pyarrow

    finder = _NoPandas()
    sys.meta_path.insert(0, finder)
    try:
        pyarrow.array(np.empty(0))
        pyarrow.array([0])
    finally:
        sys.meta_path.remove(finder)
