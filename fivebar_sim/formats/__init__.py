"""Models of other programs: legs and robots as MJCF and URDF, out and in."""
