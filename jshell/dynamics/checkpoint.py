"""A run kept in a file while it goes on, so that the same call can continue it.

The file holds arrays only. A fingerprint of everything the run is made of
tells whether it belongs to the call; a run is never continued under another
problem, and a file that is not such a run is never overwritten.

Source     arrays in NumPy's .npz, without pickles; replaced in one step, so that a kill leaves the old or the new
"""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.dynamics.run import RunState, Sample
from jshell.errors import BadFile


def fingerprint(parts) -> str:
    """A digest of all arrays, numbers and names in a tree."""
    digest = hashlib.sha256()
    leaves, structure = jax.tree.flatten(parts)
    for leaf in leaves:
        if eqx.is_array(leaf) or isinstance(leaf, np.ndarray | float | int | complex):
            array = np.asarray(leaf)
            digest.update(str((array.shape, array.dtype)).encode() + array.tobytes())
        else:
            digest.update(getattr(leaf, "__qualname__", repr(leaf)).encode())
    digest.update(repr([type(leaf).__name__ for leaf in leaves]).encode())
    digest.update(str(structure.num_leaves).encode())
    return digest.hexdigest()


@dataclass(frozen=True)
class Checkpoint:
    """The file of one run."""

    path: Path
    made_of: tuple

    def load(self, state: RunState, parts: list[Sample]) -> tuple[RunState, list[Sample], int]:
        """State, samples and their number as the file has them; as given where there is no file yet.

        Raises:
            BadFile: The file is no checkpoint, or that of another run.
        """
        if not self.path.exists():
            return state, parts, 0
        try:
            with np.load(self.path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
        except (OSError, ValueError, EOFError) as fault:
            raise BadFile(
                str(self.path),
                found="no readable checkpoint",
                expected="a file of this run",
                remedy="Name another file.",
            ) from fault
        if str(arrays.get("fingerprint")) != fingerprint(self.made_of):
            raise BadFile(
                str(self.path),
                found="the checkpoint of another run",
                expected="one of the same problem and options",
                remedy="Name another file, or repeat the call that began it.",
            )
        leaves, structure = jax.tree.flatten(state)
        state = jax.tree.unflatten(structure, [jnp.asarray(arrays[f"state_{k}"]) for k in range(len(leaves))])
        return state, [Sample(*(jnp.asarray(arrays[f"sample_{name}"]) for name in Sample._fields))], int(arrays["done"])

    def save(self, state: RunState, parts: list[Sample], done: int) -> None:
        """Replace the file by the run as it is now."""
        arrays = {f"state_{k}": np.asarray(leaf) for k, leaf in enumerate(jax.tree.leaves(state))}
        for name in Sample._fields:
            arrays[f"sample_{name}"] = np.concatenate([np.asarray(getattr(part, name)) for part in parts])
        arrays |= {"done": np.asarray(done), "fingerprint": np.asarray(fingerprint(self.made_of))}
        fresh = self.path.with_name(self.path.name + ".new")
        with fresh.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)
            stream.flush()
            os.fsync(stream.fileno())
        fresh.replace(self.path)
