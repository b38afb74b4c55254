# ruff: noqa: E402  (the folder of compiled programs is chosen before JAX is imported)
"""House rules of every test: float64, no silent rank promotion; and what many tests share.

Compiling costs more than running here, so shapes and modes that several rooms
need are computed once a session, problems are made of arrays (a number that is
a Python float is compiled in, an array is not), and what was compiled is kept
in a folder beside `.venv`: for the other worker, for the processes that tests
start, and for the next time.
"""

import gc
import json
import os
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]

if "JAX_COMPILATION_CACHE_DIR" not in os.environ:  # workers and the processes that tests start inherit it
    os.environ["JSHELL_PROGRAM_CACHE"] = "off"  # jshell's own folder is the user's
    from jshell import programs

    folder = ROOT / ".programs" / programs.processor()
    folder.mkdir(parents=True, exist_ok=True)
    programs.trim(folder, programs.LIMIT)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder)
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")
    del os.environ["JSHELL_PROGRAM_CACHE"]
    if "jax" in sys.modules:  # a plugin has imported it, and it has read the environment
        sys.modules["jax"].config.update("jax_compilation_cache_dir", str(folder))
        least = float(os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"])
        sys.modules["jax"].config.update("jax_persistent_cache_min_compile_time_secs", least)

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jshell  # noqa: F401  (asks for float64)
from jshell import Reduced, dynamics, membrane
from jshell.contour import meridian
from jshell.flow import flow, slip_matrix

jax.config.update("jax_numpy_rank_promotion", "raise")

ELEMENTS = 24
REFERENCE = Path(__file__).parent / "data" / "reference"


APART = {"chromium", "cluster"}  # fixtures that need a browser, a database server


@pytest.hookimpl(tryfirst=True)  # before the choice by marks
def pytest_collection_modifyitems(items) -> None:
    """Mark what `make test` leaves to `make test-apart`."""
    for item in items:
        url = getattr(getattr(item, "callspec", None), "params", {}).get("url")
        needs = APART & set(getattr(item, "fixturenames", ()))
        if needs or url == "postgresql" or item.path.parent.name == "notebooks":
            item.add_marker("apart")


def problem(thickness, gas_pressure, outer_pressure, viscosity=0.0) -> Reduced:
    """A problem whose numbers are arrays, scalar or batched alike."""
    numbers = jnp.broadcast_arrays(
        *(jnp.asarray(n, float) for n in (thickness, gas_pressure, outer_pressure, viscosity))
    )
    like = jnp.zeros_like(numbers[0])
    return Reduced(*numbers, like + 1.4, like + 0.5)


MAPPINGS = 30_000  # compiled programs map memory; Linux kills a process at 65 530 mappings


@pytest.fixture(scope="module", autouse=True)
def _room_for_programs():
    """Forget compiled programs between modules before there are too many to map."""
    yield
    maps = Path("/proc/self/maps")
    if maps.exists() and maps.read_text().count("\n") > MAPPINGS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(scope="session")
def make_problem():
    return problem


@pytest.fixture(scope="session")
def R() -> Reduced:
    """The source's reference configuration."""
    return problem(0.22, 0.9, 1.6, 0.004)


@pytest.fixture(scope="session")
def cases() -> list[dict]:
    """Rest shapes and modes of four shells by two other codes."""
    return json.loads((REFERENCE / "modes.json").read_text())["cases"]


@pytest.fixture(scope="session")
def viscous() -> dict:
    """Small vibrations in a viscous liquid by another code, at several viscosities."""
    return json.loads((REFERENCE / "viscous.json").read_text())


@pytest.fixture(scope="session")
def mesh():
    """The meridian that most tests use."""
    return meridian(ELEMENTS)


@pytest.fixture(scope="session")
def rest_R(R):
    return membrane.rest(R, elements=ELEMENTS)


@pytest.fixture(scope="session")
def modes_R(R):
    """In the exact liquid."""
    return dynamics.modes(R, elements=ELEMENTS)


@pytest.fixture(scope="session")
def layered_R(R):
    """In a Stokes layer of first order."""
    return dynamics.modes(R, elements=ELEMENTS, liquid="layer")


@pytest.fixture(scope="session")
def undamped_R(R):
    return dynamics.modes(R, elements=ELEMENTS, liquid="ideal")


@pytest.fixture(scope="session")
def liquid():
    """Compiled: added mass and slip matrix of a shape."""

    @jax.jit
    def matrices(shape, q):
        current = flow(shape, q)
        return current.mass, slip_matrix(shape, current)

    return matrices


@pytest.fixture(scope="session")
def solid():
    """Compiled: stiffness of a shape in whichever elastic energy."""
    return eqx.filter_jit(membrane.stiffness)


H = 1e-4  # step of central differences: their error is H² times a third derivative, 1e-8
VARIED = ("thickness", "gas_pressure", "outer_pressure", "viscosity")


class Family(NamedTuple):
    """Modes of many shells in one compiled batch, and the row where each kind stands."""

    modes: dynamics.Modes
    cases: slice
    no_buckled_state: int
    weak_gas: int

    def difference(self, pick, name: str):
        """Central difference of a quantity at R with respect to a condition."""
        k = 6 + 2 * VARIED.index(name)
        values = pick(self.modes)
        return (values[k] - values[k + 1]) / (2 * H * AT_R[name])


AT_R = {"thickness": 0.22, "gas_pressure": 0.9, "outer_pressure": 1.6, "viscosity": 0.004}


@pytest.fixture(scope="session")
def family(cases) -> Family:
    rows = [[case["d"], case["P0"], case["Pext"], case["eta"]] for case in cases]
    rows += [[0.22, 0.9, 1.1, 0.004], [0.22, 0.1, 1.1, 0.004]]
    for name in VARIED:
        for sign in (1, -1):
            rows.append([value * (1 + sign * H * (key == name)) for key, value in AT_R.items()])
    batch = lambda conditions: dynamics.modes(conditions, elements=ELEMENTS, liquid="layer")  # noqa: E731
    many = eqx.filter_jit(eqx.filter_vmap(batch))
    return Family(many(problem(*np.array(rows).T)), slice(0, 4), 4, 5)


@pytest.fixture(scope="session")
def slopes(R) -> dict[str, Reduced]:
    """Forward derivatives at R of volume, first frequency and first decay time in a Stokes layer by the conditions."""

    def numbers(conditions):
        found = dynamics.modes(conditions, elements=ELEMENTS, liquid="layer")
        return {"volume": found.rest.volume, "omega": found.omega[0], "tau": found.tau[0]}

    return jax.jit(jax.jacfwd(numbers))(R)
