"""Certificates for Zenoh (TLS): who may join, and whom we join; made and kept next to the keys for ZeroMQ.

A folder holds our own certificate, `NAME.pem`, its secret key, `NAME.pem_secret`, and the certificates, `*.pem`, of all
that are admitted. Each certificate stands for itself. Zenoh would believe a certificate that an admitted key has
signed; what it sends is dropped, and it gets nothing, unless it bears an admitted name.
"""

from __future__ import annotations

import base64
from datetime import UTC, datetime, timedelta
from pathlib import Path

from kinespace.stream.zeromq.keys import SECRET_MODE, both_or_none, require_own

#: The ending of a certificate.
PUBLIC = ".pem"
#: The ending of its secret key.
SECRET = ".pem_secret"  # noqa: S105 - an ending
#: How long a certificate lasts.
_LASTS = timedelta(days=3650)


def make_certificate(folder: Path, name: str) -> tuple[Path, Path]:
    """Make a certificate in a folder that exists; give its file, for all others, and the file with the secret key.

    Raises
    ------
    ImportError
        The package `cryptography` is not installed.
    FileExistsError
        There is one of that name.
    """
    from cryptography import x509  # noqa: PLC0415 - an extra
    from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415 - as above
    from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415 - as above

    key, own = ec.generate_private_key(ec.SECP256R1()), x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    # From yesterday on: the clock of another machine may be behind ours.
    since, number = datetime.now(UTC) - timedelta(days=1), x509.random_serial_number()
    made = x509.CertificateBuilder(own, own, key.public_key(), number, since, since + _LASTS)
    pem, nobody = serialization.Encoding.PEM, serialization.NoEncryption()
    with both_or_none(folder / f"{name}{PUBLIC}", folder / f"{name}{SECRET}") as (public, secret):
        secret.touch(SECRET_MODE, exist_ok=False)
        secret.write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, nobody))
        public.write_bytes(made.sign(key, hashes.SHA256()).public_bytes(pem))
    return public, secret


#: All that is sent by Zenoh.
_MESSAGES = (
    *("put", "delete", "query", "reply", "declare_subscriber", "declare_queryable"),
    *("liveliness_token", "liveliness_query", "declare_liveliness_subscriber"),
)


def admitting(folder: Path) -> dict[str, object]:
    """Give Zenoh's configuration by the certificates in a folder, both ends of each connection proved and named there.

    Raises
    ------
    ValueError
        There is not exactly one secret key, or others may read it, or may add certificates.
    OSError
        A file cannot be read.
    """
    secrets = sorted(folder.glob(f"*{SECRET}"))
    if len(secrets) != 1:
        raise ValueError(f"keys: expected one file *{SECRET} in {folder}, got {len(secrets)}")
    require_own(secrets[0])
    from cryptography import x509  # noqa: PLC0415 - an extra

    known = b"".join(path.read_bytes() for path in sorted(folder.glob(f"*{PUBLIC}")))
    try:
        subjects = [each.subject for each in x509.load_pem_x509_certificates(known)]
    except (ValueError, x509.InvalidVersion) as error:
        raise ValueError(f"keys: expected certificates in {folder}, got {error}") from error
    names = [str(each.value) for name in subjects for each in name.get_attributes_for_oid(x509.NameOID.COMMON_NAME)]
    everything = {"id": "all", "permission": "allow", "messages": _MESSAGES, "flows": ["ingress", "egress"]}
    access = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [everything | {"key_exprs": ["**"]}],
        "subjects": [{"id": "known", "cert_common_names": names}],
        "policies": [{"rules": ["all"], "subjects": ["known"]}],
    }
    own = {"certificate": str(secrets[0].with_suffix(PUBLIC)), "private_key": str(secrets[0])}
    ends = {f"{end}_{what}": path for end in ("listen", "connect") for what, path in own.items()}
    # The certificates that are there are known one by one; the host that they are on says nothing more.
    ours = {"enable_mtls": True, "verify_name_on_connect": False}
    tls = {"root_ca_certificate_base64": base64.b64encode(known).decode(), **ours, **ends}
    return {"transport/link/tls": tls, "access_control": access}
