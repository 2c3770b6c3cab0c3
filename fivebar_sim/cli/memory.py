"""Check before a simulation that this process may allocate the memory that it needs.

A library that runs out of memory later may abort the whole process.
"""

from __future__ import annotations

from fivebar_sim.errors import ConfigError

LEAST = 3 << 30
"""Address space that a short run needs [bytes]: 0.9 GB, and two allocators that take 1 GiB each."""

A_STEP = 1500
"""Address space per physics step [bytes]: rows of the record and of the recording."""


def allowed() -> int | None:
    """Return the limit of this process's address space [bytes]; None: no limit."""
    try:
        import resource
    # Windows has no such limits.
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def check(steps: int = 0) -> None:
    """Raise if the limit of the address space is too small for a run of some steps.

    Raises:
        ConfigError: It is too small; the message has both numbers.
    """
    limit = allowed()
    needed = LEAST + A_STEP * steps
    if limit is not None and limit < needed:
        what = f"a run of {steps} steps" if steps else "fivebar"
        raise ConfigError(
            f"{what} needs {needed / 1e9:.1f} GB of address space, and may have {limit / 1e9:.1f} "
            f"GB: see `ulimit -v`"
        )
