"""The page's link to a recogniser that ends and comes again."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import zmq

from kinespace.stream.zeromq import Endpoint
from kinespace.tools.page.process import Subscription

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


def test_answers_come_again_after_a_restart() -> None:
    """A subscription hears the recogniser that takes the address of one that has ended."""
    with bound(zmq.PUB) as first:
        place = first.getsockopt_string(zmq.LAST_ENDPOINT)
        heard = Subscription(Endpoint.parse(place, bind=False))
        assert hears(heard, first, b"first")
    with bound(zmq.PUB, place) as second:
        assert hears(heard, second, b"second")
    heard.close()
