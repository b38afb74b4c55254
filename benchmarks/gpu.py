"""What a GPU is worth: fits, modes and traces in batches, against the same machine's CPU, in one run.

Each measurement is a process of its own, pinned to one core, so that one that fails or takes too long costs only its
own rows. Compiling goes on side by side; what is timed on the GPU holds a lock, so that nothing else computes there.
Rows appear as they come, as JSON lines; at the end the numbers of both are compared and a table is written:

    python benchmarks/gpu.py --limit 480 --table table.md --log rows.jsonl
    python benchmarks/gpu.py --small                        # a machine without a GPU: few sizes, "not run" beside them

Needs jshell on the path and nothing that `pip install jshell` does not bring, but a JAX that sees the GPU.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from gpu_rows import DURATION, ELEMENTS, TRACED

LARGE = {
    "fits": (100, 10_000, 1_000_000), "settled": (10_000,),
    "second": (1, 16, 256, 4096), "exact": (16,), "traces": (1, 16, 256),
}  # fmt: skip
SMALL = {"fits": (100, 1_000), "settled": (100,), "second": (1, 4), "exact": (1,), "traces": (1, 2)}
# A user's fit ends where its next step promises less than 1e-4 standard errors, and rounding decides who takes one
# more. Searched to their ends they agree but for rounding, which is several times what the last bit of the data does
# to them on one device (`own`).
TOLERANCE = {"fits": 1e-3, "settled": 1e-6, "second": 1e-9, "exact": 1e-9, "traces": 1e-9}
FITS = ("fits", "settled")
WORDS = {
    "fits": "`fit_batch`, 400 samples of V and S, noise tested",
    "settled": "the same, every search to its end",
    "second": f'rest shape and four modes, `liquid="second"`, {ELEMENTS} elements',
    "exact": f'the same, `liquid="exact"`, {ELEMENTS} elements',
    "traces": f"traces to t = {DURATION:g}, {TRACED} elements, 420 steps",
    "eigenvalues": "damped modes of the short model (`oscillator.damped_modes`)",
}
CHILD = Path(__file__).with_name("gpu_rows.py")


class Job:
    """A process that measures on one platform, pinned to one core."""

    def __init__(self, kind, counts, on, folder, core=None, begin=0):
        self.kind, self.counts, self.on, self.folder, self.core, self.begin = kind, counts, on, folder, core, begin
        self.rows: list[dict] = []
        self.reason = ""

    def start(self, core: int) -> None:
        self.core = core
        cpu = self.on.startswith("cpu")
        environment = {
            **os.environ, "JAX_PLATFORMS": "cpu" if cpu else "cuda,cpu", "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
            "JSHELL_PROGRAM_CACHE": "off", "PYTHONUNBUFFERED": "1", "PJRT_NPROC": "1" if cpu else "4",
        }  # fmt: skip
        command = [sys.executable, str(CHILD), self.kind, "--on", self.on, "--folder", str(self.folder)]
        command += ["--begin", str(self.begin), "--counts", *map(str, self.counts)]
        self.out = self.folder / f"{self.kind}-{self.counts[0]}-{self.on}-{self.begin}.log"
        keep = lambda: os.sched_setaffinity(0, {core}) if cpu else None  # noqa: E731
        with open(self.out, "w") as out:
            self.process = subprocess.Popen(command, stdout=out, stderr=out, env=environment, preexec_fn=keep)
        self.began = time.monotonic()

    def poll(self, log) -> bool:
        """Tell new rows; whether it has ended."""
        ended = self.process.poll() is not None
        lines = self.out.read_text(errors="replace").splitlines()
        rows = [json.loads(line[4:]) for line in lines if line.startswith("ROW ") and line.endswith("}")]
        for row in rows[len(self.rows) :]:
            log(row)
        self.rows = rows
        if ended and self.process.returncode and not self.reason:
            told = [line for line in lines if line.strip() and not line.startswith("ROW ")]
            self.reason = (told[-1] if told else f"exit {self.process.returncode}")[:300]
        return ended

    def kill(self, why: str) -> None:
        self.process.kill()
        self.process.wait()
        self.reason = why


def together(jobs: list[Job], cores: list[int], until: float, log) -> None:
    """Run jobs on the cores there are, in their order, until they have ended or time is up."""
    waiting, running, free = list(jobs), [], list(cores)
    while waiting or running:
        while waiting and free and time.monotonic() < until:
            job = waiting.pop(0)
            job.start(free.pop(0))
            running.append(job)
        for job in list(running):
            ended = job.poll(log)
            if not ended and time.monotonic() > until:
                job.kill("time was up")
                job.poll(log)
                ended = True
            if ended:
                running.remove(job)
                free.append(job.core)
                if job.reason:
                    log({"kind": job.kind, "counts": job.counts, "on": job.on, "failed": job.reason})
        if time.monotonic() > until and not running:
            for job in waiting:
                job.reason = "time was up before it began"
                log({"kind": job.kind, "counts": job.counts, "on": job.on, "failed": job.reason})
            return
        time.sleep(0.2)


def has_gpu() -> str:
    """The GPU that JAX sees, or nothing."""
    ask = "import jax; d = jax.devices()[0]; print('GPU:' + d.device_kind if d.platform != 'cpu' else '')"
    try:
        told = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, timeout=90).stdout
    except subprocess.TimeoutExpired:
        return ""
    return next((line[4:] for line in told.splitlines() if line.startswith("GPU:")), "")


def compared(kind: str, count: int, folder: Path) -> dict | None:
    """How far the GPU's numbers are from the CPU's, in the measure of each kind; None unless both are there."""
    import numpy as np

    files = [folder / f"{kind}-{count}-{on}-0.npz" for on in ("gpu", "cpu")]
    if not all(file.exists() for file in files):
        return None
    gpu, cpu = (dict(np.load(file)) for file in files)
    a, b = gpu["values"], cpu["values"]
    if kind in FITS:
        good = (gpu["outcome"] == 0) & (cpu["outcome"] == 0)
        apart = np.max(np.abs(a - b)[good] / cpu["stderr"][good], axis=1)
        more = {
            "beyond": int(np.sum(apart > TOLERANCE["settled"])),
            "other_outcome": int(np.sum(gpu["outcome"] != cpu["outcome"])),
        }
        more["median"] = float(np.median(apart))
        if "own" in cpu:
            own = np.max(cpu["own"][good], axis=1)
            more |= {"own": float(np.max(own)), "own_beyond": int(np.sum(own > TOLERANCE["settled"]))}
    elif kind == "traces":
        apart, more = np.abs(a - b) / (4 * np.pi / 3), {}
    else:
        if kind != "eigenvalues":
            good = (a[:, 2] == 0) & (b[:, 2] == 0)
            a, b = a[:, :2].transpose(0, 2, 1)[good], b[:, :2].transpose(0, 2, 1)[good]
        apart, more = np.abs(a - b) / np.abs(b), {}
    return {"largest": float(np.max(apart)), **more}


def table(rows: list[dict], failed: dict, cores: int, gpu: str, folder: Path) -> tuple[str, bool]:
    """Markdown, and whether all numbers agree that are there on both."""
    at = {(row["kind"], row["count"], row["on"]): row for row in rows}
    sizes = list(dict.fromkeys((row["kind"], row["count"]) for row in rows if row["on"] in ("cpu", "gpu")))
    sizes += [key for key in failed if key[:2] not in sizes for key in [key[:2]]]
    order = list(WORDS)
    sizes = sorted(dict.fromkeys(sizes), key=lambda key: (order.index(key[0]), key[1]))
    lines = [
        f"GPU: {gpu or 'none, not run'}. CPU: {cores} cores. float64, seconds; the first call compiles.",
        "",
        f"| what | batch | CPU, one core: first | warm | CPU, {cores} processes | GPU: first | warm | GPU memory "
        "[GB] | faster than one core | than all | apart |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    agree, said = True, set()
    for kind, count in sizes:
        cpu, card, every = (at.get((kind, count, on)) for on in ("cpu", "gpu", "all"))
        told = lambda row, name, on, kind=kind, count=count: (  # noqa: E731
            f"{row[name]:.3g}" if row else failed.get((kind, count, on), "not run")
        )
        gain = lambda row, card=card: f"{row['warm_s'] / card['warm_s']:.3g}" if row and card else "–"  # noqa: E731
        found = compared(kind, count, folder)
        apart = "–"
        if found:
            apart = f"{found['largest']:.0e}" + (" σ" if kind in FITS else "")
            if kind in FITS:
                apart += f", median {found['median']:.0e}; {found['beyond']} beyond 1e-6 σ"
                apart += f"; {found['other_outcome']} other outcomes"
            if "own" in found:
                apart += f"; the last bit of the data: {found['own']:.0e} σ, {found['own_beyond']} beyond 1e-6 σ"
            agree &= found["largest"] <= max(TOLERANCE.get(kind, 1e-9), 3 * found.get("own", 0.0))
        words = WORDS[kind] if kind not in said else "″"
        said.add(kind)
        ended = "" if not cpu or cpu["ok"] == cpu["of"] else f" ({cpu['ok']} of {cpu['of']} ok)"
        lines.append(
            f"| {words} | {count:,}{ended} | {told(cpu, 'first_s', 'cpu')} | {told(cpu, 'warm_s', 'cpu')} | "
            f"{told(every, 'warm_s', 'all') if every else '–'} | {told(card, 'first_s', 'gpu')} | "
            f"{told(card, 'warm_s', 'gpu')} | {card['gpu_gb'] if card else '–'} | {gain(cpu)} | {gain(every)} | "
            f"{apart} |"
        )
    return "\n".join(lines) + "\n", agree


def measure(args) -> int:
    """Run everything, compare, write; 0 where what is there on both agrees."""
    began, cores = time.monotonic(), sorted(os.sched_getaffinity(0))
    gpu = "" if args.cpu else has_gpu()
    if args.log:
        Path(args.log).write_text("")
    rows: list[dict] = []
    failed: dict = {}

    def log(row: dict) -> None:
        print(json.dumps(row), flush=True)
        if args.log:
            with open(args.log, "a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        if "failed" in row:
            for count in row["counts"]:
                failed.setdefault((row["kind"], count, row["on"]), row["failed"].replace("|", "/"))
        else:
            rows.append(row)

    sizes = {kind: getattr(args, kind) or ((SMALL if args.small else LARGE)[kind]) for kind in LARGE}
    log(
        {
            "kind": "machine",
            "on": "-",
            "count": 0,
            "cores": len(cores),
            "gpu": gpu or "none",
            "python": platform.python_version(),
        }
    )
    rows.clear()
    with tempfile.TemporaryDirectory() as name:
        folder, ways = Path(name), (["gpu"] if gpu else []) + ["cpu"]
        jobs = []
        for on in ways:
            # the long ones first; those that share programs share a process
            shelled = [(kind, [n]) for kind in ("traces", "second", "exact") for n in sorted(sizes[kind], reverse=True)]
            fitted = [(kind, sorted(sizes[kind])) for kind in FITS]
            for kind, counts in [("eigenvalues", [64]), *fitted, *shelled]:
                if counts and (not args.only or kind in args.only):
                    jobs.append(Job(kind, counts, on, folder))
        together(jobs, cores, began + 0.7 * args.limit, log)
        if len(cores) > 2 and not args.small:
            for kind in ("second", "traces", "fits"):
                most = max(sizes[kind], default=0)
                if (kind, most, "cpu") not in {(r["kind"], r["count"], r["on"]) for r in rows} or most < len(cores):
                    continue
                if args.only and kind not in args.only:
                    continue
                shared = [
                    Job(kind, [most // len(cores)], f"cpu{k}", folder, begin=100 * k + 1000) for k in range(len(cores))
                ]
                together(shared, cores, began + 0.97 * args.limit, lambda row: None)
                done = [job.rows[0] for job in shared if job.rows]
                if len(done) == len(cores):
                    slowest = max(done, key=lambda row: row["warm_s"])
                    log({**slowest, "count": most, "on": "all", "processes": len(cores)})
        for kind, count in dict.fromkeys((row["kind"], row["count"]) for row in rows):
            if found := compared(kind, count, folder):
                log({"kind": kind, "count": count, "on": "apart", **found})
        text, agree = table([row for row in rows if row["on"] != "apart"], failed, len(cores), gpu, folder)
    print("\n" + text, flush=True)
    if args.table:
        Path(args.table).write_text(text, encoding="utf-8")
    print(
        f"{time.monotonic() - began:.0f} s; " + ("the numbers agree" if agree else "SOME NUMBERS ARE APART"), flush=True
    )
    # what ran on the CPU must have run; on a GPU the table says what did not
    return int(not agree or any(on == "cpu" for _, _, on in failed))


def main() -> int:
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--limit", type=float, default=540.0, help="seconds in all")
    ask.add_argument("--small", action="store_true", help="few sizes, for a machine without a GPU")
    ask.add_argument("--cpu", action="store_true", help="do not look for a GPU")
    ask.add_argument("--table", help="where the Markdown goes")
    ask.add_argument("--log", help="where the rows go, JSON lines")
    ask.add_argument("--only", nargs="+", choices=list(WORDS), default=[])
    for kind in LARGE:
        ask.add_argument(f"--{kind}", type=int, nargs="*", help=f"sizes, {' '.join(map(str, LARGE[kind]))}")
    return measure(ask.parse_args())


if __name__ == "__main__":
    sys.exit(main())
