"""Scenarios: the same task for several undercarriages of one size."""

from omniplan.scenarios.scenario import SCENARIOS, Scenario, scenario
from omniplan.scenarios.solving import Solution, solve, solve_all

__all__ = ["SCENARIOS", "Scenario", "Solution", "scenario", "solve", "solve_all"]
