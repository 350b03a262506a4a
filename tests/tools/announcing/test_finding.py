"""Programs found by the names that another mDNS, python-zeroconf, announces over loopback."""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import zeroconf
from programs import LOOPBACK, PATIENCE, free_udp_port, started
from recorded import write_take
from zeroconf import ServiceInfo, Zeroconf

from kinespace.stream import osc
from kinespace.tools.announcing import finding
from kinespace.tools.cli.main import main


@contextmanager
def announcing(name: str, port: int) -> Iterator[None]:
    """Announce a program that takes OSC on this machine."""
    network = Zeroconf([LOOPBACK])
    try:
        service, packed = finding.OSC_SERVICE, [socket.inet_aton(LOOPBACK)]
        network.register_service(
            ServiceInfo(service, f"{name}.{service}", port, addresses=packed, server=f"at-{port}.local.")
        )
        yield
    finally:
        network.close()


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no other test's program be found."""
    monkeypatch.setattr(finding, "OSC_SERVICE", f"_k{free_udp_port()}._udp.local.")


@pytest.fixture
def receiver() -> Iterator[osc.OscReceiver]:
    """Open a port on which answers or frames come."""
    opened = osc.OscReceiver(LOOPBACK, 0)
    yield opened
    opened.close()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search again until somebody is found: on a busy machine a program may answer after the search."""
    search = finding.announced

    def announced(wanted: str = "") -> list[finding.Found]:
        until, found = time.monotonic() + PATIENCE, search(wanted)
        while not found and time.monotonic() < until:
            found = search(wanted)
        return found

    monkeypatch.setattr(finding, "announced", announced)


@pytest.mark.slow
@pytest.mark.usefixtures("alone", "patient")
def test_a_program_is_found_by_its_name() -> None:
    """Capitals do not matter; where nobody has the name, those who have others are listed."""
    with announcing("Films at home", 7123):
        found = finding.named("films At Home", ValueError("--out: expected a name"))
        assert found == ("Films at home", LOOPBACK, 7123)
        with pytest.raises(
            ValueError, match=r"--out: expected a name; announced now: Films at home \(127.0.0.1:7123\)"
        ):
            finding.named("films", ValueError("--out: expected a name"))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x:99999",
        "127.0.0.1:931O",
        "here:",
        "127.0.0.1",
        "::1",
        "93100000",
        "tcp://here",
        "a" * 64,
        "a\n",
        "[::1]:99999",
    ],
)
def test_a_mistake_asks_no_network(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What cannot be a name is not looked for: the mistake is told at once."""
    monkeypatch.setattr(finding, "announced", lambda *_: pytest.fail("looked for"))
    with pytest.raises(ValueError, match=r"^--out: a mistake$"):
        finding.named(text, ValueError("--out: a mistake"))


def test_the_recogniser_that_is_meant(monkeypatch: pytest.MonkeyPatch, receiver: osc.OscReceiver) -> None:
    """The usual port's, if somebody has it; else this machine's before others; of several none."""
    near, far, other = (finding.Found(f"kinespace {port}", host, port) for port, host in (
        (9400, LOOPBACK), (9401, "192.0.2.1"), (9402, LOOPBACK)))  # fmt: skip
    lists = [[near, far], [far], [finding.Found("films", LOOPBACK, 7123)], [near, other]]
    monkeypatch.setattr(finding, "announced", lambda: lists.pop(0))
    taken = "{}:{}".format(*receiver.address)
    assert finding.recogniser(taken) == taken
    usual = f"{LOOPBACK}:{free_udp_port()}"
    assert [finding.recogniser(usual) for _ in range(3)] == [near.address, far.address, usual]
    with pytest.raises(ValueError, match=r"expected one of kinespace 9400 .*, kinespace 9402 .*, got none"):
        finding.recogniser(usual)


@pytest.mark.slow
@pytest.mark.usefixtures("alone", "patient")
@pytest.mark.parametrize("announced", [True, False])
def test_replay_finds_live(
    *,
    announced: bool,
    receiver: osc.OscReceiver,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Without an address frames go where a recogniser announces itself, which is said; or --no-announce."""
    monkeypatch.setattr("kinespace.tools.programs.replay.program.OSC_IN", f"{LOOPBACK}:{free_udp_port()}")
    take, port = write_take(tmp_path, "bd", "bendLeft", 1, frames=12), receiver.address[1]
    with announcing(f"kinespace {port}", port):
        status = main(["replay", str(take), *([] if announced else ["--no-announce"])])
    said = f"sending to kinespace {port} ({LOOPBACK}:{port})"
    assert (said in capsys.readouterr().err, status) == (announced, 0 if announced else 1)
    assert (receiver.receive() is not None) is announced


@pytest.mark.slow
def test_live_answers_to_a_program_by_its_name(receiver: osc.OscReceiver) -> None:
    """`--out NAME` and `--out LAYOUT=NAME` send there; with --no-announce the name is a mistake."""
    port = receiver.address[1]
    name, place = f"films {port}", f"{LOOPBACK}:{port}"
    ends = ("--osc-in", f"{LOOPBACK}:0", "--plain", "--out")
    with announcing(name, port):
        # On a busy machine a search may end before the answer comes; the program then ends, and is started again.
        until = time.monotonic() + PATIENCE
        while True:
            with started("live", "--announce", *ends, f"{name},max={name}") as program:
                if program.found(rf"answering to native {place}, max {place};") or time.monotonic() > until:
                    assert program.output.count(f"--out: {name} ({place})") == 2, program.errors
                    receiver.socket.settimeout(PATIENCE)
                    assert (receiver.receive() or b"").startswith(b"/motion/")
                    break
        with started("live", *ends, name) as program:
            assert program.wait() == 2
            assert "--out: expected one of native" in program.errors


def test_what_cannot_be_a_name_is_neither_asked_for_nor_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Anybody may announce an escape, and mDNS's library raises of some names: the others are found all the same."""
    names = ["a\x1b[31mb", "\x9b", "\u202e", "\n", "x" * 64, "raises", "films"]

    class Browser:
        def __init__(self, _: object, kind: str, handlers: list[Any]) -> None:
            for each in names:
                handlers[0](name=f"{each}.{kind}")

    def info(_: str, name: str) -> Any:  # noqa: ANN401 - as zeroconf's
        assert name.partition(".")[0] in ("raises", "films")
        if name.startswith("raises"):
            raise zeroconf.BadTypeInNameException
        told = {"load_from_cache": lambda _: True, "port": 7, "parsed_addresses": lambda: ["192.0.2.1"]}
        return SimpleNamespace(**told)

    monkeypatch.setattr(zeroconf, "ServiceBrowser", Browser)
    monkeypatch.setattr(zeroconf, "ServiceInfo", info)
    monkeypatch.setattr(zeroconf, "Zeroconf", lambda _: SimpleNamespace(close=lambda: None))
    assert finding.announced("films") == [finding.Found("films", "192.0.2.1", 7)]
