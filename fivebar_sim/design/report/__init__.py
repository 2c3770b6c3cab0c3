"""The page of a design study: front, legs, sensitivities, what was simulated, and what to take."""
