"""Who does tasks that need nothing of each other: this process, several, or a Ray cluster.

Each gives the same results: which worker does a task, and when, never changes what comes of it.
"""
