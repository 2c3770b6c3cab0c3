"""What becomes of a design that is built: dimensions that are a little off."""
