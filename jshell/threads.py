"""One thread of linear algebra a process, asked for once.

A shell's matrices have about a hundred rows. OpenBLAS, which JAX calls on CPUs,
splits even these among all cores, and its threads then spin while they wait for
each other: on two busy cores a batch of 320 factorisations took 36 s of
processor time instead of 0.3 s. Worse, JAX hands the members of a batch to the
pool of threads that it already runs on, and waits there: where as many batched
factorisations run at a time as the pool has threads, which on two cores is two,
each waits for the others for ever.

So importing jshell asks for one thread of each, unless the user has decided
through the variables that the two libraries read. Many cores are used by
processes, each with work of its own.

Source     `jaxlib/cpu/lapack_kernels.cc`, ParallelBatchMap, for the wait
"""

import os

POOLS = ("PJRT_NPROC", "NPROC")  # XLA reads the first, or else the second, when it is first used
BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")  # OpenBLAS likewise, when SciPy's linear algebra is first loaded


def ask_for_one() -> None:
    """Set the variables where the user has not; of use before the libraries are first called."""
    for names in (POOLS, BLAS):
        if not any(name in os.environ for name in names):
            os.environ[names[0]] = "1"
