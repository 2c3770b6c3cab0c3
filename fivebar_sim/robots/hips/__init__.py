"""The motors that a leg's hip may have besides A and E: what they are, and how they turn a leg."""
