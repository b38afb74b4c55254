"""Nobody who waits for work sleeps through its arrival."""

import threading
import time

from jshell.service.notifier import Notifier


def test_who_looked_before_a_notification_does_not_sleep_through_it():
    notifier = Notifier()
    seen = notifier.count
    notifier.notify()  # between the look for work, which found none, and the wait
    begun = time.monotonic()
    assert notifier.wait(seen, 30)
    assert time.monotonic() - begun < 10
    assert not notifier.wait(notifier.count, 0.01)


def test_everybody_is_woken():
    notifier, woken = Notifier(), []
    waiting = [threading.Thread(target=lambda: woken.append(notifier.wait(0, 30))) for _ in range(4)]
    for thread in waiting:
        thread.start()
    notifier.notify()
    for thread in waiting:
        thread.join(30)
    assert woken == [True] * 4
