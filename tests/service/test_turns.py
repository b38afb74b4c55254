"""Who waits for the simulator of the page, how long, and who is sent away."""

import threading
import time

import pytest

from jshell.service import shape
from jshell.service.problems import Refused


def beside(turns: shape.Turns, release: threading.Event) -> threading.Thread:
    """Somebody whose work lasts until it is released, and has begun."""
    begun = threading.Event()

    def work() -> None:
        begun.set()
        release.wait(30)

    thread = threading.Thread(target=lambda: turns.take(work))
    thread.start()
    assert begun.wait(30)
    return thread


def test_while_the_first_one_compiles_the_others_wait_for_it():
    turns, release = shape.Turns(patience=0.05), threading.Event()
    first = beside(turns, release)
    threading.Timer(0.4, release.set).start()
    began = time.monotonic()
    assert turns.take(lambda: "drawn") == "drawn"
    assert time.monotonic() - began > 0.3
    first.join()


def test_once_it_is_compiled_who_waits_too_long_is_told_so():
    turns, release = shape.Turns(patience=0.05), threading.Event()
    turns.take(lambda: None)
    slow = beside(turns, release)
    with pytest.raises(Refused) as caught:
        turns.take(lambda: "drawn")
    assert caught.value.code == "too_many"
    release.set()
    slow.join()
    assert turns.take(lambda: "drawn") == "drawn"


def test_work_that_failed_has_compiled_nothing_and_keeps_no_turn():
    turns, release = shape.Turns(patience=0.05), threading.Event()
    with pytest.raises(ZeroDivisionError):
        turns.take(lambda: 1 / 0)
    first = beside(turns, release)
    threading.Timer(0.4, release.set).start()
    assert turns.take(lambda: "drawn") == "drawn"
    first.join()


def test_more_than_may_wait_are_sent_away_at_once():
    turns, release, answers = shape.Turns(patience=30.0), threading.Event(), []
    threads = [beside(turns, release)]
    threads += [
        threading.Thread(target=lambda: answers.append(turns.take(lambda: "drawn"))) for _ in range(shape.WAITING - 1)
    ]
    for thread in threads[1:]:
        thread.start()
    until = time.monotonic() + 30
    while turns.places.acquire(blocking=False) and time.monotonic() < until:  # until all of them wait
        turns.places.release()
        time.sleep(0.01)
    began = time.monotonic()
    with pytest.raises(Refused):
        turns.take(lambda: "drawn")
    assert time.monotonic() - began < 5
    release.set()
    for thread in threads:
        thread.join()
    assert answers == ["drawn"] * (shape.WAITING - 1)
