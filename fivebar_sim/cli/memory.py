"""Whether this process may take the memory that a run needs, asked before anything is simulated.

What runs out of it on the way may end in the middle of a library that knows no other way out.
"""

from __future__ import annotations

from fivebar_sim.errors import ConfigError

LEAST = 3 << 30
"""Address space that a short run needs [bytes]: 0.9 GB, and two allocators that take 1 GiB each."""

A_STEP = 1500
"""Address space that a physics step needs [bytes]: rows of the record and of the recording."""


def allowed() -> int | None:
    """Return the address space that the system grants this process [bytes]; None: no such limit."""
    try:
        import resource
    except ImportError:  # Windows has none
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def check(steps: int = 0) -> None:
    """Raise unless a run of some steps may have the address space that it needs.

    Raises:
        ConfigError: The limit is below that; says both.
    """
    limit = allowed()
    needed = LEAST + A_STEP * steps
    if limit is not None and limit < needed:
        what = f"a run of {steps} steps" if steps else "fivebar"
        raise ConfigError(
            f"{what} needs {needed / 1e9:.1f} GB of address space, and may have {limit / 1e9:.1f} "
            f"GB: see `ulimit -v`"
        )
