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


def several(count, seconds):
    return [lambda: tell_pid(seconds)] * count


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def fail(number):
    raise ValueError(f"number {number}")


def two_that_fail():
    return [lambda: fail(1), lambda: time.sleep(0.2), lambda: fail(2)]


HERE = __name__


def test_each_job_has_a_fork_of_its_own_and_answers_keep_their_order():
    with Worker() as beside:
        one = beside.each("math.sqrt", 4.0)  # no list of jobs
        found = [beside.each(f"{HERE}.several", 3, 0.01), beside.one(f"{HERE}.tell_pid")]
        size = beside.one("os.path.join", "a" * 2_000_000, "b")
        pids = [pid for future in found for pid in future.result(60)]
        assert size.result(60) == ["a" * 2_000_000 + "/b"]
        with pytest.raises(TypeError):
            one.result(60)
    assert len({*pids, beside._process.pid, os.getpid()}) == 6
    with Worker() as beside:
        places = beside.each(f"{HERE}.in_turn")
        assert places.result(60) == [0, 1, 2]


def in_turn():
    """The first takes longest."""

    def place(number):
        time.sleep(0.05 * (2 - number))
        return number

    return [lambda n=n: place(n) for n in range(3)]


def test_what_is_prepared_is_there_for_all_forks():
    with Worker() as beside:
        beside.prepare("os.putenv", "WAVESIM_TOLD", "yes")
        beside.prepare(f"{HERE}.remember", 7)
        assert beside.one(f"{HERE}.remembered").result(60) == [[7]]
        assert beside.one(f"{HERE}.remembered").result(60) == [[7]]


_KEPT = []


def remember(value):
    _KEPT.append(value)


def remembered():
    return _KEPT


def test_what_goes_wrong_is_told_once_and_the_worker_goes_on():
    with Worker() as beside:
        wrong = beside.each(f"{HERE}.two_that_fail")
        gone = beside.one(f"{HERE}.die")
        unknown = beside.one("wavesim.no_such_module.function")
        with pytest.raises(ValueError, match="number 1") as told:
            wrong.result(60)
        assert "in fail" in told.value.__notes__[0]
        with pytest.raises(MemoryError, match="ended with code -9"):
            gone.result(60)
        with pytest.raises(ModuleNotFoundError):
            unknown.result(60)
        assert len(beside.one(f"{HERE}.tell_pid").result(60)) == 1


def test_a_worker_that_is_killed_is_told_and_leaves_no_zombie():
    with Worker() as beside:
        before = beside.one("time.sleep", 60)
        os.kill(beside._process.pid, signal.SIGKILL)
        with pytest.raises(MemoryError, match="ended with code -9"):
            before.result(60)
        with pytest.raises(MemoryError, match="ended with code -9"):
            beside.one(f"{HERE}.tell_pid").result(60)
    with Worker() as idle:
        pass
    assert idle._process.returncode == -signal.SIGKILL
