"""Pictures by MuJoCo: films of runs, pictures of a leg, the interactive viewer."""
