"""What was minimised, built anew from a result that was read from a file: its data, its options, its minimum."""

import numpy as np

from jshell.calibration.ar1 import with_memory
from jshell.calibration.frequency_model import parameters_of_table, table_residual
from jshell.calibration.frequency_table import prepare
from jshell.calibration.objective import Objective
from jshell.calibration.options import FitOptions
from jshell.calibration.parameters import Unknowns
from jshell.calibration.preparation import problem_of
from jshell.calibration.result import Fit
from jshell.calibration.robust import reweighed
from jshell.errors import BadValue


def objective_of(result: Fit) -> Objective:
    """What a fit minimised, and its minimum; kept by the result once it is built.

    Raises:
        BadValue: The result says no options, or a tie of it is a function, which no file holds.
    """
    if result.minimised is None:
        object.__setattr__(result, "minimised", _rebuilt(result))
    assert result.minimised is not None
    return result.minimised


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
    problem, parameters, _, _ = problem_of(list(result.traces), options)
    values = _values(result, parameters)
    if options.robust is None:
        problem = with_memory(problem, result.noise) if any(one.memory > 0 for one in result.noise) else problem
        return Objective.of_traces(problem, parameters, values, result.absolute)
    moved, _, weights = reweighed(options.robust, problem, np.asarray(result.residual))
    share = tuple(np.sqrt(one) for one in weights)
    return Objective.of_traces(moved, parameters, values, result.absolute, options.robust, share)


def _of_table(result: Fit, options: FitOptions) -> Objective:
    assert options.weighting is not None
    records = prepare(result.table)
    parameters = parameters_of_table(options.fix, options.bounds)
    args = (parameters, records.rows, options.weighting)
    return Objective(table_residual, args, parameters, _values(result, parameters), result.absolute, result.n_data)


def _values(result: Fit, parameters: Unknowns) -> np.ndarray:
    """(names,) the minimum, as the model sees it."""
    if result.minimum:
        return np.array(result.minimum)
    known = {one.name: one.value for one in result.estimates}
    return np.array([known[name] ** 2 if name in parameters.squared else known[name] for name in parameters.names])
