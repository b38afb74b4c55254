"""Linear algebra takes one thread unless the user says otherwise."""

import os
import subprocess
import sys

import pytest

from jshell.threads import BLAS, POOLS

# batched factorisations large enough for JAX to share them out, several of them at a time
WORK = """
import os
import jshell
import jax, jax.numpy as jnp

def some(key):
    keys = [jax.random.fold_in(key, k) for k in range(6)]
    return sum(jnp.linalg.slogdet(jax.random.normal(key, (96, 96)))[1] for key in keys)

many = jax.jit(jax.vmap(some))
keys = jax.random.split(jax.random.PRNGKey(0), 16)
for _ in range(30):
    many(keys).block_until_ready()
busy = []
for task in os.listdir("/proc/self/task"):
    name = open(f"/proc/self/task/{task}/comm").read().strip()
    fields = open(f"/proc/self/task/{task}/stat").read().rsplit(")", 1)[1].split()
    if name == "tf_XLAEigen" and int(fields[11]) + int(fields[12]) > 2:
        busy.append(task)
print(os.environ["PJRT_NPROC"], os.environ["OPENBLAS_NUM_THREADS"], len(busy))
"""


def _run(**given: str) -> list[str]:
    clean = {name: value for name, value in os.environ.items() if name not in (*POOLS, *BLAS)}
    done = subprocess.run(
        [sys.executable, "-c", WORK], env=clean | given, capture_output=True, text=True, timeout=120, check=True
    )
    return done.stdout.split()


@pytest.mark.long
@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted where Linux lists them")
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has one thread")
def test_a_batch_of_factorisations_is_not_shared_out():
    threads, blas, busy = _run()
    assert (threads, blas) == ("1", "1")
    assert int(busy) <= 1


@pytest.mark.long
@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted where Linux lists them")
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has one thread")
def test_what_the_user_set_stays():
    threads, blas, busy = _run(PJRT_NPROC="3", OPENBLAS_NUM_THREADS="2")
    assert (threads, blas) == ("3", "2")
    assert int(busy) > 1
