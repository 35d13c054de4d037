"""The process beside a run: its forks do what this process would, at once, and tell what fails."""

from __future__ import annotations

import os
import signal
import time

import pytest

from wavesim.worker import Worker


def tell_pid(seconds=0.0):
    time.sleep(seconds)
    return os.getpid()


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def fail(number):
    raise ValueError(f"number {number}")


HERE = __name__


def test_each_thing_asked_has_a_fork_of_its_own_and_its_own_answer():
    with Worker() as beside:
        pids = [beside.ask(f"{HERE}.tell_pid", 0.02 * (3 - n)) for n in range(4)]
        size = beside.ask("os.path.join", "a" * 2_000_000, "b")
        roots = [beside.ask("math.sqrt", float(n)) for n in range(3)]
        assert size.result(60) == "a" * 2_000_000 + "/b"
        assert [root.result(60) ** 2 for root in roots] == pytest.approx([0, 1, 2])
        found = {pid.result(60) for pid in pids}
    assert len({*found, beside._process.pid, os.getpid()}) == 6


def test_what_is_prepared_is_there_for_all_forks():
    with Worker() as beside:
        beside.prepare("os.putenv", "WAVESIM_TOLD", "yes")
        beside.prepare(f"{HERE}.remember", 7)
        assert beside.ask(f"{HERE}.remembered").result(60) == [7]
        assert beside.ask(f"{HERE}.remembered").result(60) == [7]


_KEPT = []


def remember(value):
    _KEPT.append(value)


def remembered():
    return _KEPT


def test_what_goes_wrong_is_told_once_and_the_worker_goes_on():
    with Worker() as beside:
        wrong = beside.ask(f"{HERE}.fail", 1)
        gone = beside.ask(f"{HERE}.die")
        unknown = beside.ask("wavesim.no_such_module.function")
        with pytest.raises(ValueError, match="number 1") as told:
            wrong.result(60)
        assert "in fail" in told.value.__notes__[0]
        with pytest.raises(MemoryError, match="ended with code -9"):
            gone.result(60)
        with pytest.raises(ModuleNotFoundError):
            unknown.result(60)
        assert beside.ask(f"{HERE}.tell_pid").result(60) > 0


def test_a_worker_that_is_killed_is_told_and_leaves_no_zombie():
    with Worker() as beside:
        before = beside.ask("time.sleep", 60)
        os.kill(beside._process.pid, signal.SIGKILL)
        with pytest.raises(MemoryError, match="ended with code -9"):
            before.result(60)
        with pytest.raises(MemoryError, match="ended with code -9"):
            beside.ask(f"{HERE}.tell_pid").result(60)
    with Worker() as idle:
        pass
    assert idle._process.returncode == -signal.SIGKILL
