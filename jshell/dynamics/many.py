"""Many shells at once: a batch by vectorisation, spread over the devices there are.

Source     each device takes its share of the batch and never hears of the others
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, PartitionSpec

from jshell.dynamics.simulate import simulate
from jshell.errors import BadShape, BadValue
from jshell.shell.parameters import Reduced
from jshell.trace import Trace

NOT_IN_BATCHES = ("start", "displacement", "velocity", "checkpoint", "progress", "throw", "tolerance", "symmetry")


def simulate_many(conditions: Reduced, *, devices: Sequence | None = None, **options) -> Trace:
    """Simulate a batch of shells in one compiled program.

    Args:
        conditions: The problems; each field a number or (shells,).
        devices: Where to run; all devices of the default kind unless given. The batch is shared evenly.
        options: Those of `simulate`, the same for all; no start, checkpoint, progress, throw,
            tolerance or symmetry.

    Returns:
        A trace whose times, channels and outcome are (shells, …). A shell whose run ended early repeats its last
        good sample; the others are as they would be alone.

    Raises:
        BadShape: Fields of different lengths, or none of any.
        BadValue: An option that has no meaning for a batch.

    Example:
        >>> import jshell as js
        >>> import numpy as np
        >>> shells = js.Reduced(0.22, 0.9, np.array([1.6, 1.62]), 0.004)
        >>> js.dynamics.simulate_many(shells, duration=0.5, elements=16)["V"].shape
        (2, 11)
    """
    for name in NOT_IN_BATCHES:
        if name in options:
            raise BadValue(name, found="a batch", expected="a single run", remedy="Use `simulate` for this one.")
    fields = [jnp.asarray(field, dtype=float) for field in jax.tree.leaves(conditions)]
    sizes = {field.shape for field in fields if field.ndim}
    if len(sizes) != 1 or any(len(size) != 1 for size in sizes):
        raise BadShape(
            "conditions",
            found="fields of shapes " + ", ".join(str(field.shape) for field in fields),
            expected="numbers, or lists of one length",
            remedy="Give at least one field as a list.",
        )
    (count,) = sizes.pop()
    where = jax.devices() if devices is None else list(devices)
    share = -(-count // len(where))
    # the last shell fills up the last device's share
    rows = np.minimum(np.arange(share * len(where)), count - 1)
    filled = jax.tree.unflatten(
        jax.tree.structure(conditions), [jnp.broadcast_to(field, (count,))[rows] for field in fields]
    )
    try:
        spread = _program(tuple(where), tuple(sorted(options.items())))
    except TypeError:  # an option that cannot be told from others, like a pressure in arrays: a program of its own
        spread = _program.__wrapped__(tuple(where), tuple(sorted(options.items())))
    return jax.tree.map(lambda values: values[:count], spread(filled))


@lru_cache(maxsize=8)  # the same options again find their program compiled
def _program(devices: tuple, options: tuple[tuple[str, object], ...]) -> Callable[[Reduced], Trace]:
    """What simulates a batch, shared out over devices."""
    mesh = Mesh(np.array(devices), ("shells",))
    along = PartitionSpec("shells")
    one = lambda shell: simulate(shell, **dict(options))  # type: ignore[arg-type]  # noqa: E731
    # a CPU runs shells one after another, each as long as it needs; a GPU runs all of them in every step
    each = (lambda shells: jax.lax.map(one, shells)) if devices[0].platform == "cpu" else jax.vmap(one)
    return jax.jit(jax.shard_map(each, mesh=mesh, in_specs=along, out_specs=along, check_vma=False))
