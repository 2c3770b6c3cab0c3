"""Models of other programs, understood as legs."""
