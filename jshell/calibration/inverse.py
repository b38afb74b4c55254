"""The inverse problem: conditions from a ring-down, the constants of the model known.

An experimenter knows the shell less well than the model: its thickness, its
modulus, the gas it holds. With the constants taken from elsewhere, two
frequencies and a decay tell about conditions instead. The short model describes no simulated record of H and W:
`jshell.invert` asks the simulator. What is here answers for one release.
"""

import warnings
from collections.abc import Mapping, Sequence

from jshell.calibration.options import Prior
from jshell.calibration.report import FitResult
from jshell.calibration.trajectories import fit_trajectories
from jshell.errors import BadValue
from jshell.oscillator.coefficients import Coefficients
from jshell.trace import Trace


def fit_conditions(
    traces: Trace | Sequence[Trace],
    coefficients: Coefficients,
    vary: Sequence[str] | Mapping[str, float | None],
    *,
    loss: str | None = None,
    constants_error: Mapping[str, float] | None = None,
    **options,
) -> FitResult:
    """Fit conditions of shells by the short model, its constants given: a former name.

    `jshell.invert` finds them by the simulator, without constants; by the short model they are what
    `fit_trajectories(fix=…, uncertain=…)` is asked for.

    Args:
        traces: With nominal conditions, from which the fit starts.
        coefficients: The constants, from another fit.
        vary: Conditions to fit: `thickness` [R0], `youngs_modulus` [its nominal value], `gas_pressure`,
            `outer_pressure` [nominal E d/R0], `viscosity`; as names, or with the relative standard error
            that is known of each (None: nothing).
        loss: `strict` or `modal`, as in `fit_trajectories`.
        constants_error: Standard errors of constants, which then are parameters with that prior, and pass
            their uncertainty on to the conditions.
        **options: As in `fit_trajectories`.

    Returns:
        A result whose estimates are the conditions; the constants are fixed, or held by their priors.

    Raises:
        BadValue: Nothing to vary; an undamped model.
        BadName: No such condition or constant.

    Example:
        >>> found = fit_conditions(trace, known, ("gas_pressure",))  # doctest: +SKIP
        >>> found["gas_pressure"].value  # doctest: +SKIP
    """
    warnings.warn(
        "jshell.calibration.fit_conditions is now jshell.invert, by the simulator; by the short model "
        "fit_trajectories(traces, fix=constants, uncertain=conditions)",
        DeprecationWarning,
        stacklevel=2,
    )
    uncertain = dict(vary) if isinstance(vary, Mapping) else dict.fromkeys(vary)
    if not uncertain:
        raise BadValue("vary", found="nothing", expected="a condition", remedy='Write vary=("gas_pressure",).')
    c = coefficients
    known = {"alpha1": float(c.alpha1), "alpha2": float(c.alpha2), "k_vs": float(c.k_vs)}
    modal = loss == "modal" or (loss is None and set(options.get("channels") or _channels(traces)) != {"V", "S"})
    if not modal:
        known["beta1"] = float(c.beta1)
        if options.get("beta2") == "free":
            known["beta2"] = float(c.area_damping)
    errors = dict(constants_error or {})
    priors = {name: Prior(known.pop(name), error) for name, error in errors.items() if name in known}
    return fit_trajectories(
        traces,
        "modal" if modal else "strict",
        fix=known,
        uncertain=uncertain,
        priors=priors | dict(options.pop("priors", {})),
        **options,
    )


def _channels(traces: Trace | Sequence[Trace]) -> tuple[str, ...]:
    first = traces if isinstance(traces, Trace) else traces[0]
    return tuple(first.channels)
