"""What a fit may change: free, fixed, bounded and tied parameters, and what is known of them beforehand.

Masses and damping are positive, so the solver sees their logarithms. Where a
model knows the coupling only through its square, the square is what the model
and the solver see. Results, bounds, ties and errors are always of the parameter itself.
A tied parameter is a function of the others; its error follows by the delta method.

Symbols    u what the solver sees   values what the model sees   reported the parameters themselves
"""

import ast
import operator
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.options import Tie
from jshell.errors import BadValue, choose

_OPERATIONS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
SMALLEST, LARGEST = 1e-12, 1e12  # sizes of a parameter: far beyond, a square or a quotient is no number any more
MAY_VANISH = frozenset({"beta1", "beta2", "viscosity"})  # of the positive ones: a shell without damping
_TRIES = 12  # of a tie
_FUNCTIONS = {"sqrt": jnp.sqrt, "exp": jnp.exp, "log": jnp.log}


@dataclass(frozen=True)
class Expression:
    """A tie written as arithmetic of other parameters: `0.3*alpha1`, `beta1[1]`, `sqrt(alpha2)`.

    Raises:
        BadValue: Anything but numbers, parameters, + - * / ** and sqrt, exp, log.
    """

    text: str

    def __post_init__(self) -> None:
        try:
            tree = ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._refused(repr(self.text)) from None
        self._names(tree)

    def __call__(self, known: Mapping[str, jax.Array]) -> jax.Array:
        try:
            return jnp.asarray(self._value(ast.parse(self.text.strip(), mode="eval").body, known), dtype=float)
        except (ArithmeticError, RecursionError, TypeError):  # of its numbers alone: 1/0, 9**9**9, (-8)**0.5
            raise self._refused(f"{self.text[:60]!r}, which has no value") from None

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters it reads."""
        return tuple(dict.fromkeys(self._names(ast.parse(self.text.strip(), mode="eval").body)))

    def _names(self, node: ast.expr) -> list[str]:
        match node:
            case ast.Constant(value=int() | float()):
                return []
            case ast.Name(id=name):
                return [name]
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int(number))):
                return [f"{name}[{number}]"]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS:
                return self._names(left) + self._names(right)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._names(operand)
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in _FUNCTIONS:
                return self._names(argument)
        raise self._refused(f"{ast.unparse(node)!r} in {self.text!r}")

    def _value(self, node: ast.expr, known: Mapping[str, jax.Array]):
        match node:
            case ast.Constant(value=int() | float() as value):
                return float(value)
            case ast.BinOp(left=left, op=op, right=right):
                return _OPERATIONS[type(op)](self._value(left, known), self._value(right, known))
            case ast.UnaryOp(operand=operand):
                return -self._value(operand, known)
            case ast.Call(func=ast.Name(id=name), args=[argument]):
                return _FUNCTIONS[name](jnp.asarray(self._value(argument, known)))
        return known[self._names(node)[0]]

    def _refused(self, found: str) -> BadValue:
        return BadValue(
            "tie",
            found=found,
            expected="arithmetic of numbers and parameters with + - * / ** sqrt exp log",
            remedy='Write e.g. tie={"alpha2": "0.3*alpha1"}, or give a function of a mapping.',
        )


class Unknowns(eqx.Module):
    """The parameters of a model, and which of them are free.

    Attributes:
        names: All parameters, in the model's order.
        free: Those the solver changes.
        positive: Those it changes through their logarithm.
        fixed: (names,) values of the fixed ones; ignored where free or tied.
        low: (free,) lower bounds, as the solver sees them.
        high: (free,) upper bounds, as the solver sees them.
        tied: Parameters that follow from others, in the order in which they are worked out.
        squared: Those that the model sees as their square.
        negative: Those of them that are known to be negative; the others are reported positive.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    free: tuple[str, ...] = eqx.field(static=True)
    positive: frozenset[str] = eqx.field(static=True)
    fixed: np.ndarray | jax.Array
    low: np.ndarray | jax.Array
    high: np.ndarray | jax.Array
    tied: tuple[tuple[str, Tie], ...] = eqx.field(static=True, default=())
    squared: frozenset[str] = eqx.field(static=True, default=frozenset())
    negative: frozenset[str] = eqx.field(static=True, default=frozenset())

    def constrained(self, unknowns: Float[Array | np.ndarray, " free"]) -> Any:
        """All values (names,), from what the solver sees; of NumPy where that is given and nothing is tied."""
        numbers = np if isinstance(unknowns, np.ndarray) else jnp
        values = []
        for i, name in enumerate(self.names):
            if name not in self.free:
                values.append(numbers.asarray(self.fixed[i], dtype=float))
            else:
                u = unknowns[self.free.index(name)]
                values.append(numbers.exp(u) if name in self.positive else u)
        return self.complete(numbers.stack(values))

    def complete(self, values: Float[Array | np.ndarray, " names"]) -> Any:
        """All values (names,) with the tied ones worked out from the others."""
        for name, tie in self.tied:
            values = jnp.asarray(values)
            value = jnp.asarray(tie(self._known(values)), dtype=float).reshape(())
            values = values.at[self.names.index(name)].set(value**2 if name in self.squared else value)
        return values

    def _known(self, values: Any) -> dict[str, Any]:
        """Parameters by name, as a tie reads them."""
        # a root has no derivative at 0: there a tie follows the parameter no further
        root = lambda name, value: self._sign(name) * jnp.sqrt(jnp.maximum(value, 1e-300))  # noqa: E731
        return {
            name: root(name, value) if name in self.squared else value
            for name, value in zip(self.names, values, strict=True)
        }

    def _sign(self, name: str) -> float:
        return -1.0 if name in self.negative else 1.0

    def reported(self, values: np.ndarray) -> np.ndarray:
        """(names,) parameters themselves, from what the model sees."""
        shown = np.array(values, dtype=float)
        for i, name in enumerate(self.names):
            if name in self.squared:
                shown[i] = self._sign(name) * np.sqrt(max(shown[i], 0.0))
        for name, tie in self.tied:
            if name in self.squared:  # its tie knows its sign
                shown[self.names.index(name)] = float(tie({k: jnp.asarray(v) for k, v in self._table(shown)}))
        return shown

    def _table(self, shown: np.ndarray) -> list[tuple[str, float]]:
        return list(zip(self.names, shown.tolist(), strict=True))

    def stretch(self, reported: np.ndarray) -> np.ndarray:
        """(names,) how what the model sees follows the parameters themselves."""
        return np.array([2 * x if name in self.squared else 1.0 for name, x in self._table(np.asarray(reported))])

    def shown(self, u: np.ndarray) -> np.ndarray:
        """(..., free) free parameters themselves, from what the solver sees."""
        columns = []
        for i, name in enumerate(self.free):
            value = np.exp(u[..., i]) if name in self.positive else u[..., i]
            columns.append(self._sign(name) * np.sqrt(np.maximum(value, 0.0)) if name in self.squared else value)
        return np.stack(columns, axis=-1)

    def unconstrained_value(self, name: str, value: float) -> float:
        """What the solver sees of a free parameter."""
        value = value**2 if name in self.squared else value
        return float(np.log(value)) if name in self.positive else float(value)

    def unconstrained(self, constrained: np.ndarray) -> np.ndarray:
        """What the solver sees, (starts, free), of (starts, names) values of the model; kept inside the bounds."""
        columns = []
        for name in self.free:
            values = constrained[:, self.names.index(name)]
            columns.append(np.log(np.maximum(values, 1e-12)) if name in self.positive else values)
        return np.clip(np.stack(columns, axis=1), self.low, self.high)

    def slopes(self, values: np.ndarray) -> np.ndarray:
        """(names, free) how all values follow the free ones, both as the model sees them."""
        at = [self.names.index(name) for name in self.free]
        plain = np.eye(len(self.names))[:, at]
        if not self.tied:
            return plain
        move = lambda free: self.complete(jnp.asarray(values).at[jnp.asarray(at)].set(free))  # noqa: E731
        return np.asarray(jax.jacfwd(move)(jnp.asarray(values)[jnp.asarray(at)]))


def unknowns(
    names: tuple[str, ...],
    positive: frozenset[str],
    fix: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    tie: Mapping[str, str | Tie] | None = None,
    squared: frozenset[str] = frozenset(),
) -> Unknowns:
    """The parameters of a model, some fixed, some bounded, some tied.

    Args:
        names: All parameters.
        positive: Those that cannot be negative.
        fix: Values of the fixed ones.
        bounds: Lowest and highest value of any free one.
        tie: Functions of the others, as arithmetic or as a function of a mapping from name to value.
        squared: Those that the model sees as their square. Their sign is that of their value or bounds, else positive.

    Raises:
        BadName: A parameter that the model does not have.
        BadValue: Nothing left free; a value or a bound that the parameter cannot take; a tie to itself.
    """
    fix, bounds, tie = dict(fix or {}), dict(bounds or {}), dict(tie or {})
    for place, given in (("fix", fix), ("bounds", bounds), ("tie", tie)):
        check_parameters(place, given, names)
    for name in tie:
        if name in fix or name in bounds:
            raise BadValue(
                f"tie[{name!r}]",
                found="also fixed or bounded",
                expected="one of the three",
                remedy="A tied parameter has no value or bound of its own.",
            )
    free = tuple(name for name in names if name not in fix and name not in tie)
    if not free:
        raise BadValue(
            "fix",
            found="every parameter fixed: " + ", ".join(f"{k} = {v:g}" for k, v in fix.items()),
            expected="at least one of " + ", ".join(names) + " free",
            remedy="Leave one out of `fix`.",
        )
    for name, value in fix.items():
        check_value(f"fix[{name!r}]", name, value, positive=name in positive)
    ties = _in_order(names, tie)
    for name, given in ties:
        if isinstance(given, Expression):
            _check_tie(name, given, positive=name in positive)

    low, high, negative = [], [], {name for name in squared if fix.get(name, 0.0) < 0}
    for name in free:
        least, most = bounds.get(name, (-np.inf, np.inf))
        if not least < most or least >= LARGEST or most <= (SMALLEST if name in positive else -LARGEST):
            raise BadValue(
                f"bounds[{name!r}]",
                found=f"({least:g}, {most:g})",
                expected="lowest < highest, and room above 0 for a positive parameter, at sizes of "
                f"{SMALLEST:g} to {LARGEST:g}",
                remedy="Check the order.",
            )
        least, most = -np.inf if least < -LARGEST else least, np.inf if most > LARGEST else most
        if name in positive:
            least, most = (np.log(least) if least > 0 else -np.inf), np.log(most)
        if name in squared:
            if most <= 0:
                negative.add(name)
            # an interval that holds 0 holds the square 0
            least, most = (0.0 if least <= 0 <= most else min(least**2, most**2)), max(least**2, most**2)
        low.append(least)
        high.append(most)
    fixed = np.array([float(fix.get(name, 1.0)) ** (2 if name in squared else 1) for name in names])
    ends = np.array(low), np.array(high)
    return Unknowns(names, free, positive, fixed, *ends, ties, squared, frozenset(negative))


def check_value(place: str, name: str, value: float, *, positive: bool) -> None:
    """Refuse a value that a parameter cannot have.

    Raises:
        BadValue: Not finite, of no bearable size, or not above 0 where it must be.
    """
    if not _can_be(name, value, positive):
        zero = "0, or " if positive and _base(name) in MAY_VANISH else ""
        low = SMALLEST if positive else -LARGEST
        expected = f"{zero}{low:g} to {LARGEST:g} for {name}"
        raise BadValue(place, found=f"{value:g}", expected=expected, remedy="Check sign and unit.")


def _base(name: str) -> str:
    return name.partition("[")[0]


def _can_be(name: str, value: float, positive: bool) -> bool:
    low = SMALLEST if positive else -LARGEST
    return low <= value <= LARGEST or (value == 0 and _base(name) in MAY_VANISH)


def _check_tie(name: str, tie: Expression, *, positive: bool) -> None:
    """Refuse a tie that gives its parameter, whatever the others are, no value that it can have."""
    random = np.random.default_rng(0)
    for _ in range(_TRIES):
        sizes = np.exp(random.uniform(-2.5, 2.5, len(tie.names)))
        known = {
            one: jnp.asarray(size if _base(one) != "k_vs" or random.random() < 0.5 else -size)
            for one, size in zip(tie.names, sizes, strict=True)
        }
        value = float(tie(known))
        if _can_be(name, value, positive):
            return
    check_value(f"tie[{name!r}], {tie.text[:60]}", name, value, positive=positive)


def check_parameters(place: str, given: Iterable[str], names: tuple[str, ...]) -> None:
    """Refuse a parameter that the model does not have.

    Raises:
        BadName: Naming it.
    """
    for name in given:
        remedy = "Check the spelling; a parameter of one trace is written name[number]."
        choose(f"{place}, parameter", name, names, remedy=remedy)


def _in_order(names: tuple[str, ...], tie: Mapping[str, str | Tie]) -> tuple[tuple[str, Tie], ...]:
    """Ties so ordered that each reads only what is worked out before it."""
    ordered: list[tuple[str, Tie]] = []
    waiting = {name: Expression(given) if isinstance(given, str) else given for name, given in tie.items()}
    for name, given in waiting.items():
        for read in given.names if isinstance(given, Expression) else ():
            choose(f"tie[{name!r}], parameter", read, names, remedy="Check the spelling.")
    while waiting:
        open_ = [n for n, g in waiting.items() if not isinstance(g, Expression) or not set(g.names) & set(waiting)]
        if not open_:
            raise BadValue(
                "tie",
                found="a circle: " + ", ".join(waiting),
                expected="ties that end at free or fixed parameters",
                remedy="Free one of them.",
            )
        ordered += [(name, waiting.pop(name)) for name in open_]
    return tuple(ordered)
