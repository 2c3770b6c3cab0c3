"""The evaluation of designs: poses, torques, objectives and constraints on arrays."""
