"""The program `fivebar`."""

from __future__ import annotations

# As in fivebar_sim: nothing is imported before Ctrl-C waits to be heard.
TYPE_CHECKING = False

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return its exit status."""
    try:
        from fivebar_sim.cli import signals
    except KeyboardInterrupt:
        # Nothing listens yet: it ends as any program does, without a traceback.
        import signal

        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.raise_signal(signal.SIGINT)
        raise

    # What comes while the program itself is imported waits until somebody listens.
    with signals.held():
        from fivebar_sim.cli import program

        return program.main(argv)
