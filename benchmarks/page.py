"""How soon the page's simulator shows what a slider asks for: one user, eight users, the exact liquid after.

Starts `jshell serve` as a user does and asks what the page asks when a slider moves: the shape with its modes, and the
short model's numbers, at once. Every user moves on as soon as both have come. Prints a table in Markdown:

    .venv/bin/python benchmarks/page.py [MOVES]      by default 200 moves a user

Wall times mean something on a quiet machine only; the processor time of the service a move is printed beside them, and
the load. Ends with 1 where a wall time is above its limit and the machine was quiet.
"""

import os
import sys
import threading
import time
from urllib.parse import urlencode

import httpx
import numpy as np
import psutil
from serving import served

MOVES, USERS, EXACT = 200, 8, 12
QUIET = 2.0  # load average beyond which wall times say nothing
LIMITS = {"one user": 150.0, "eight users": 600.0, "exact liquid and stability": 3000.0}  # [ms], p95
RANGES = {"d_hat": (0.05, 0.3), "P0_hat": (0.5, 2.0), "Pext_hat": (1.0, 2.5), "eta_hat": (0.0, 0.02)}


def walk(user: int, moves: int) -> list[str]:
    """Questions of one who moves a slider at a time, by some steps each."""
    draw = np.random.default_rng(user)
    at = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.62, "eta_hat": 0.004}
    asked = []
    for _ in range(moves):
        name = draw.choice(list(RANGES))
        low, high = RANGES[name]
        at[name] = float(np.clip(at[name] + draw.normal(0.0, 0.05) * (high - low), low, high))
        asked.append(urlencode({key: f"{value:.4f}" for key, value in at.items()}))
    return asked


def moved(address: str, questions: list[str]) -> list[float]:
    """Milliseconds from each move to its shape and modes, the short model's numbers asked for beside."""
    spent = []
    client = lambda: httpx.Client(base_url=address, timeout=60, trust_env=False)  # noqa: E731
    with client() as shape, client() as short:
        for question in questions:
            beside = threading.Thread(target=lambda q=question: short.get(f"/simulate?{q}").raise_for_status())
            begun = time.perf_counter()
            beside.start()
            answer = shape.get(f"/simulate/shape?{question}")
            spent.append(1e3 * (time.perf_counter() - begun))
            answer.raise_for_status()
            beside.join()
    return spent


def together(address: str, users: int, moves: int) -> list[float]:
    """The same for several at once."""
    spent: list[float] = []
    ask = lambda user: spent.extend(moved(address, walk(user, moves)))  # noqa: E731
    threads = [threading.Thread(target=ask, args=(user,)) for user in range(users)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if len(spent) != users * moves:
        raise RuntimeError("a user was refused")
    return spent


def exactly(address: str, moves: int) -> list[float]:
    """What follows when the sliders rest."""
    spent = []
    with httpx.Client(base_url=address, timeout=120, trust_env=False) as client:
        for question in walk(100, moves):
            begun = time.perf_counter()
            client.get(f"/simulate/exact?{question}").raise_for_status()
            spent.append(1e3 * (time.perf_counter() - begun))
    return spent


def compiled(address: str) -> None:
    """Wait until both programs are there; until then whoever asks is told to come again."""
    with httpx.Client(base_url=address, timeout=600, trust_env=False) as client:
        for what in ("", "/shape", "/exact"):
            while client.get(f"/simulate{what}").status_code == 429:
                time.sleep(1.0)


def processor() -> float:
    """Seconds that this process's children have computed, theirs included."""
    mine = psutil.Process().children(recursive=True)
    return sum(sum(one.cpu_times()[:2]) for one in mine)


def main(moves: int) -> int:
    late = False
    print("| what | answers | median [ms] | p95 [ms] | asked [ms] | processor time each [ms] | load |")
    print("|---|---|---|---|---|---|---|")
    with served() as address:
        compiled(address)
        rows = {
            "one user": lambda: moved(address, walk(0, moves)),
            "eight users": lambda: together(address, USERS, max(1, moves // 2)),
            "exact liquid and stability": lambda: exactly(address, EXACT),
        }
        for name, measure in rows.items():
            before = processor()
            spent = measure()
            each, load = 1e3 * (processor() - before) / len(spent), os.getloadavg()[0]
            middle, high = np.quantile(spent, [0.5, 0.95])
            late |= high > LIMITS[name] and load < QUIET + (USERS if name == "eight users" else 1)
            row = (
                f"| {name} | {len(spent)} | {middle:.0f} | {high:.0f} | {LIMITS[name]:.0f} | {each:.0f} | {load:.1f} |"
            )
            print(row, flush=True)
    return int(late)


if __name__ == "__main__":
    raise SystemExit(main(int(sys.argv[1]) if len(sys.argv) > 1 else MOVES))
