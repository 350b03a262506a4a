"""The page's server with real WebSockets: one message at a time, nothing for a sleeper, rubbish closes."""

import asyncio
import json
import socket
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from contextlib import asynccontextmanager
from typing import Any

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus

from kinespace.tools.page.server import MAX_PAGES, Gate, PageServer

PATIENCE = 60.0
#: Seconds in which nothing may come; a busy machine makes the test easier, never harder.
SILENCE = 0.15


class Published:
    """What a recogniser publishes, in its place."""

    def __init__(self) -> None:
        self._ours, self._theirs = socket.socketpair()
        self._waiting: list[list[bytes]] = []
        self.bodies = False

    def fileno(self) -> int:
        """Give a file number that becomes readable."""
        return self._theirs.fileno()

    def want_bodies(self, *, wanted: bool) -> None:
        """Note whether somebody looks."""
        self.bodies = wanted

    def messages(self) -> Iterator[list[bytes]]:
        """Give what waits."""
        while self._waiting:
            self._theirs.recv(1)
            yield self._waiting.pop(0)

    def publish(self, number: int) -> None:
        """Publish an answer."""
        answer = {"performer": "ann", "class": "bow", "guess": "bow", "outcome": "named", "score": number / 1000}
        self._waiting.append([b"class/ann/", json.dumps(answer).encode()])
        self._ours.send(b".")

    def close(self) -> None:
        """Close both ends."""
        self._ours.close()
        self._theirs.close()


class FakeControl:
    """A control socket that notes what it is asked."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.meanwhile: Callable[[], None] = lambda: None

    def ask(self, command: Mapping[str, object]) -> dict[str, Any] | None:
        """Note a command; do not reply to `sleep`."""
        self.asked.append(dict(command))
        self.meanwhile()
        time.sleep(SILENCE / 3)
        if command["do"] == "sleep":
            return None
        return {"states": [], "classes": ["bow"], "taught": {}, "off": [], "sensitivity": 0.05}


class Served:
    """A running server."""

    def __init__(self, published: Published, control: FakeControl | None, address: str) -> None:
        self.published, self.control, self.address = published, control, address

    def page(self, **options: Any) -> connect:  # noqa: ANN401 - the library's own options
        """Open a page as a browser does."""
        host = self.address.removeprefix("http://").removesuffix("/")
        return connect(f"ws://{host}/live", **({"origin": f"http://{host}"} | options))


@asynccontextmanager
async def serving(control: FakeControl | None = None) -> AsyncIterator[Served]:
    """Run a server on a port that the system chooses."""
    published, addresses, ended = Published(), asyncio.Queue[str](), list[bool]()
    server = PageServer(published, control and control.ask, Gate())  # type: ignore[arg-type]  # stand-ins
    running = asyncio.create_task(server.run("127.0.0.1", 0, addresses.put_nowait, lambda: bool(ended)))
    try:
        yield Served(published, control, await asyncio.wait_for(addresses.get(), PATIENCE))
    finally:
        ended.append(True)
        await asyncio.wait_for(running, PATIENCE)
        published.close()


def run(test: Coroutine[Any, Any, None]) -> None:
    """Run a test."""
    asyncio.run(asyncio.wait_for(test, PATIENCE))


async def told(page: ClientConnection) -> dict[str, Any]:
    """Wait for the next message, and read its JSON."""
    message = await page.recv()
    assert isinstance(message, bytes)
    read: dict[str, Any] = json.loads(message[4 : 4 + int.from_bytes(message[:4], "little")])
    return read


async def drawn_until(page: ClientConnection, news: dict[str, Any], key: str) -> dict[str, Any]:
    """Say that messages were drawn until one has a key; give that one."""
    while True:
        await page.send(json.dumps({"ack": news["number"]}))
        news = await told(page)
        if key in news:
            return news


async def silent(page: ClientConnection) -> bool:
    """Say whether nothing comes for a while."""
    try:
        await asyncio.wait_for(page.recv(), SILENCE)
    except TimeoutError:
        return True
    return False


def test_a_sleeping_page_is_sent_nothing_and_then_the_newest() -> None:
    """Of ten answers a page that says nothing gets none, others all; when it says what it drew it gets the last."""

    async def test() -> None:
        async with serving() as served, served.page() as page, served.page() as other:
            first, news = await told(page), await told(other)
            assert served.published.bodies
            for number in range(1, 11):
                served.published.publish(number)
                news = await drawn_until(other, news, "answer")
                assert news["answer"]["ann"]["score"] == number / 1000
            assert await silent(page)
            await page.send(json.dumps({"ack": first["number"]}))
            assert (await told(page))["answer"]["ann"]["score"] == 0.01
            await page.send(json.dumps({"ack": first["number"]}))
            served.published.publish(200)
            assert await silent(page)

    run(test())


def test_commands_go_to_the_door_and_all_pages_learn_of_it() -> None:
    """A page's command reaches the control as it is; the reply comes back to that page, the classes to every page."""

    async def test() -> None:
        control = FakeControl()
        async with serving(control) as served, served.page() as page, served.page() as other:
            for each in (other, page):
                news = await drawn_until(each, await told(each), "control")
                assert news["control"]["classes"] == ["bow"]
            # While a command is asked, answers go on to the page.
            control.meanwhile = lambda: served.published.publish(1)
            for command, refused in (({"do": "undo"}, []), ({"do": "sleep"}, ["refused"])):
                await page.send(json.dumps({"ack": news["number"]}))
                await page.send(json.dumps({"ask": command}))
                news = await told(page)
                news = news if "replies" in news else await drawn_until(page, news, "replies")
                assert [state["state"] for reply in news["replies"] for state in reply["states"]] == refused
                assert control.asked[-1] == command

    run(test())


@pytest.mark.parametrize(
    "request_line",
    [
        *(f"GET / HTTP/1.1\r\nHost: {host}" for host in ("[", "[::1", "[]", "127.0.0.1; script-src *")),
        "GET /live?token=\xff HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://127.0.0.1",
        "GET /%00.js HTTP/1.1\r\nHost: 127.0.0.1",
        "GET /../a\0.js HTTP/1.1\r\nHost: 127.0.0.1",
    ],
)
def test_an_odd_request_leaves_no_traceback(request_line: str, caplog: pytest.LogCaptureFixture) -> None:
    """It is refused like any other."""

    async def test() -> None:
        async with serving() as served:
            host, _, port = served.address.removeprefix("http://").removesuffix("/").partition(":")
            reading, writing = await asyncio.open_connection(host, int(port))
            writing.write(f"{request_line}\r\n\r\n".encode("latin-1"))
            reply = await reading.read()
            writing.close()
            assert reply.split()[1:2] in ([b"403"], [b"404"], [])
        assert not [each for each in caplog.records if each.exc_info]

    run(test())


def test_strangers_and_crowds_are_refused() -> None:
    """A foreign origin gets no WebSocket, and no more pages are served than there is room for."""

    async def test() -> None:
        async with serving() as served:
            with pytest.raises(InvalidStatus, match="403"):
                await served.page(origin="http://evil.example")
            with pytest.raises(InvalidStatus, match="403"):
                await served.page(additional_headers={"Host": "evil.example"})
            pages = [await served.page() for _ in range(MAX_PAGES)]
            for page in pages:
                await told(page)
            with pytest.raises(InvalidStatus, match="503"):
                await served.page()
            for page in pages:
                await page.close()

    run(test())
