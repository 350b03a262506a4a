"""`kinespace gateway` and `work`: real processes that are fed over OSC, and stopped as a person stops them."""

import re
import shutil
import socket
import sys
import time
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from programs import LOOPBACK, PATIENCE, ghost_cues, started

from kinespace.stream import osc
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.feed import OscFrameSender
from kinespace.tools.loopback.answers import Listener, answer_in

pytest.importorskip("zenoh")


def free_place() -> str:
    """Give a Zenoh endpoint that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return f"tcp/{LOOPBACK}:{probe.getsockname()[1]}"


@pytest.mark.slow
def test_a_worker_recognises_for_a_gateway(stage: osc.OscReceiver) -> None:
    """Frames go in by OSC and answers come out, bodies are published, and Ctrl-C ends both with status 0."""
    place, cues = free_place(), ghost_cues("squat1Reps", 1.5)
    ends = ("--osc-in", f"{LOOPBACK}:0", "--osc-out", f"{LOOPBACK}:{stage.address[1]}", "--plain")
    bodies = ("--zmq-out", f"tcp://{LOOPBACK}:*", "--bodies")
    with ExitStack() as stack:
        # Machines start in any order.
        work = stack.enter_context(started("work", "--connect", place))
        work.expect(f"worker [0-9a-f]{{12}} tries to reach {place}; Ctrl-C ends")
        gateway = stack.enter_context(started("gateway", *ends, *bodies, "--listen", place))
        port = int(gateway.expect(r"listening on OSC 127\.0\.0\.1:(\d+)")[1])
        work.expect("working for gateway [0-9a-f]{12}, library [0-9a-f]{12}")
        gateway.expect("worker [0-9a-f]{12} works; workers: 1")
        until, answers = time.monotonic() + PATIENCE, []
        with closing(OscFrameSender(LOOPBACK, port)) as sender:
            listener = Listener(stage)
            # The gateway may not know yet that the worker is ready.
            while not answers and time.monotonic() < until:
                for cue in cues:
                    sender.send(sender.encode(cue))
                answers = [each for each in listener.listen_until(time.perf_counter() + 0.2) if answer_in(each.packet)]
        assert answers
        assert (gateway.interrupt(), gateway.errors) == (0, "")
        work.expect("gateway [0-9a-f]{12} is gone")
        assert (work.interrupt(), work.errors) == (0, "")
        # More frames came than a busy machine answers in time.
        assert re.search(r"refused 0, unread 0, stale \d+, missing 0\n", work.output)


def _sign(by: str, whose: str) -> None:
    """Let the owner of one certificate sign another's, as an authority does."""
    from cryptography import x509  # noqa: PLC0415 - an extra
    from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415 - as above

    key = serialization.load_pem_private_key(Path(by, f"{by}.pem_secret").read_bytes(), None)
    file, issuer = Path(whose, f"{whose}.pem"), x509.load_pem_x509_certificate(Path(by, f"{by}.pem").read_bytes())
    own = x509.load_pem_x509_certificate(file.read_bytes())
    built = x509.CertificateBuilder(
        issuer.subject, own.subject, own.public_key(), 7, own.not_valid_before_utc, own.not_valid_after_utc
    )
    file.write_bytes(built.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))


@pytest.mark.slow
def test_certificates_let_in_whom_we_know(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`kinespace keys` serves both ends: the owner of a known certificate works and is named, a stranger does not."""
    pytest.importorskip("cryptography")
    monkeypatch.chdir(tmp_path)
    for name in ("stage", "ann", "eve", "mallory"):
        assert main(["keys", name]) == 0
    shutil.copy("ann/ann.pem", "stage")
    _sign("ann", "mallory")
    for name in ("ann", "eve", "mallory"):
        shutil.copy("stage/stage.pem", name)
    assert {path.stat().st_mode & 0o777 for path in tmp_path.glob("*/*_secret")} == {0o600}
    place = free_place().replace("tcp", "tls")
    with ExitStack() as stack:
        gateway = stack.enter_context(
            started("gateway", "--osc-in", f"{LOOPBACK}:0", "--plain", "--listen", place, "--keys", tmp_path / "stage")
        )
        gateway.expect("listening on OSC")
        strangers = [
            stack.enter_context(started("work", "--connect", where, "--keys", tmp_path / "eve"))
            for where in (place, place.replace("tls", "tcp"))
        ]
        signed = stack.enter_context(started("work", "--connect", place, "--keys", tmp_path / "mallory"))
        signed.expect("no gateway is seen yet")
        known = stack.enter_context(started("work", "--connect", place, "--keys", tmp_path / "ann"))
        gateway.expect(f"worker [0-9a-f]{{12}} works; workers: 1; joined: .*ann at tls/{LOOPBACK}:")
        for stranger in strangers:
            stranger.expect("no gateway is seen yet; not reached: ")
        for each in (known, signed, *strangers, gateway):
            assert (each.interrupt(), each.errors) == (0, "")
        assert gateway.output.count(" works; ") == 1


def test_a_gateway_is_not_open_unless_that_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    """An endpoint beyond this machine without certificates is one line; so is a folder without certificates."""
    place = free_place().replace(LOOPBACK, "[::]")
    assert main(["gateway", "--osc-in", f"{LOOPBACK}:0", "--listen", place]) == 2
    assert capsys.readouterr().err.startswith(f"kinespace: --listen {place}: expected an endpoint on this machine")
    assert main(["work", "--listen", place]) == 2
    assert "--open" in capsys.readouterr().err


def test_without_zenoh_a_line_says_what_to_install(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers need an extra; the program that lacks it ends with status 2."""
    monkeypatch.setitem(sys.modules, "zenoh", None)
    assert main(["live", "--workers", "2"]) == 2
    assert capsys.readouterr().err == "kinespace: Zenoh is missing: pip install 'kinespace[cluster]'\n"
