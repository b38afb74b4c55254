"""Many traces in one fit: which parameter belongs to which trace.

A constant may be shared by all traces or local to each; the conditions of a
trace (thickness, Young's modulus, pressures, viscosity) may be parameters too,
uncertain within a prior or free. Every trace is then a term of its own, put
together here from one list of parameters.

Symbols    E, d, P0, P_ext, η_f conditions in the units of the trace's nominal E d/R0
Valid for  fitted conditions: thickness in R0, youngs_modulus over its nominal value,
           pressures in nominal E d/R0, viscosity in nominal sqrt(E d ρ_f R0); since time is
           counted in sqrt(ρ_f R0³/(E d)), a stiffer wall makes the same record last longer
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.losses import TraceModel, bases, linear_residual, targets
from jshell.calibration.noise import whiten
from jshell.calibration.options import CONDITIONS, Prior, Tie
from jshell.calibration.parameters import Unknowns, check_parameters, unknowns
from jshell.calibration.records import Record
from jshell.errors import BadValue, choose
from jshell.shell.rest import RestState, buckled_state, gas_pressure

POSITIVE = frozenset({"alpha1", "alpha2", "beta1", "beta2", "tau", *CONDITIONS})


class Term(NamedTuple):
    """One trace: its constants in the model's order, and the model of its record alone."""

    constants: jax.Array
    model: TraceModel


class Problem(eqx.Module):
    """Several traces and the parameters they share.

    Attributes:
        model: The records and how they are compared.
        names: All parameters.
        places: Per record, where its constants stand among them.
        moved: Per record, conditions that are parameters, and where they stand.
        equilibrium: Where rest states come from, when conditions move.
        prior_at: Parameters with a prior.
        prior: (priors, 2) mean and standard error.
        memory: Per record, (channels, times) memory of its noise over the step to each sample; None is white.
    """

    model: TraceModel
    names: tuple[str, ...] = eqx.field(static=True)
    places: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    moved: tuple[tuple[tuple[str, int], ...], ...] = eqx.field(static=True)
    equilibrium: str = eqx.field(static=True, default="plateau")
    prior_at: tuple[int, ...] = eqx.field(static=True, default=())
    prior: np.ndarray | jax.Array = eqx.field(default_factory=lambda: np.zeros((0, 2)))
    memory: tuple[np.ndarray | jax.Array, ...] | None = None

    def terms(self, values: Float[Array | np.ndarray, " names"]) -> list[Term]:
        """Every trace with its own constants and, where they move, its own conditions."""
        found = []
        for record, places, moved in zip(self.model.records, self.places, self.moved, strict=True):
            record = (
                self._at(record, {field: jnp.asarray(values[place]) for field, place in moved}) if moved else record
            )
            whole = places == tuple(range(len(self.names)))  # one trace: as they stand
            constants = cast(jax.Array, values if whole else values[np.asarray(places)])
            found.append(Term(constants, eqx.tree_at(lambda p: p.records, self.model, (record,))))
        return found

    def own(self, number: int) -> np.ndarray:
        """Where the parameters of one trace stand among all: its constants, then its moving conditions."""
        return np.array([*self.places[number], *(at for _, at in self.moved[number])])

    def alone(self, number: int) -> "Problem":
        """The problem of one trace, without priors; its parameters are those at `own`."""
        constants = len(self.places[number])
        moved = tuple((field, constants + i) for i, (field, _) in enumerate(self.moved[number]))
        names = (*self.model.constants, *(field for field, _ in moved))
        model = eqx.tree_at(lambda p: p.records, self.model, (self.model.records[number],))
        return Problem(model, names, (tuple(range(constants)),), (moved,), self.equilibrium)

    def _at(self, record: Record, given: Mapping[str, jax.Array]) -> Record:
        """A record under other conditions."""
        c = record.conditions
        thickness = given.get("thickness", jnp.asarray(c.thickness))
        unit = given.get("youngs_modulus", jnp.asarray(1.0)) * thickness / c.thickness  # E d over its nominal value
        conditions = c.replace(
            thickness=thickness,
            gas_pressure=given.get("gas_pressure", c.gas_pressure) / unit,
            outer_pressure=given.get("outer_pressure", c.outer_pressure) / unit,
            viscosity=given.get("viscosity", c.viscosity) / jnp.sqrt(unit),
        )
        if self.equilibrium == "plateau":
            state = buckled_state(conditions)
        else:
            volume = record.state.volume
            state = RestState(volume, gas_pressure(volume, conditions))
        elapsed = record.elapsed * jnp.sqrt(unit)
        return Record(elapsed, record.data, record.weight, conditions, state, record.channels, record.uniform)

    def prior_residual(self, values: Float[Array | np.ndarray, " names"]) -> Float[Array, " priors"]:
        """How far parameters are from what was known of them, in standard errors."""
        return (values[jnp.asarray(self.prior_at, dtype=int)] - self.prior[:, 0]) / self.prior[:, 1]


def blocks(values: np.ndarray | jax.Array, problem: Problem) -> list[tuple[jax.Array, np.ndarray | jax.Array]]:
    """Basis (data, linear) and data (data,) of every block that shares linear parameters, weighted, memory out."""
    found = []
    for number, term in enumerate(problem.terms(values)):
        pairs = list(zip(bases(term.constants, term.model), targets(term.model), strict=True))
        if problem.memory is None:
            found += pairs
            continue
        rows = problem.memory[number]
        rows = rows[None] if len(pairs) == 1 else rows[:, None]  # strict: V and S in one block; modal: one each
        for row, (basis, data) in zip(rows, pairs, strict=True):
            both = jnp.concatenate([basis, data[:, None]], axis=1)
            size = row.shape[1]
            parts = [whiten(both[i * size : (i + 1) * size], m) for i, m in enumerate(row)]
            both = jnp.concatenate(parts)
            found.append((both[:, :-1], both[:, -1]))
    return found


def residual(u: jax.Array, args: tuple[Unknowns, Problem]) -> jax.Array:
    """Weighted residual with the best linear parameters, then that of the priors."""
    parameters, problem = args
    values = parameters.constrained(u)
    left = []
    for basis, data in blocks(values, problem):
        left.append(linear_residual(basis, data))
    return jnp.concatenate([*left, problem.prior_residual(values)] if problem.prior_at else left)


def join(
    model: TraceModel,
    *,
    local: Sequence[str] = (),
    uncertain: Mapping[str, float | None] | None = None,
    priors: Mapping[str, Prior] | None = None,
    equilibrium: str = "plateau",
) -> Problem:
    """Which parameters there are, and where each trace finds its own.

    Args:
        model: All records.
        local: Constants or conditions that each trace has of its own.
        uncertain: Conditions that are parameters: relative standard error, or None where nothing is known.
            Shared by traces of the same nominal value, unless `local`.
        priors: Of parameters, by name; without a number for all traces.
        equilibrium: Of moving conditions.

    Raises:
        BadName: No such constant or condition.
        BadValue: A relative error that is not above 0.
    """
    many = len(model.records)
    constants, uncertain = model.constants, dict(uncertain or {})
    local = tuple(local)
    for place, given, known in (
        ("local", local, (*constants, *uncertain)),
        ("uncertain", tuple(uncertain), CONDITIONS),
    ):
        for name in given:
            choose(place, name, known, noun="parameter")
    names: list[str] = []

    def place_of(name: str, own: bool, number: int) -> int:
        full = f"{name}[{number}]" if own and many > 1 else name
        if full not in names:
            names.append(full)
        return names.index(full)

    numbers = range(1, many + 1)
    columns = [[place_of(name, name in local or name == "tau", i) for i in numbers] for name in constants]
    known, moved = {}, [[] for _ in numbers]
    for name, relative in uncertain.items():
        nominal = [nominal_value(record, name) for record in model.records]
        own = name in local or max(nominal) - min(nominal) > 1e-12 * max(nominal)
        if relative is not None and not relative > 0:
            raise BadValue(
                f"uncertain[{name!r}]",
                found=f"{relative:g}",
                expected="a relative standard error above 0, or None",
                remedy="Leave the condition out if it is known exactly.",
            )
        for i in numbers:
            at = place_of(name, own, i)
            moved[i - 1].append((name, at))
            if relative is not None and nominal[i - 1] > 0:
                known[names[at]] = Prior(nominal[i - 1], relative * nominal[i - 1])
    known |= {
        name: _of_square(prior) if name.split("[")[0] in model.squared else prior
        for name, prior in spread("priors", dict(priors or {}), tuple(names)).items()
    }
    at = tuple(names.index(name) for name in known)
    rows = np.array([[float(p.mean), float(p.sigma)] for p in known.values()]).reshape(-1, 2)
    places = tuple(tuple(column[i] for column in columns) for i in range(many))
    return Problem(model, tuple(names), places, tuple(tuple(m) for m in moved), equilibrium, at, rows)


def _of_square(prior: Prior) -> Prior:
    """A prior of a parameter as one of its square."""
    return Prior(prior.mean**2, 2 * abs(prior.mean) * prior.sigma)


def nominal_value(record: Record, name: str) -> float:
    """The value of a condition that the trace came with."""
    return 1.0 if name == "youngs_modulus" else float(getattr(record.conditions, name))


def nominal_values(problem: Problem) -> dict[str, float]:
    """The same of every condition that is a parameter."""
    return {
        problem.names[at]: nominal_value(record, name)
        for record, moved in zip(problem.model.records, problem.moved, strict=True)
        for name, at in moved
    }


def parameters_of(
    problem: Problem,
    fix: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    tie: Mapping[str, str | Tie],
) -> Unknowns:
    """Which parameters of several traces are free; a name without a number means that of every trace."""
    base = {name: name.partition("[")[0] for name in problem.names}
    fixed, limits, tied = (
        spread(place, given, problem.names) for place, given in (("fix", fix), ("bounds", bounds), ("tie", tie))
    )
    positive = frozenset(name for name in problem.names if base[name] in POSITIVE)
    squared = frozenset(name for name in problem.names if base[name] in problem.model.squared)
    return unknowns(problem.names, positive, fixed, limits, tied, squared)


def spread(place: str, given: Mapping, names: tuple[str, ...]) -> dict:
    """A setting for `alpha1` as one for `alpha1[1]`, `alpha1[2]`, … where each trace has its own."""
    found = {}
    for name, value in given.items():
        own = [full for full in names if full.startswith(f"{name}[")]
        for full in own if name not in names and own else [name]:
            found[full] = value
    check_parameters(place, found, names)
    return found
