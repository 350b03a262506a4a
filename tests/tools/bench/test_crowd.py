"""What `kinespace bench sockets` counts. No figure is held against a limit here."""

import math
import os
import sys
import time

import pytest

from kinespace.tools.bench.crowd import core_seconds, performers_a_core


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux is asked")
def test_time_on_a_core_is_of_the_process_asked_for() -> None:
    """A busy process's time agrees with its own count; the time of a missing process is unknown."""
    before, begun = core_seconds(os.getpid()), time.process_time()
    while time.process_time() < begun + 0.3:
        pass
    # The system counts hundredths of a second.
    assert core_seconds(os.getpid()) - before == pytest.approx(time.process_time() - begun, abs=0.1)
    assert math.isnan(core_seconds(2**22 + 1))
    assert performers_a_core(100.0) == pytest.approx(83.3, abs=0.1)
