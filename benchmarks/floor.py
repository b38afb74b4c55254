"""What is left of a batch's throughput where a service does the least that it promises, and nothing else.

    .venv/bin/python benchmarks/floor.py [SAMPLES ...]

The bytes of 10 000 traces go over a socket of this machine into memory that the fitting process shares, are hashed, are
on the disk (SQLite, one transaction a part, never a checkpoint) before they are fitted, and what was found is on the
disk before it is sent back. All of it overlaps as far as two cores let it: sending, keeping, fitting. There is no HTTP,
no form, no archive, no lease, no queue, no second copy: whatever answers over HTTP and keeps what it accepts is slower.
Printed beside `fit_batch` in this process on the same records, in turn; the same numbers to the bit, else it fails.
"""

import hashlib
import multiprocessing
import pickle
import queue
import socket
import sqlite3
import struct
import sys
import tempfile
import threading
import time
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory

import numpy as np

ROWS, STEP, TURNS = 10_000, 2048, 8
SET_UP = ("page_size = 16384", "journal_mode = WAL", "synchronous = FULL", "wal_autocheckpoint = 1000000")
EMPTY = -1  # sent for a length: the log is to be emptied, between two turns


def fitting(pipe: Connection, memory: str, samples: int) -> None:
    """The process that fits: a part of the shared memory, and back what was found."""
    from jshell.calibration import Recordings, fit_batch
    from jshell.shell import Reduced

    shared = SharedMemory(memory)
    while True:
        begin, rows, times, conditions, seed = pickle.loads(pipe.recv_bytes())
        values = np.frombuffer(shared.buf, float, rows * 2 * samples, offset=begin).reshape(rows, 2, samples)
        found = fit_batch(Recordings(times, values, Reduced(*conditions)), seed=seed)
        pipe.send_bytes(pickle.dumps(found))


def serving(told: Connection, folder: str, samples: int) -> None:
    """The process that keeps: receives, hashes, writes, hands on."""
    shared = SharedMemory(create=True, size=ROWS * 2 * samples * 8)
    np.frombuffer(shared.buf, np.uint8)[:] = 1  # every page is there
    pipe, other = multiprocessing.Pipe()
    context = multiprocessing.get_context("spawn")
    context.Process(target=fitting, args=(other, shared.name, samples), daemon=True).start()
    database = sqlite3.connect(f"{folder}/floor.db", check_same_thread=False, isolation_level=None)
    for pragma in SET_UP:
        database.execute(f"PRAGMA {pragma}")
    database.execute("CREATE TABLE kept (name TEXT PRIMARY KEY, content BLOB)")
    writes, jobs, parts = threading.Lock(), queue.SimpleQueue(), queue.SimpleQueue()
    with socket.create_server(("127.0.0.1", 0)) as listening:
        told.send(listening.getsockname()[1])
        line, _ = listening.accept()

    def keep(name: str, content: memoryview | bytes) -> None:
        with writes:
            database.execute("BEGIN IMMEDIATE")
            database.execute("INSERT INTO kept VALUES (?, ?)", (name, content))
            database.execute("COMMIT")

    def keep_parts() -> None:
        while True:
            begin, size, call = parts.get()
            content = shared.buf[begin : begin + size]
            name = f"{hashlib.sha256(content).hexdigest()} {time.time_ns()}"
            keep(name, content)
            jobs.put((name, call))

    def fit_parts() -> None:
        while True:
            name, call = jobs.get()
            pipe.send_bytes(call)
            found = pipe.recv_bytes()
            keep(f"found {name}", found)
            send(line, found)

    for job in (keep_parts, fit_parts):
        threading.Thread(target=job, daemon=True).start()
    while True:
        (length,) = struct.unpack("<q", exactly(line, 8))
        if length == EMPTY:
            with writes:
                database.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            send(line, b"empty")
            continue
        call = bytes(exactly(line, length))
        begin, rows, *_ = pickle.loads(call)
        size = rows * 2 * samples * 8
        receive(line, shared.buf[begin : begin + size])
        parts.put((begin, size, call))


def receive(line: socket.socket, room: memoryview) -> None:
    while len(room):
        got = line.recv_into(room)
        if not got:
            raise SystemExit  # whoever asked is gone
        room = room[got:]


def exactly(line: socket.socket, length: int) -> bytearray:
    found = bytearray(length)
    receive(line, memoryview(found))
    return found


def send(line: socket.socket, content: bytes) -> None:
    line.sendall(struct.pack("<q", len(content)) + content)


def answer(line: socket.socket) -> bytearray:
    return exactly(line, struct.unpack("<q", exactly(line, 8))[0])


def compare(samples: int) -> None:
    """One row of the table."""
    from fits import recordings
    from serving import changed

    from jshell.calibration import Recordings, fit_batch
    from jshell.calibration.recordings_file import CONDITIONS

    whole, _ = recordings(ROWS, 0.01)
    every = whole.values.shape[2] // samples
    values = np.ascontiguousarray(np.asarray(whole.values)[:, :, ::every])
    records = Recordings(np.asarray(whole.times)[::every], values, whole.conditions)
    conditions = [np.broadcast_to(np.asarray(getattr(records.conditions, name)), (ROWS,)) for name in CONDITIONS]

    def sent(values: np.ndarray, seed: int) -> None:
        for at in range(0, ROWS, STEP):
            part = values[at : at + STEP]
            mine = [one[at : at + STEP] for one in conditions]
            send(line, pickle.dumps((at * part[0].nbytes, len(part), np.asarray(records.times), mine, seed)))
            line.sendall(part.reshape(-1).view(np.uint8).data)

    def asked(values: np.ndarray, seed: int) -> list:
        sender = threading.Thread(target=sent, args=(values, seed))
        sender.start()
        found = [pickle.loads(answer(line)) for _ in range(0, ROWS, STEP)]
        sender.join()
        return found

    with tempfile.TemporaryDirectory() as folder:
        here, there = multiprocessing.Pipe()
        server = multiprocessing.get_context("spawn").Process(target=serving, args=(there, folder, samples))
        server.start()
        with socket.create_connection(("127.0.0.1", here.recv())) as line:
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            fit_batch(records)
            asked(np.asarray(records.values), 0)  # both have compiled
            spent = []
            for turn in range(TURNS):
                records = changed(records)
                line.sendall(struct.pack("<q", EMPTY))
                answer(line)
                begun = time.perf_counter()
                expected = fit_batch(records, seed=turn)
                fitted = time.perf_counter()
                found = asked(np.asarray(records.values), turn)
                spent.append((fitted - begun, time.perf_counter() - fitted))
                values = np.concatenate([part.values for part in found])
                if not np.array_equal(values, expected.values, equal_nan=True):
                    raise RuntimeError("other numbers there than here")
        server.kill()
    best, middle = np.min(spent, axis=0), np.median(spent, axis=0)
    print(
        f"| {samples} | {ROWS * 2 * samples * 8 / 2**20:.0f} | {best[0]:.2f} | {best[1]:.2f} | "
        f"{best[0] / best[1]:.2f} | {middle[0] / middle[1]:.2f} |",
        flush=True,
    )


def main() -> None:
    print(f"\n### the least that keeping {ROWS} traces costs\n")
    print("| samples | MiB | `fit_batch` [s] | kept and fitted [s] | of it, best | median |\n|---|---|---|---|---|---|")
    for samples in [int(one) for one in sys.argv[1:]] or (400, 100):
        compare(samples)


if __name__ == "__main__":
    main()
