"""Programs found by the names that another mDNS, python-zeroconf, announces over loopback."""

from __future__ import annotations

import socket
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from programs import LOOPBACK, PATIENCE, free_udp_port, started
from recorded import write_take
from zeroconf import ServiceInfo, Zeroconf

from kinespace.stream import osc
from kinespace.tools.announcing import finding
from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from kinespace.library import MotionLibrary


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


@pytest.mark.usefixtures("alone")
def test_a_program_is_found_by_its_name() -> None:
    """Capitals do not matter; where nobody has the name, those who have others are listed."""
    with announcing("Films at home", 7123):
        found = finding.named("films At Home", ValueError("--out: expected a name"))
        assert found == ("Films at home", LOOPBACK, 7123)
        with pytest.raises(
            ValueError, match=r"--out: expected a name; announced now: Films at home \(127.0.0.1:7123\)"
        ):
            finding.named("films", ValueError("--out: expected a name"))


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


@pytest.mark.usefixtures("alone")
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
def test_live_answers_to_a_program_by_its_name(
    small_library: MotionLibrary, receiver: osc.OscReceiver, tmp_path: Path
) -> None:
    """`--out NAME` and `--out LAYOUT=NAME` send there; with --no-announce the name is a mistake."""
    small_library.save(tmp_path / "small.npz")
    port = receiver.address[1]
    name, place = f"films {port}", f"{LOOPBACK}:{port}"
    ends = ("--osc-in", f"{LOOPBACK}:0", "--library", tmp_path / "small.npz", "--plain", "--out")
    with announcing(name, port):
        with started("live", "--announce", *ends, f"{name},max={name}") as program:
            program.expect(f"answering to native {place}, max {place};")
            assert program.output.count(f"--out: {name} ({place})") == 2
            receiver.socket.settimeout(PATIENCE)
            assert (receiver.receive() or b"").startswith(b"/motion/")
        with started("live", *ends, name) as program:
            assert program.wait() == 2
            assert "--out: expected one of native" in program.errors
