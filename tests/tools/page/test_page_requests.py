"""Who is let in, and what an open page may say."""

import json
from importlib import resources

import pytest
from websockets.http11 import Response

from kinespace.tools.page.server import MAX_MESSAGE, Gate, read_message

_ELSEWHERE = ("http://", "https://")


def _status(gate: Gate, target: str, **headers: str) -> int:
    reply = gate.answer(target, headers)
    return 101 if reply is None else reply.status_code


# --- the gate ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "127.0.0.1:8010"},
        {"host": "127.0.0.1:8010", "origin": "http://evil.example"},
        {"host": "127.0.0.1:8010", "origin": "http://127.0.0.1:9999"},
        {"host": "127.0.0.1:8010", "origin": "https://127.0.0.1:8010"},
        {"host": "127.0.0.1:8010", "origin": "null"},
        {"host": "evil.example:8010", "origin": "http://evil.example:8010"},
        {"host": "127.0.0.1.evil.example", "origin": "http://127.0.0.1.evil.example"},
        {"host": "evil@127.0.0.1:8010", "origin": "http://evil@127.0.0.1:8010"},
        {"host": "", "origin": "http://"},
        *({"host": f"{odd}", "origin": f"http://{odd}"} for odd in ("[", "[::1", "[]", "127.0.0.1:1; script-src *")),
        {"origin": "http://127.0.0.1:8010"},
    ],
)
def test_foreign_origins_and_hosts_are_refused(headers: dict[str, str]) -> None:
    """A page of another site, or one that calls this machine by a name of its own, opens no WebSocket."""
    assert _status(Gate.for_host("127.0.0.1"), "/live", **headers) == 403


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.0.7", "stage.local", "::"])  # noqa: S104 - nothing is bound
def test_other_machines_need_the_token(host: str) -> None:
    """Where others can reach us, only the token in the address opens a WebSocket, and two gates have different ones."""
    gate = Gate.for_host(host)
    assert len(gate.token) >= 20
    assert gate.token != Gate.for_host(host).token
    headers = {"host": "192.168.0.7:8010", "origin": "http://192.168.0.7:8010"}
    assert _status(gate, "/live", **headers) == 401
    assert _status(gate, f"/live?token={gate.token[:-1]}", **headers) == 401
    assert _status(gate, "/live?token=é", **headers) == 401
    assert _status(gate, f"/live?token={gate.token}", **headers) == 101


@pytest.mark.parametrize(
    "target", ["/../requests.py", "/static/page.js", "/%2e%2e/requests.py", "/page.py", "/..", "/.", "//x", "/a\\b.js"]
)
def test_only_the_pages_own_files_are_given(target: str) -> None:
    """No path leads out of the page's folder."""
    assert _status(Gate(), target, host="localhost") == 404


_STATIC = resources.files("kinespace.tools.page") / "static"


def _given(name: str, gate: Gate | None = None) -> Response:
    reply = (gate or Gate()).answer(f"/{name}", {"host": "localhost:8010"})
    assert reply is not None
    return reply


def test_everything_that_is_given_is_guarded() -> None:
    """Every file comes with a policy that lets in nothing from elsewhere, and the page asks for nothing else."""
    for file in _STATIC.iterdir():
        text = file.read_text()
        assert "innerHTML" not in text
        assert not any(scheme in text.replace("http://www.w3.org/2000/svg", "") for scheme in _ELSEWHERE)
        reply = _given(file.name)
        assert reply.status_code == 200
        assert reply.body == file.read_bytes()
        policy = reply.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert reply.headers["X-Content-Type-Options"] == "nosniff"


# --- messages of a page ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        "{}",
        b"{}",
        '{"ack": -1}',
        '{"ack": "1"}',
        '{"ack": 1, "ask": {"do": "undo"}}',
        '{"ack": 1, "body": {}}',
        '{"body": {}}',
        '{"ask": {"do": ["undo"]}}',
        '{"ask": {"do": {"a": 1}}}',
        '{"hello": 1}',
        json.dumps({"ask": {"do": "x" * 300}}),
        json.dumps({"ask": {f"k{n}": n for n in range(20)}}),
        json.dumps({"ask": {"do": "x"}}) + " " * MAX_MESSAGE,
        "[" * 4000,
        '{"ask":' * 500,
    ],
)
def test_rubbish_of_a_page_is_refused(text: str | bytes) -> None:
    """Anything else raises ValueError, for which the page is closed."""
    with pytest.raises(ValueError, match=r"."):
        read_message(text)
