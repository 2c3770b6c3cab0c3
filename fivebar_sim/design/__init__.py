"""Design: which leg should be built for a task; closed form, on arrays of designs.

task = design.load("task.toml")
found = design.evaluate(task, task.sample(1000, seed=0))
found.objectives[found.feasible]
"""

from fivebar_sim.design.evaluation.evaluate import Column, Evaluated, columns, evaluate
from fivebar_sim.design.evaluation.measures import limits
from fivebar_sim.design.task.ends import load
from fivebar_sim.design.task.task import Task

__all__ = ["Column", "Evaluated", "Task", "columns", "evaluate", "limits", "load"]
