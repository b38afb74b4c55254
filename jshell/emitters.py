"""XLA's older loops for the CPU, asked for once.

XLA has two ways to turn a fused loop into code for a CPU: its elder writes the
code itself, the newer, its fusion emitters, goes through a compiler of its own
for each loop. A shell's programs are thousands of small loops, and most of what
a user waits for at first is compiling: the program of a run in time takes 19 s
of processor time by the elder and 30 s by the newer, and runs no slower.

So importing jshell asks for the elder, unless the user's `XLA_FLAGS` speak of
it, and only of a jaxlib that is known to have the choice: XLA ends the process
at a flag that it does not know. A GPU's programs are not touched.

Source     XLA: `xla_cpu_use_fusion_emitters` in debug_options_flags.cc; their cost: openxla/xla issue 41173
"""

import os
from importlib import metadata

VARIABLE = "XLA_FLAGS"  # XLA reads it when its first device is asked for
FLAG = "--xla_cpu_use_fusion_emitters"
KNOWN = ("0.10.",)  # jaxlib versions that have been seen to take the flag


def ask_for_the_elder() -> None:
    """Set the flag where the user has not; of use before JAX compiles its first program."""
    given = os.environ.get(VARIABLE, "")
    if FLAG not in given and _version().startswith(KNOWN):
        os.environ[VARIABLE] = f"{given} {FLAG}=false".strip()


def _version() -> str:
    """That of jaxlib, without loading it; empty where there is none."""
    try:
        return metadata.version("jaxlib")
    except metadata.PackageNotFoundError:
        return ""
