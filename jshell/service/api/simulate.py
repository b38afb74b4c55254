"""The short model at once; the simulator as a job."""

import math
from typing import Any

import numpy as np
from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from jshell.errors import Outcome
from jshell.oscillator import SOURCE, Coefficients, Decay, decay_by_law, decay_time
from jshell.service import reduced
from jshell.service.api.answers import Route, problem_responses
from jshell.service.api.jobs import IdempotencyKey, accepted
from jshell.service.jobs import simulator_specification
from jshell.service.replies import JobOut, SimulateOut, finite
from jshell.service.schemas import Conditions, SimulateRequest
from jshell.service.state import Here
from jshell.shell.parameters import Reduced

router = APIRouter(tags=["simulations"], route_class=Route)
ANSWERS = problem_responses(409, 429, made=(202,))
ANSWERS[200] = {"model": SimulateOut, "description": "What the short model says."}
ANSWERS[202] |= {"model": JobOut, "description": "Accepted: the simulator runs as a job."}


@router.post("/simulate", response_model=SimulateOut, responses=ANSWERS, summary="Simulate a shell")
def simulate(here: Here, asked: SimulateRequest, key: IdempotencyKey = None) -> Response:
    """Frequencies, softening and a trace of the short model at once; with `model: simulator` a job."""
    if asked.model == "simulator":
        response = accepted(here, here.store.submit("simulate", simulator_specification(asked), [], key))
        response.status_code = 202
        return response
    return JSONResponse(answered(asked))


def constants(asked: SimulateRequest) -> tuple[Coefficients, Decay]:
    """The constants asked for, and the decay they make; where none are, the source's, and the simulator's decay."""
    pick = lambda name: float(getattr(SOURCE, name)) if getattr(asked, name) is None else getattr(asked, name)  # noqa: E731
    masses = pick("alpha1"), pick("alpha2"), pick("k_vs")
    shell = conditions(asked)
    if asked.beta1 is not None:
        given = Coefficients(*masses, asked.beta1)
        return given, Decay(float(decay_time(given, shell.viscosity)), "given beta1")
    decay = decay_by_law(shell)
    if not math.isfinite(decay.tau):
        return Coefficients(*masses), decay
    return Coefficients.with_decay_time(*masses, decay.tau, shell.viscosity), decay


def conditions(asked: Conditions) -> Reduced:
    """The shell asked for."""
    return Reduced.from_dict(asked.shell())


def answered(asked: SimulateRequest) -> dict[str, Any]:
    """Fields of `SimulateOut`."""
    c, decay = constants(asked)
    found = reduced.answer(conditions(asked), c, asked.duration)
    listed = lambda values: finite(np.asarray(values, dtype=float).tolist())  # noqa: E731
    slow, fast, sphere, bubble = listed(found.omega)
    load, *drops = listed(found.softening)
    outcome, names = Outcome(int(found.outcome)), ("sphere", "omega_minus", "omega_plus", "marmottant")
    return {
        "outcome": outcome.word,
        "advice": outcome.advice,
        "omega_minus": slow,
        "omega_plus": fast,
        "omega_sphere": sphere,
        "omega_marmottant": bubble,
        "tau": finite(decay.tau),
        "decay": finite(decay.record()),
        "volume": listed(found.rest)[0],
        "pressure": listed(found.rest)[1],
        "softening": {"load": load, "slow": drops[0], "fast": drops[1], "marmottant": drops[2]},
        "crossing": {"P_ext": listed(found.loads), **dict(zip(names, map(listed, found.crossing), strict=True))},
        "trace": {"t": listed(found.times), "V": listed(found.motion[0]), "S": listed(found.motion[1])},
        "conditions": asked.shell(),
        "coefficients": {name: float(getattr(c, name)) for name in ("alpha1", "alpha2", "k_vs")}
        | {"beta1": None if math.isnan(decay.tau) else float(c.beta1)},
    }
