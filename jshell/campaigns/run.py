"""Running a campaign: whatever is not finished yet, on an engine, each result kept as it comes.

Killed at any time, the same call goes on where it was; nothing but whole files
of finished runs is believed, and the catalogue is made from them. What an engine
loses is submitted again, three times at most: such a run stays unfinished, since it says
nothing about the shell.

Source     Python standard library: concurrent.futures
"""

import concurrent.futures
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path

from jshell import engines
from jshell.campaigns.catalog import Catalog, catalog
from jshell.campaigns.design import Design
from jshell.campaigns.perform import perform
from jshell.campaigns.planned import Run
from jshell.campaigns.store import RunStore
from jshell.campaigns.writing import design_text, read_design
from jshell.errors import BadFile, WorkerLost

ATTEMPTS = 3
AHEAD = 64  # runs handed to the engine at once


@dataclass(frozen=True)
class Progress:
    """How far a campaign is.

    Attributes:
        done, total: Finished runs of this design, and all of them.
        last: The run that has just ended, None at the beginning.
        outcome: How it ended: a word of `Outcome`, or `lost` where its worker died and it will be tried again.
    """

    done: int
    total: int
    last: Run | None = None
    outcome: str = ""


def run(
    design: Design | str | Path,
    out: str | Path,
    *,
    engine: Executor | str = "inline",
    progress: Callable[[Progress], None] | None = None,
) -> Catalog:
    """Do the runs of a design that are not finished yet.

    Args:
        design: The design, or its TOML file.
        out: Folder of the campaign; made where there is none. It may hold a part of this campaign, or runs of
            another design, which are used where they are the same.
        engine: An engine, or its name, see `jshell.engines.open`.
        progress: Called at the beginning and after each run.

    Returns:
        The catalogue; also written as `catalog.csv` in the folder. Runs that ended badly are in it with their
        outcome, runs whose worker died three times are `missing`.

    Raises:
        BadFile: The folder holds another design, or cannot be written.

    Example:
        >>> import tempfile
        >>> from jshell import campaigns
        >>> one = campaigns.Family("R", "modes", {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6})
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     found = campaigns.run(campaigns.Design("one shell", (one,)), folder)
        >>> print(found["outcome"], found["modes_omega_1"].round(2))
        ['ok'] [1.03]
    """
    design = design if isinstance(design, Design) else read_design(design)
    store = RunStore(Path(out))
    store.begin()
    text = design_text(design)
    kept = read_design(store.design) if store.design.exists() else design
    if kept != design and kept.runs() != design.runs():
        raise BadFile(
            str(store.design),
            found="another design",
            expected=f"the design {design.name!r}, or an empty folder",
            remedy="Name another folder; or replace design.toml in it to keep the runs that both share.",
        )
    if not store.design.exists():
        store.write(store.design, text)
    planned = list(design.runs())
    waiting = [one for one in planned if not store.has(one)]
    report = (lambda _: None) if progress is None else progress
    report(Progress(len(planned) - len(waiting), len(planned)))
    if waiting and isinstance(engine, str):
        with engines.open(engine) as opened:
            _work(waiting, store, opened, report, len(planned))
    elif waiting:
        _work(waiting, store, engine, report, len(planned))  # type: ignore[arg-type]
    found = catalog(store.folder)
    store.write(store.catalogue, found.to_csv())
    return found


def _work(waiting: Iterable[Run], store: RunStore, engine: Executor, report: Callable, total: int) -> None:
    """Hand out runs, keep results as they come, hand lost ones out again."""
    queue = [(one, 1) for one in waiting]
    done = total - len(queue)
    open_: dict[Future, tuple[Run, int]] = {}
    while queue or open_:
        while queue and len(open_) < AHEAD:
            one, attempt = queue.pop(0)
            future = engine.submit(perform, one)
            open_[future] = (one, attempt)
            if future.done():  # an engine that works while it submits: keep this before the next begins
                break
        finished, _ = concurrent.futures.wait(open_, return_when=concurrent.futures.FIRST_COMPLETED)
        for future in finished:
            one, attempt = open_.pop(future)
            try:
                result = future.result()
            except WorkerLost:
                if attempt < ATTEMPTS:
                    queue.append((one, attempt + 1))
                report(Progress(done, total, one, "lost"))
                continue
            store.save(result)
            done += 1
            report(Progress(done, total, one, result.findings.outcome))
