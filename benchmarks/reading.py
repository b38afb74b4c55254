"""How long reading a trace of a million rows takes, and how much memory it needs at its worst.

Each line is measured in a process of its own, with all imports done before the
clock starts; the peak is what the process held above that (Linux). The rivals read
the same text without checking it. Prints a table in Markdown:

    .venv/bin/python benchmarks/reading.py
"""

import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

import jshell as js
from jshell import io

ROWS = 1_000_000
SUFFIXES = (".csv", ".tsv", ".json", ".nc", ".mat", ".npz")


LABVIEW = [
    "LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t,", "X_Columns\tOne",
    "***End_of_Header***\t", "\t", "Channels\t2\t\t", "Y_Unit_Label\tVolts\tVolts\t", "X0\t0,0\t0,0\t",
    "Delta_X\t0,001\t0,001\t", "***End_of_Header***\t\t\t", "X_Value\tA_0\tA_1\tComment",
]  # fmt: skip
SCOPE = {
    1: ("Sample Interval", "4e-5"),
    6: ("Source", "CH1"),
    7: ("Vertical Units", "V"),
    10: ("Horizontal Units", "s"),
}


def trace(rows: int) -> js.Trace:
    """A damped signal of two modes about the rest state of R, with noise."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 40, rows)
    slow, fast = np.exp(-t / 8) * np.cos(0.99 * t), np.exp(-t / 8) * np.cos(1.65 * t)
    V = 2.913 + 0.02 * slow + 0.02 * fast + 1e-4 * rng.normal(size=rows)
    S = 12.0 + 0.01 * slow - 0.01 * fast + 1e-4 * rng.normal(size=rows)
    return js.Trace(t, {"V": V, "S": S}, js.Reduced(0.22, 0.9, 1.6, 0.004))


def memory(key: str) -> float:
    """`VmRSS`, what this process holds now, or `VmHWM`, the most since the last `forget_peak` [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(key))


def forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def fit(path: Path) -> None:
    js.calibration.fit_trajectories(io.read_trace(path), "modal", channels=["V"])


def read_spoiled(path: Path) -> None:
    """A file with a word in its last row: the fast reader gives up, the strict one finds the row."""
    try:
        io.read_trace(path)
    except js.errors.BadFile:
        return
    raise AssertionError("a spoiled file was read")


def told(path: Path, **said: str) -> None:
    """A file that leaves something open; the words about it are not printed here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", js.errors.GuessWarning)
        io.read_trace(path, **said)


def pandas(path: Path) -> None:
    import pandas as rival

    rival.read_csv(path, comment="#")


JOBS: dict[str, tuple[str, Callable[[Path], object]]] = {
    **{f"read {suffix}": (suffix, io.read_trace) for suffix in SUFFIXES},
    "read .csv with semicolons and decimal commas": (".commas.csv", io.read_trace),
    "read .csv with every cell quoted": (".quoted.csv", io.read_trace),
    "read .csv with a column of words, padded rows": (".words.csv", told),
    "read .csv with decimal commas and thousands": (".thousands.csv", told),
    "read a table of blanks": (".blanks.dat", io.read_trace),
    "read .csv with dates for times": (".dates.csv", told),
    "read .csv with gaps, left out": (".gaps.csv", lambda path: told(path, missing="drop")),
    "read .csv in UTF-16": (".utf16.csv", told),
    "read .csv in Latin-1": (".latin.csv", told),
    "read .lvm with decimal commas": (".lvm", told),
    "read an oscilloscope's .csv, its head beside the rows": (".scope.csv", told),
    "refuse .csv for its last row": (".spoiled.csv", read_spoiled),
    "numpy.loadtxt of .csv": (".csv", lambda path: np.loadtxt(path, delimiter=",", skiprows=8)),
    "pandas.read_csv of .csv": (".csv", pandas),
    "read .csv and fit_trajectories": (".csv", fit),
}


def measure(name: str, path: Path) -> None:
    """Time and peak of one job, in a fresh process; a small file first wakes what loads lazily."""
    job = JOBS[name][1]
    small = path.parent / f"small{''.join(path.suffixes)}"
    if "fit" not in name:
        job(small)
    forget_peak()
    before, began, busy = memory("VmRSS"), time.perf_counter(), time.process_time()
    job(path)
    print(time.perf_counter() - began, time.process_time() - busy, memory("VmHWM") - before)


def write(folder: Path, stem: str, rows: int) -> None:
    for suffix in SUFFIXES:
        io.write_trace(folder / f"{stem}{suffix}", trace(rows))
    lines = (folder / f"{stem}.csv").read_text().splitlines()
    (folder / f"{stem}.spoiled.csv").write_text("\n".join([*lines, "a,b,c"]))
    head, rows = lines[:-rows], lines[-rows:]  # the names are the last of the head
    quoted = ['"' + row.replace(",", '","') + '"' for row in rows]
    (folder / f"{stem}.quoted.csv").write_text("\n".join([*head, *quoted]))
    words = [head[-1] + ",note", *(row + ",a word,," for row in rows)]
    (folder / f"{stem}.words.csv").write_text("\n".join([*head[:-1], *words]))
    (folder / f"{stem}.blanks.dat").write_text("\n".join([*head, *rows]).replace(",", "   "))
    gaps = [row if k % 7 else row.rpartition(",")[0] + "," for k, row in enumerate(rows)]
    (folder / f"{stem}.gaps.csv").write_text("\n".join([*head, *gaps]))
    cells = [row.split(",") for row in rows]
    dates = [f"2024-05-23 {k // 36000 % 24:02d}:{k // 600 % 60:02d}:{k / 10 % 60:04.1f}" for k in range(len(rows))]
    dated = [",".join([date, *cell[1:]]) for date, cell in zip(dates, cells, strict=True)]
    days = [f"2024-05-{1 + k // 864000:02d}{row[10:]}" for k, row in enumerate(dated)]
    (folder / f"{stem}.dates.csv").write_text("\n".join(["t [s],CH1 [V],CH2 [V]", *days]))
    long = [
        f"{k / 10:,.1f};{1e4 * float(cell[1]):,.3f}".translate(str.maketrans(",.", ".,"))
        for k, cell in enumerate(cells)
    ]
    (folder / f"{stem}.thousands.csv").write_text("\n".join(["t;mine", *long]))
    (folder / f"{stem}.utf16.csv").write_text("\n".join(lines), encoding="utf-16")
    (folder / f"{stem}.latin.csv").write_text("\n".join(["% Gerät", *head[-1:], *rows]), encoding="latin-1")
    tabs = [row.replace(".", ",") for row in ("\t".join(cell) + "\t" for cell in cells)]
    (folder / f"{stem}.lvm").write_text("\n".join([*LABVIEW, *tabs]))
    beside = [",".join((*SCOPE.get(k, ("", "")), "", *cell[:2])) + "," for k, cell in enumerate(cells)]
    (folder / f"{stem}.scope.csv").write_text("\n".join(beside))
    commas = [line if line.startswith("#") else line.replace(",", ";").replace(".", ",") for line in lines]
    (folder / f"{stem}.commas.csv").write_text("\n".join(commas))


def main() -> None:
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else ROWS
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""  # jobs of whose names this is a part
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder, "small", 100)
        write(folder, "large", rows)
        print(f"rows: {rows}, channels: 2\n")
        print("| job | file [MB] | time [s] | of the processor [s] | peak above the baseline [MB] |")
        print("|---|---|---|---|---|")
        for job, (suffix, _) in JOBS.items():
            if wanted not in job:
                continue
            path = folder / f"large{suffix}"
            words = [sys.executable, __file__, "--measure", job, str(path)]
            said = subprocess.run(words, capture_output=True, text=True, check=False)
            shown = " | ".join(f"{float(n):.3g}" for n in said.stdout.split()) or f"{said.stderr[-200:]} | | "
            print(f"| {job} | {path.stat().st_size / 1e6:.0f} | {shown} |", flush=True)


if __name__ == "__main__":
    if "--measure" in sys.argv:
        measure(sys.argv[2], Path(sys.argv[3]))
    else:
        main()
