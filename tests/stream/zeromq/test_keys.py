"""Keys: files that only their owner reads, and sockets that only peers with known keys reach."""

import os
import stat
from contextlib import ExitStack
from pathlib import Path

import pytest
import zmq
from programs import LOOPBACK, PATIENCE
from zmq import Socket
from zmq.auth import load_certificate

from kinespace.stream.zeromq import Endpoint, Keyring, ZmqReceiver, ZmqSender
from kinespace.stream.zeromq.keys import make_keys
from kinespace.tools.cli.main import main

#: Milliseconds in which a stranger, who must not be let in, is surely refused; the result does not depend on it.
A_MOMENT = 150


def folders(place: Path, *names: str) -> list[Path]:
    """Make a folder of keys for each name; the first knows all, the others know the first."""
    made = [place / name for name in names]
    publics = [make_keys(folder, folder.name)[0] for folder in made]
    for folder, public in zip(made[1:], publics[1:], strict=True):
        (made[0] / public.name).write_bytes(public.read_bytes())
        (folder / publics[0].name).write_bytes(publics[0].read_bytes())
    return made


def test_key_files_are_in_zmqs_format_and_private(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The program makes a folder with both files; no other user reads them, and the pair is one."""
    assert main(["keys", "ann", "--keys", str(tmp_path / "mine")]) == 0
    assert "secret, keep it here" in capsys.readouterr().out
    public, secret = tmp_path / "mine" / "ann.key", tmp_path / "mine" / "ann.key_secret"
    shown, (known, kept) = load_certificate(public), load_certificate(secret)
    assert shown == (known, None)
    assert kept
    assert zmq.curve_public(kept) == known
    if os.name == "posix":
        assert [stat.S_IMODE(each.stat().st_mode) for each in (public, secret)] == [0o600, 0o600]
        assert stat.S_IMODE((tmp_path / "mine").stat().st_mode) == 0o700
    before = secret.read_bytes()
    assert main(["keys", "ann", "--keys", str(tmp_path / "mine")]) == 2
    assert "there are keys of this name already" in capsys.readouterr().err
    assert secret.read_bytes() == before


@pytest.mark.skipif(os.name != "posix", reason="other systems have other rights")
@pytest.mark.parametrize("name", ["", "ann.key", "stage.key"])
def test_where_anybody_may_add_keys_nobody_is_let_in(tmp_path: Path, name: str) -> None:
    """The folder, and every key in it, is its owner's alone to write."""
    stage, _ = folders(tmp_path, "stage", "ann")
    (stage / name).chmod(0o777 if not name else 0o666)
    with pytest.raises(ValueError, match="expected what its owner alone may write to"):
        Keyring(stage)


@pytest.mark.parametrize("name", ["", "../ann", ".ann", "an\nn", "a*"])
def test_a_name_that_is_no_files_is_refused(tmp_path: Path, name: str) -> None:
    """Keys are written into the folder, and nowhere else."""
    with pytest.raises(ValueError, match="expected a name for files"):
        make_keys(tmp_path, name)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    """No secret key, two of them, one that others may read, and a file that holds no key."""
    with pytest.raises(ValueError, match="expected one file"):
        Keyring(tmp_path)
    _, secret = make_keys(tmp_path, "ann")
    _, other = make_keys(tmp_path, "ben")
    with pytest.raises(ValueError, match="expected one file"):
        Keyring(tmp_path)
    other.unlink()
    if os.name == "posix":
        secret.chmod(0o640)
        with pytest.raises(ValueError, match=r"chmod 600.*got mode 640"):
            Keyring(tmp_path)
        secret.chmod(0o600)
    (tmp_path / "ben.key").write_text("public-key\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"ben\.key: expected public-key = "):
        Keyring(tmp_path)
    for key in ("too short", "#" * 40):
        (tmp_path / "ben.key").write_text(f'curve\n    public-key = "{key}"\n', encoding="utf-8")
        with pytest.raises(ValueError, match="expected keys of 40 characters"):
            Keyring(tmp_path)


def test_several_keys_of_others_are_refused_for_connecting(tmp_path: Path) -> None:
    """With several keys beside its own a socket cannot know which one to connect to, and says so."""
    stage, *_ = folders(tmp_path, "stage", "ann", "ben")
    with Keyring(stage) as keyring, pytest.raises(ValueError, match="to connect to, got ann, ben"):
        ZmqSender(Endpoint(f"tcp://{LOOPBACK}:1", bind=False), keyring)


def heard(publisher: ZmqSender, subscriber: Socket[bytes], *, longest: int) -> bool:
    """Publish until the subscriber hears something; whether it did, after so many milliseconds at most."""
    for _ in range(longest // 10):
        publisher.send([b"hello"])
        if subscriber.poll(10):
            return True
    return False


def test_only_known_keys_are_let_in_on_both_ends(tmp_path: Path) -> None:
    """A peer with a known key is heard and hears; a peer with another key, or without one, does neither."""
    stage, ann = folders(tmp_path, "stage", "ann")
    _, eve = folders(tmp_path / "elsewhere", "stage", "eve")
    # Eve knows the stage's public key: that does not let her in.
    (eve / "stage.key").write_bytes((stage / "stage.key").read_bytes())
    anywhere = Endpoint(f"tcp://{LOOPBACK}:*", bind=True)
    with ExitStack() as opened:
        ours, anns, eves = (opened.enter_context(Keyring(folder)) for folder in (stage, ann, eve))
        frames, answers = ZmqReceiver(anywhere, keyring=ours), ZmqSender(anywhere, ours)
        opened.callback(frames.close)
        opened.callback(answers.close)
        frames_to, answers_at = Endpoint(frames.address, bind=False), Endpoint(answers.address, bind=False)
        for keyring, let_in in ((anns, True), (eves, False), (None, False)):
            sender, listener = ZmqSender(frames_to, keyring), ZmqReceiver(answers_at, keyring=keyring)
            longest = int(PATIENCE * 1000) if let_in else A_MOMENT
            assert heard(sender, frames.socket, longest=longest) is let_in
            assert heard(answers, listener.socket, longest=longest) is let_in
            while frames.receive():
                assert frames.sender
                assert frames.sender[0] == "key ann"
            sender.close()
            listener.close()


def test_a_program_with_keys_reaches_known_keys_alone(tmp_path: Path) -> None:
    """A program with keys connects to the owner of a known key, and to no other listener there."""
    _, ann = folders(tmp_path, "stage", "ann")
    impostor = ZmqReceiver(Endpoint(f"tcp://{LOOPBACK}:*", bind=True))
    with Keyring(ann) as keyring:
        sender = ZmqSender(Endpoint(impostor.address, bind=False), keyring)
        assert not heard(sender, impostor.socket, longest=A_MOMENT)
        sender.close()
    impostor.close()


@pytest.mark.parametrize(
    ("address", "others"),
    [
        ("tcp://127.0.0.1:9320", False),
        ("tcp://localhost:9320", False),
        ("tcp://[::1]:9320", False),
        ("ipc:///tmp/feed", False),
        ("tcp://0.0.0.0:9320", True),
        ("tcp://*:9320", True),
        ("tcp://eth0:9320", True),
        ("tcp://127.0.0.1:1;0.0.0.0:9320", True),
        ("tcp://localhost.example:9320", True),
        ("tcp://127.0.0.1.example:9320", True),
        ("tcp://192.168.0.7:9320", True),
    ],
)
def test_addresses_open_to_others_are_detected(address: str, others: bool) -> None:  # noqa: FBT001 - a parameter of the test
    """Addresses of this machine alone are told from addresses that others reach."""
    assert Endpoint(address, bind=True).is_open_to_others is others


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "option"),
    [
        ("live --zmq-in tcp://*:*", "--zmq-in"),
        ("live --osc-in 127.0.0.1:0 --teach {}/mine.npz --control tcp://*:*", "--control"),
        ("replay squat1Reps --listen @tcp://*:*", "--listen"),
    ],
)
def test_programs_refuse_in_one_line(
    options: str, option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names the option, the address, and the three ways to open it."""
    assert main(options.format(tmp_path).split()) == 2
    (line,) = [each for each in capsys.readouterr().err.splitlines() if each.startswith("kinespace: ")]
    assert line.startswith(f"kinespace: {option}: expected --keys, --allow-from or --open with tcp://*:*, because ")
