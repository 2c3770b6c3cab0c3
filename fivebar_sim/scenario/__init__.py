"""A run as a TOML file: leg, path, scene, force, servo, controller, limits."""

from fivebar_sim.scenario.scenario import Scenario

__all__ = ["Scenario"]
