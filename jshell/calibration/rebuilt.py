"""What was minimised, built anew from a result that was read from a file: its data, its options, its minimum."""

import numpy as np

from jshell.calibration.ar1 import with_memory
from jshell.calibration.frequency_model import parameters_of_table, table_residual
from jshell.calibration.frequency_table import prepare
from jshell.calibration.objective import Objective
from jshell.calibration.options import FitOptions
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import problem_of
from jshell.calibration.result import Fit
from jshell.calibration.robust import reweighed
from jshell.errors import BadValue


def objective_of(result: Fit) -> Objective:
    """What a fit minimised, and its minimum; kept by the result once it is built.

    Raises:
        BadValue: The result says no options, or a tie of it is a function, which no file holds.
    """
    if result.objective is None:
        object.__setattr__(result, "objective", _rebuilt(result))
    assert result.objective is not None
    return result.objective


def _rebuilt(result: Fit) -> Objective:
    options = result.specification
    if options is None or not (result.traces or result.table):
        raise BadValue(
            "result",
            found="no options or no data",
            expected="those of the fit, as `FitResult.save` writes them",
            remedy="Fit again.",
        )
    if options.kind == "frequencies":
        return _of_table(result, options)
    for name, text in options.tie.items():
        if isinstance(text, str) and text.startswith("function "):
            raise BadValue(
                f"tie[{name!r}]",
                found=f"a {text}, which a file does not hold",
                expected="arithmetic as text",
                remedy="Fit result.traces again with the function.",
            )
    joint, space, _, _ = problem_of(list(result.traces), options)
    values = _values(result, space)
    if options.robust is None:
        joint = with_memory(joint, result.noise) if any(one.memory > 0 for one in result.noise) else joint
        return Objective.of_traces(joint, space, values, result.absolute)
    moved, _, weights = reweighed(options.robust, joint, np.asarray(result.residual))
    share = tuple(np.sqrt(one) for one in weights)
    return Objective.of_traces(moved, space, values, result.absolute, options.robust, share)


def _of_table(result: Fit, options: FitOptions) -> Objective:
    assert options.weighting is not None
    ready = prepare(result.table)
    space = parameters_of_table(options.fix, options.bounds)
    args = (space, ready.rows, options.weighting)
    return Objective(table_residual, args, space, _values(result, space), result.absolute, result.n_data)


def _values(result: Fit, space: Unknowns) -> np.ndarray:
    """(names,) the minimum, as the model sees it."""
    if result.minimum:
        return np.array(result.minimum)
    known = {one.name: one.value for one in result.estimates}
    return np.array([known[name] ** 2 if name in space.squared else known[name] for name in space.names])
