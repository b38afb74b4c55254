"""What a trace fit solves: records made ready, and their parameters."""

import numpy as np

from jshell.calibration.agreement import holder
from jshell.calibration.data import filled, with_sigma
from jshell.calibration.losses import TraceModel
from jshell.calibration.options import FitOptions
from jshell.calibration.parameters import Unknowns
from jshell.calibration.problem import Problem, join, parameters_of
from jshell.calibration.records import Record, record, rest_state
from jshell.calibration.starts import ModePair, find_modes
from jshell.errors import BadValue
from jshell.trace import Trace


def problem_of(cut: list[Trace], options: FitOptions) -> tuple[Problem, Unknowns, list[ModePair | None], list[str]]:
    """What a fit solves: the traces inside their windows, compared as the options say, and their parameters.

    Args:
        cut: From `windowed`.
        options: With loss and channels.

    Returns:
        The problem, its parameters, the modes found in each trace, and warnings.
    """
    assert options.loss is not None
    assert options.channels is not None
    inverted = options.loss == "strict" or bool(options.uncertain)
    held = [text for number, one in enumerate(cut, 1) if (text := holder(one, number, inverted=inverted))]
    records, modes, texts = prepared(cut, tuple(options.channels), options.equilibrium)
    texts = [*held, *texts]
    model = TraceModel(tuple(records), options.loss, options.solver, options.dipole, options.beta2 == "equal_decay")
    viscous = any(float(one.conditions.viscosity) > 0 for one in records)
    if options.loss == "strict" and "beta1" not in options.fix and not viscous:
        raise BadValue(
            "viscosity",
            found="0 in every trace",
            expected="a viscosity, which beta1 multiplies",
            remedy='Give the viscosity, or fix={"beta1": 0.0}.',
        )
    problem = join(
        model, local=options.local, uncertain=options.uncertain, priors=options.priors,
        equilibrium=options.equilibrium,
    )  # fmt: skip
    return problem, parameters_of(problem, options.fix, options.bounds, options.tie), modes, texts


def prepared(
    cut: list[Trace], names: tuple[str, ...], equilibrium: str
) -> tuple[list[Record], list[ModePair | None], list[str]]:
    """Records with rest states, their modes, and warnings."""
    with_sigma(cut, names)
    records, modes, texts = [], [], []
    for number, trace in enumerate(cut, 1):
        times = np.asarray(trace.times, dtype=float)
        data = [filled(times, np.asarray(trace[name], dtype=float)) for name in names]
        found = find_modes(times - times[0], np.stack(data))
        offset = None
        if "V" in names:
            index = names.index("V")
            offset = float(np.nanmean(trace["V"])) if found is None else float(found.offsets[index])
        state, more = rest_state(trace, offset, equilibrium, number)
        records.append(record(trace, names, state))
        modes.append(found)
        texts += more
    return records, modes, list(dict.fromkeys(texts))
