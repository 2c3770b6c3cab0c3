"""Episodes of robots at the task of walking, one or many at once."""
