"""Nobody who waits for work sleeps through its arrival."""

import threading
import time

from jshell.service.bell import Bell


def test_who_looked_before_it_rang_does_not_sleep_through_it():
    bell = Bell()
    heard = bell.rung
    bell.ring()  # between the look for work, which found none, and the wait
    begun = time.monotonic()
    assert bell.wait(heard, 30)
    assert time.monotonic() - begun < 10
    assert not bell.wait(bell.rung, 0.01)


def test_everybody_is_woken():
    bell, woken = Bell(), []
    waiting = [threading.Thread(target=lambda: woken.append(bell.wait(0, 30))) for _ in range(4)]
    for thread in waiting:
        thread.start()
    bell.ring()
    for thread in waiting:
        thread.join(30)
    assert woken == [True] * 4
