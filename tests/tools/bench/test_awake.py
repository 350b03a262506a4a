"""Cores that are kept awake: only where nothing else runs, and not for longer than asked."""

from __future__ import annotations

import os
import time

import pytest

from kinespace.tools.bench import awake


@pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="only Linux has an idle class")
def test_every_core_has_a_loop_of_the_idle_class(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inside the block a loop of the idle class runs for each core; behind it none does."""
    begun, popen = list[int](), awake.subprocess.Popen

    def start(command: list[str]) -> object:
        loop = popen(command)
        begun.append(loop.pid)
        return loop

    monkeypatch.setattr(awake.subprocess, "Popen", start)
    with awake.awake_cores():
        assert len(begun) == os.cpu_count()
        end = time.monotonic() + 10
        while any(os.sched_getscheduler(number) != os.SCHED_IDLE for number in begun):
            assert time.monotonic() < end
            time.sleep(0.01)
    for number in begun:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


def test_other_systems_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without an idle class nothing is started."""
    monkeypatch.delattr(awake.os, "SCHED_IDLE", raising=False)
    with pytest.raises(OSError, match="awake: expected Linux"), awake.awake_cores():
        pass
