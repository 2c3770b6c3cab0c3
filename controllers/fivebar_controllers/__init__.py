"""Controllers of the five-bar leg, found through the entry-point group fivebar_sim.controllers."""
