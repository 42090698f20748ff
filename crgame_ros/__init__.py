# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real-time, human-in-the-loop driving simulation on CommonRoad and ROS 2."""

# Importing this package loads nothing more: each name below is loaded at its first use.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from crgame_ros.errors import CrgameError, InputError, PlanningError
    from crgame_ros.evaluation.evaluation import Computing
    from crgame_ros.evaluation.plan import EvaluationPlan
    from crgame_ros.game.game import Game
    from crgame_ros.messages.plan import Plan, PlanRequest
    from crgame_ros.paths import scenarios_directory
    from crgame_ros.planner.interface import Planner, PlannerContext
    from crgame_ros.python_interface.finished_evaluation import evaluate
    from crgame_ros.python_interface.finished_run import Run
    from crgame_ros.python_interface.games import load_game
    from crgame_ros.python_interface.offline_runs import run
    from crgame_ros.python_interface.recorded_runs import export, measure, read_run, replay, report
    from crgame_ros.version import __version__ as __version__  # noqa: F401
else:
    # Hidden from type checkers, for which a name that is not imported above is then an error.
    def __getattr__(name: str) -> object:
        if name not in _PLACES:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        from importlib import import_module
        found = getattr(import_module(f'{__name__}.{_PLACES[name]}'), name)
        globals()[name] = found
        return found

__all__ = [
    'Computing', 'CrgameError', 'evaluate', 'EvaluationPlan', 'export', 'Game',
    'InputError', 'load_game', 'measure', 'Plan', 'Planner', 'PlannerContext', 'PlanningError',
    'PlanRequest', 'read_run', 'replay', 'report', 'run', 'Run', 'scenarios_directory']
# The module of each name, within this package.
_PLACES = {
    '__version__': 'version',
    'CrgameError': 'errors', 'InputError': 'errors', 'PlanningError': 'errors',
    'Computing': 'evaluation.evaluation', 'EvaluationPlan': 'evaluation.plan',
    'evaluate': 'python_interface.finished_evaluation', 'scenarios_directory': 'paths',
    'Game': 'game.game', 'Plan': 'messages.plan', 'PlanRequest': 'messages.plan',
    'Planner': 'planner.interface', 'PlannerContext': 'planner.interface',
    'Run': 'python_interface.finished_run',
    'load_game': 'python_interface.games', 'run': 'python_interface.offline_runs',
    'read_run': 'python_interface.recorded_runs', 'replay': 'python_interface.recorded_runs',
    'export': 'python_interface.recorded_runs', 'measure': 'python_interface.recorded_runs',
    'report': 'python_interface.recorded_runs'}


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
