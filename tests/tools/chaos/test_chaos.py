"""The short form of `make chaos`: nothing ends the program, and the performer is still answered. No time is held."""

from __future__ import annotations

import math
import signal
import tempfile
import threading
import time
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from programs import PATIENCE

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream import zeromq
from kinespace.stream.osc import OscSender
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.bench import recorded
from kinespace.tools.chaos import attacks, trial
from kinespace.tools.chaos.pages import with_tables
from kinespace.tools.chaos.performer import Answer, Performance, schedule
from kinespace.tools.chaos.run import TRIALS, table
from kinespace.tools.chaos.trial import Outcome, recovery
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from collections.abc import Callable

#: The attacks on one recogniser, one after the other, and the seconds of each.
SUFFERED = (
    attacks.garbage,
    attacks.new_names,
    attacks.many_messages,
    attacks.packed_frames,
    attacks.impostor,
    attacks.zmq_garbage,
    attacks.zmq_lists,
    attacks.zmq_headers,
    attacks.zmq_parts,
    attacks.large_subscriptions,
    attacks.unfinished_message,
)
SECONDS = 0.25


def suffer(attack: Callable[..., None], place: attacks.Place) -> None:
    """Let an attack go on for a moment."""
    stop = threading.Event()
    timer = threading.Timer(SECONDS, stop.set)
    timer.start()
    attack(place, stop)
    timer.join()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="this system cannot hold a process")
def test_nothing_ends_the_program() -> None:
    """After eleven attacks and a stop a performer is answered, the attacks are counted, and the program ends well."""
    with ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        live = opened.enter_context(trial.running(folder, ["--signature", "paper"]))
        for attack in SUFFERED:
            suffer(attack, live.place)
            assert live.process.poll() is None, attack.__doc__
        live.process.send_signal(signal.SIGSTOP)
        live.process.send_signal(signal.SIGCONT)
        topic = f"class/{attacks.INNOCENT}/".encode()
        answers = opened.enter_context(closing(zeromq.ZmqReceiver(Endpoint(live.place.answers, bind=False), topic)))
        sender = opened.enter_context(closing(OscSender(*live.place.osc)))
        positions = recorded.positions()[:120]
        until = time.monotonic() + PATIENCE
        for number in count():
            # His name was another's a moment ago: it is his once that has been silent.
            for packet in schedule(positions, SKELETON.joints, begin=number, befalls=None, over="osc"):
                sender.send(packet.parts[0])
                time.sleep(0.001)
            if answers.socket.poll(100) or time.monotonic() > until:
                break
        assert answers.receive() is not None
        live.process.send_signal(signal.SIGTERM)
        assert live.process.wait(PATIENCE) == 0
        told = live.printed()
    assert "Traceback" not in told
    for counted in ("malformed", "foreign", "no room"):
        assert f"{counted} 0" not in told.rpartition("received")[2]


def test_the_trials_are_all_that_the_page_lists() -> None:
    """Every trial has a name of its own, and every attack is part of one."""
    named = [each.name for each in TRIALS]
    assert len(set(named)) == len(named)
    made = {each for each in vars(attacks).values() if getattr(each, "__module__", "") == attacks.__name__}
    functions = {each for each in made if callable(each) and not isinstance(each, type) and each.__name__[0] != "_"}
    assert functions == {attack for each in TRIALS for attack in each.attacks}


def performance(late: Callable[[float], float]) -> Performance:
    """Make a performance of ten seconds; `late` gives the latency of the frame sent at a second, NaN for none."""
    moments = np.arange(0.0, 10.0, 1 / 30).tolist()
    answers = [Answer(moment, 100.0 + moment + late(moment), doubted=False) for moment in moments]
    answers = [each for each in answers if not math.isnan(each.arrival)]
    return Performance(100.0, {moment: 100.0 + moment for moment in moments}, answers, {})


def test_recovery_is_when_answers_come_again_as_they_should() -> None:
    """Counted from the end of the attack: at once, after a while, or never."""
    assert recovery(performance(lambda _: 0.001), 5.0) == 0.0
    assert recovery(performance(lambda at: 1.0 if at < 6.0 else 0.001), 5.0) == pytest.approx(1.0, abs=0.06)
    assert recovery(performance(lambda at: 0.001 if at < 5.0 else math.nan), 5.0) == math.inf


def test_latencies_cover_the_frames_between_two_moments() -> None:
    """Answers are paired with their frames by the time in them; answers that come too late are counted."""
    made = performance(lambda at: 2.0 if 3.0 <= at < 4.0 else math.nan if at < 1.0 else 0.01)
    assert made.answered(0.0, 1.0) == 0
    assert made.answered(0.0, 2.0) == 30
    np.testing.assert_allclose(made.latencies(3.0, 4.0), 2.0)
    assert made.late(1.0) == 30


def test_the_table_has_a_row_for_each_trial() -> None:
    """The row says when an answer or a recovery never came."""
    outcome = Outcome("a flood", 0, 150, math.nan, 0.01, (90.0, 120.0, 91.0), math.inf, 0, "malformed 7", 1, None)
    (row,) = zip(*(column._cells for column in table([outcome]).columns), strict=True)  # noqa: SLF001 - the cells' text
    assert row == ("a flood ENDED with 1", "0 / 150", "10.0", "-", "90 / 120 / 91", "never", "malformed 7")


PAGE = "before\n<!-- chaos: {} -->\nold\n<!-- end -->\nafter\n"


def test_a_page_gets_the_tables_that_its_comments_ask_for() -> None:
    """All trials with all columns, or the worst with some, between comments that stay; the rest is not touched."""
    well = Outcome("well", 150, 150, 0.004, 0.004, (90.0, 91.0, 91.0), 0.0, 0, "", 0, None)
    outcomes = [replace(well, name=f"well {number}") for number in range(9)]
    outcomes.append(replace(well, name="silent", answered=0, p99=math.nan, recovered=math.inf))
    outcomes.append(replace(well, name="large", memory=(90.0, 200.0, 190.0)))
    written = with_tables(PAGE.format("worst"), outcomes, "2 cores")
    lines = written.splitlines()
    assert lines[2] == "| what goes wrong | answers / expected | p99, ms | MB before / most / after | s to recover |"
    assert lines[4:6] == [
        "| silent | 0 / 150 | - | 90 / 91 / 91 | never |",
        "| large | 150 / 150 | 4.0 | 90 / 200 / 190 | 0.0 |",
    ]
    assert len([line for line in lines if line.startswith("| ")]) == 6
    assert (lines[:2], lines[-2:]) == (["before", "<!-- chaos: worst -->"], ["<!-- end -->", "after"])
    assert "The worst of 11 attacks and faults (`make chaos`; 2 cores)." in lines
    assert with_tables(written, outcomes, "2 cores") == written
    assert with_tables(PAGE.format("all"), outcomes, "2 cores").count("\n| well") == 9
    with pytest.raises(ValueError, match="--write: expected a page with"):
        with_tables("no place", outcomes, "2 cores")


def test_a_name_that_no_trial_has_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """In one line that shows how such a name looks."""
    assert main(["chaos", "--only", "nonsense"]) == 2
    assert "--only: expected part of a name" in capsys.readouterr().err
