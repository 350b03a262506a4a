"""Keys for ZeroMQ (CURVE): which peers may connect to us, and to whom we connect.

A folder holds our own pair of keys, `NAME.key` and `NAME.key_secret`, and the public keys, `*.key`, of all peers that
are admitted. `zmq.auth` makes, reads and checks them, so that every other program with ZeroMQ can use the same files.
"""

import os
import struct
from contextlib import ExitStack
from pathlib import Path

import zmq

#: The ending of a public key.
PUBLIC = ".key"
#: The ending of a secret key.
SECRET = ".key_secret"  # noqa: S105 - an ending
#: Mode of the file with the secret key: only its owner reads and writes it.
SECRET_MODE = 0o600
#: The domain for which ZeroMQ asks the authenticator; a socket with a domain admits no peer without an authenticator.
_DOMAIN = b"kinespace"
#: Characters of a key in Z85.
_KEY_LENGTH = 40


def make_keys(folder: Path, name: str) -> tuple[Path, Path]:
    """Make a pair of keys.

    Parameters
    ----------
    folder
        The folder for the files; made when missing.
    name
        The owner's name.

    Returns
    -------
    The file with the public key, for all others, and the file with both keys, which only its owner may read.

    Raises
    ------
    ValueError
        The name cannot be a file's name.
    FileExistsError
        Keys of that name exist already.
    """
    from zmq.auth import create_certificates  # noqa: PLC0415 - slow to load, and seldom needed

    if not name or name.startswith(".") or not name.isprintable() or set(name) & set("/\\*?[]"):
        raise ValueError(f"keys: expected a name for files, got {name!r}")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    public, secret = folder / f"{name}{PUBLIC}", folder / f"{name}{SECRET}"
    for path in (public, secret):
        if path.exists():
            raise FileExistsError(0, "there are keys of this name already", str(path))
    # No other user may read the secret key between its writing and a change of the file's mode.
    mask = os.umask(0o777 & ~SECRET_MODE)
    try:
        create_certificates(folder, name)
    except BaseException:
        for path in (public, secret):
            path.unlink(missing_ok=True)
        raise
    finally:
        os.umask(mask)
    return public, secret


class Keyring(ExitStack):
    """The keys in a folder, for the sockets of one program; `close` it after them.

    Bound sockets admit only the keys of the folder. Connected sockets reach only the owner of one key: the only other
    public key in the folder or, if there is none, our own.

    Parameters
    ----------
    folder
        A folder with one pair of keys and any number of public keys.

    Attributes
    ----------
    context
        The context of all sockets with these keys.

    Raises
    ------
    ValueError
        There is not exactly one secret key, others may read it or add keys, or a file holds no key.
    OSError
        A file cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
        secrets = sorted(folder.glob(f"*{SECRET}"))
        if len(secrets) != 1:
            raise ValueError(f"keys: expected one file *{SECRET} in {folder}, got {len(secrets)}")
        self._folder = folder
        self._public, self._secret = _keys_in(secrets[0])
        if not self._secret:
            raise ValueError(f"{secrets[0]}: expected a secret key, got a public key alone")
        require_own(secrets[0])
        #: Names by public key.
        self._names = {_keys_in(path)[0]: path.name.removesuffix(PUBLIC) for path in sorted(folder.glob(f"*{PUBLIC}"))}
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self.callback(self.context.destroy, linger=0)
        self._admits = False

    def secure(self, opened: zmq.Socket[bytes], *, bind: bool) -> None:
        """Give a socket of our context its keys, before it is bound or connected.

        Raises
        ------
        ValueError
            The socket is to connect, and several keys could be meant.
        """
        opened.setsockopt(zmq.CURVE_PUBLICKEY, self._public)
        opened.setsockopt(zmq.CURVE_SECRETKEY, self._secret)
        if not bind:
            others = [key for key in self._names if key != self._public]
            if len(others) > 1:
                names = ", ".join(self._names[key] for key in others)
                raise ValueError(f"keys: expected one key besides our own in {self._folder} to connect to, got {names}")
            opened.setsockopt(zmq.CURVE_SERVERKEY, others[0] if others else self._public)
            return
        self._admit_known_keys()
        opened.setsockopt(zmq.CURVE_SERVER, 1)
        opened.setsockopt(zmq.ZAP_DOMAIN, _DOMAIN)

    def name_of(self, key: str) -> str:
        """Name the owner of a public key, as ZeroMQ reports it with a message."""
        return self._names.get(key.encode(), key)

    def _admit_known_keys(self) -> None:
        if self._admits:
            return
        from zmq.auth.thread import ThreadAuthenticator  # noqa: PLC0415 - loads asyncio, which takes long

        authenticator, self._admits = ThreadAuthenticator(self.context), True
        authenticator.start()
        self.callback(authenticator.stop)
        authenticator.configure_curve(domain=_DOMAIN.decode(), location=self._folder)


def _keys_in(path: Path) -> tuple[bytes, bytes]:
    """Read the public key in a file, and the secret key or None."""
    from zmq.auth import load_certificate  # noqa: PLC0415 - as above

    try:
        public, secret = load_certificate(path)
    except IndexError as error:
        raise ValueError(f"{path}: expected public-key = ..., got no =") from error
    for key in (public, secret):
        if key is not None and not _is_key(key):
            raise ValueError(f"{path}: expected keys of {_KEY_LENGTH} characters, got {len(key)}")
    return public, secret or b""


def _is_key(key: bytes) -> bool:
    from zmq.utils import z85  # noqa: PLC0415 - as above

    try:
        return len(z85.decode(key)) == 32
    except (KeyError, ValueError, OverflowError, struct.error):
        return False


def require_own(secret: Path) -> None:
    """Refuse a secret that others may read, and a folder to which, or whose files, anybody may write (ValueError)."""
    if os.name != "posix":
        return
    if (mode := secret.stat().st_mode & 0o777) & 0o077:
        raise ValueError(f"{secret}: expected a file that its owner alone may read (chmod 600), got mode {mode:o}")
    for path in (secret.parent, *secret.parent.iterdir()):
        if (mode := path.stat().st_mode & 0o777) & 0o002:
            raise ValueError(f"{path}: expected what its owner alone may write to (chmod go-w), got mode {mode:o}")
