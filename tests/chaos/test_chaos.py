"""The short form of `make chaos`: nothing ends the program, and the performer is still answered. No time is held."""

from __future__ import annotations

import math
import signal
import threading
import time
from contextlib import closing
from functools import partial
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
import pytest
from chaos import attacks
from chaos.__main__ import table, with_table
from chaos.attacks import INNOCENT, flood, publish
from chaos.performer import NAMES, Answer, Performance, cues_of
from chaos.trial import Effort, Outcome, ended_with, started, tried
from chaos.trials import TRIALS
from programs import PATIENCE

from kinespace.stream import zeromq
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.feeding.feed import OscFrameSender

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

#: The attacks on one recogniser, one after the other, and the seconds of each.
SUFFERED = [each.attack for each in TRIALS if each.attack and not each.first]
SECONDS = 0.25


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot hold a process")
def test_nothing_ends_the_program(played: NDArray[np.float32]) -> None:
    """After all attacks and a stop a performer is answered, the attacks are counted, and the program ends well."""
    with started(["--signature", "paper"]) as program:
        place = program.place()
        for attack in SUFFERED:
            stop = threading.Event()
            threading.Timer(SECONDS, stop.set).start()
            attack(place, stop)  # type: ignore[arg-type]  # has what the attacks ask
            assert program.process.poll() is None, attack
        program.process.send_signal(signal.SIGSTOP)
        program.process.send_signal(signal.SIGCONT)
        heard = zeromq.ZmqReceiver(Endpoint(place.answers, bind=False), f"class/{INNOCENT}/".encode())
        with closing(heard) as answers, closing(OscFrameSender(*place.osc)) as sender:
            until = time.monotonic() + PATIENCE
            for number in count():
                # The name was another's a moment ago: it is this sender's once that has been silent.
                sender.announce(NAMES)
                for cue in cues_of(played[:120], 1.0 + number):
                    sender.send(sender.encode(cue))
                    time.sleep(0.001)
                if answers.socket.poll(100) or time.monotonic() > until:
                    break
            assert answers.receive() is not None
        assert ended_with(program) == 0
        assert "Traceback" not in program.printed
        for counted in ("malformed", "foreign", "no room"):
            assert f"{counted} 0" not in program.printed.rpartition("received")[2]


@pytest.mark.slow
def test_a_trial_has_an_outcome(played: NDArray[np.float32]) -> None:
    """The performer is answered before and after, what happened is told, and the program ends when asked to."""
    name = "killed while recording, begun again"
    (trial,) = [each for each in TRIALS if each.name == name]
    found = tried(trial, Effort(before=2.0, during=1.0, after=1.5, memory=3.0), played)
    assert (found.name, found.ended) == (name, 0)
    assert found.expected > 10
    assert found.memory[0] > 10
    assert ("packets recorded" in found.told) == bool(trial.options)


def test_the_trials_are_all_that_the_page_lists() -> None:
    """Every trial has a name of its own, and every attack is part of one."""
    named = [each.name for each in TRIALS]
    assert len(set(named)) == len(named)
    made = [each for each in vars(attacks).values() if getattr(each, "__module__", "") == attacks.__name__]
    functions = {each for each in made if callable(each) and each.__name__[0] != "_"}
    used = {each.attack.args[0] if isinstance(each.attack, partial) else each.attack for each in TRIALS}
    assert functions - {flood, publish, attacks.greeted, attacks.is_ended} == used - {None}


def performance(late: Callable[[float], float]) -> Performance:
    """Make a performance of ten seconds; `late` gives the latency of the frame sent at a second, NaN for none."""
    moments = np.arange(0.0, 10.0, 1 / 30).tolist()
    answers = [Answer(moment, 100.0 + moment + late(moment), moment > 5.0) for moment in moments]
    answers = [each for each in answers if not math.isnan(each.arrival)]
    return Performance(100.0, {moment: 100.0 + moment for moment in moments}, answers)


def test_recovery_is_when_answers_come_again_as_they_should() -> None:
    """Counted from the end of the attack: at once, after a while, or never."""
    assert performance(lambda _: 0.001).recovery(5.0) == 0.0
    assert performance(lambda at: 1.0 if at < 6.0 else 0.001).recovery(5.0) == pytest.approx(1.0, abs=0.06)
    assert performance(lambda at: 0.001 if at < 5.0 else math.nan).recovery(5.0) == math.inf


def test_latencies_cover_the_frames_between_two_moments() -> None:
    """Answers are paired with their frames by the time in them; the first doubt is noted."""
    made = performance(lambda at: 2.0 if 3.0 <= at < 4.0 else math.nan if at < 1.0 else 0.01)
    assert [len(made.latencies(0.0, end)) for end in (1.0, 2.0)] == [0, 30]
    np.testing.assert_allclose(made.latencies(3.0, 4.0), 2.0)
    assert made.noticed(4.0, 6.0) == pytest.approx(1.0, abs=0.1)
    assert made.noticed(2.0, 4.0) is None


def test_a_page_gets_the_table_between_its_comments() -> None:
    """A row says when an answer or a recovery never came; the rest of the page is not touched."""
    outcome = Outcome("a flood", 0, 150, 0.01, math.nan, (90.0, 120.0, 91.0), math.inf, "malformed 7", 1, 0.5)
    row = "| a flood (noticed after 0.50 s) ENDED with 1 | 0 / 150 | 10.0 | - | 90 / 120 / 91 | never | malformed 7 |"
    assert table([outcome]).splitlines()[2] == row
    page = "before\n<!-- chaos: all -->\nold\n<!-- end -->\nafter\n"
    written = with_table(page, [outcome], "2 cores")
    lines = written.splitlines()
    assert (lines[:2], lines[-2:]) == (["before", "<!-- chaos: all -->"], ["<!-- end -->", "after"])
    assert lines[3:6] == table([outcome]).splitlines()
    assert "2 cores." in lines
    assert with_table(written, [outcome], "2 cores") == written
    with pytest.raises(ValueError, match="page: expected"):
        with_table("no place", [outcome], "2 cores")
