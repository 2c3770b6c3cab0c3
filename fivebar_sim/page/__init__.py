"""A leg on one HTML page that runs the firmware's C code in the browser, as WebAssembly."""

from fivebar_sim.page.compose import page, write

__all__ = ["page", "write"]
