"""Analysis of a leg: singularities, quality, aspects, and what a path comes close to."""
