"""What a leg is like: singularities, quality, aspects, what a path comes close to."""
