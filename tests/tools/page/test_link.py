"""The page's link to a recogniser that ends and comes again."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import pytest
import zmq

from kinespace.stream.zeromq import Endpoint
from kinespace.tools.page import process as link
from kinespace.tools.page.process import Subscription, ask_control

PATIENCE = 60.0


@contextmanager
def bound(kind: int, place: str = "tcp://127.0.0.1:*") -> Iterator[zmq.Socket[bytes]]:
    """Bind a socket as a recogniser does; wait until the address of one that has ended is free."""
    with zmq.Context() as context, context.socket(kind) as opened:
        opened.linger = 0
        until = time.monotonic() + PATIENCE
        while True:
            try:
                opened.bind(place)
                break
            except zmq.ZMQError:
                assert time.monotonic() < until
                time.sleep(0.01)
        yield opened


def hears(subscription: Subscription, publisher: zmq.Socket[bytes], answer: bytes) -> bool:
    """Publish an answer again and again until it is heard."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        publisher.send_multipart([b"class/ann/", answer])
        if [b"class/ann/", answer] in subscription.messages():
            return True
        time.sleep(0.01)
    return False


def reply_once(control: zmq.Socket[bytes]) -> None:
    """Reply to one request as a recogniser does."""
    if control.poll(PATIENCE * 1000):
        control.recv()
        control.send(b'{"classes": ["bow"]}')


def test_answers_come_again_after_a_restart() -> None:
    """A subscription hears the recogniser that takes the address of one that has ended."""
    with bound(zmq.PUB) as first:
        place = first.getsockopt_string(zmq.LAST_ENDPOINT)
        heard = Subscription(Endpoint.parse(place, bind=False))
        assert hears(heard, first, b"first")
    with bound(zmq.PUB, place) as second:
        assert hears(heard, second, b"second")
    heard.close()


def test_commands_are_carried_out_again_after_a_restart(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the control is away a command gets no reply; when the control is back the next command gets one."""
    with bound(zmq.REP) as first:
        place = first.getsockopt_string(zmq.LAST_ENDPOINT)
    control = partial(ask_control, Endpoint.parse(place, bind=False), None)
    monkeypatch.setattr(link, "_MAX_REPLY", 10)
    assert control({"do": "undo"}) is None
    monkeypatch.setattr(link, "_MAX_REPLY", PATIENCE * 1000)
    with bound(zmq.REP, place) as second:
        replying = threading.Thread(target=reply_once, args=(second,))
        replying.start()
        reply = control({"do": "undo"})
        replying.join()
    assert reply["classes"] == ["bow"]
