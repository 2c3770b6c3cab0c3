"""Pictures of MuJoCo's: films, a leg, the interactive viewer."""
