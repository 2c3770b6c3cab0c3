"""`python -m fivebar_sim`: the command `fivebar`."""

from fivebar_sim.cli import main

raise SystemExit(main())
