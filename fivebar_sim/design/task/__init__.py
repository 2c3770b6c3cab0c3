"""A design task: its file, what varies, what the leg has to do, and what is forbidden."""
