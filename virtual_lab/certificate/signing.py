"""A signature over all files of a result folder: the list of their digests, and its signature.

The list is that of ``sha256sum``; the signature is Ed25519, by a key in PEM as OpenSSL writes it.
"""

from __future__ import annotations

import hashlib
from base64 import b64decode, b64encode
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from virtual_lab.errors import InputError, of_extra
from virtual_lab.files import contents, read_bytes, read_text

SUMS, SIGNATURE = "SHA256SUMS", "SHA256SUMS.sig"


class Unsigned(NamedTuple):
    """A file that is not the one that was signed."""

    file: str
    stated: str
    found: str


def require_key(path: Path, *, private: bool) -> Any:
    """Return the Ed25519 key in a file.

    `InputError` where it holds none of this kind, or the extra ``sign`` is missing.
    """
    of_extra("cryptography", "sign", "a signature")
    from cryptography.hazmat.primitives.asymmetric import ed25519
    from cryptography.hazmat.primitives.serialization import load_pem_private_key as read_private
    from cryptography.hazmat.primitives.serialization import load_pem_public_key as read_public

    data = read_bytes(path, most=1e5)
    try:
        key: Any = read_private(data, None) if private else read_public(data)
    except (ValueError, TypeError) as fault:
        allowed = f"must be {'a private' if private else 'a public'} key in PEM, without a password"
        raise InputError(str(path), "key", None, allowed) from fault
    kind = ed25519.Ed25519PrivateKey if private else ed25519.Ed25519PublicKey
    if not isinstance(key, kind):
        raise InputError(str(path), "key", type(key).__name__, "must be of the kind Ed25519")
    return key


def sign(folder: Path, key: Path) -> None:
    """Write the digests of all files in a folder, and their signature; errors as `require_key`."""
    private = require_key(key, private=True)
    digests = {name: _digest(folder / name) for name in _signed(folder)}
    text = "".join(f"{digest}  {name}\n" for name, digest in digests.items())
    (folder / SUMS).write_bytes(text.encode())
    (folder / SIGNATURE).write_bytes(b64encode(private.sign(text.encode())) + b"\n")


def unsigned(folder: Path, key: Path, unopened: str) -> Iterator[Unsigned]:
    """Yield the files of a folder that are not those that the owner of a public key signed.

    Those in the folder `unopened` may be missing and are not read. `InputError` as `require_key`.
    """
    from cryptography.exceptions import InvalidSignature

    public = require_key(key, private=False)
    try:
        text, signature = read_bytes(folder / SUMS), read_text(folder / SIGNATURE)
        public.verify(b64decode(signature), text)
    except InputError as fault:
        yield Unsigned(Path(fault.where).name, "", fault.allowed)
        return
    except (InvalidSignature, ValueError):
        yield Unsigned(SIGNATURE, "", "is not of this key, or not of this list")
        return
    lines = (line.partition("  ") for line in text.decode().splitlines())
    listed = {name: digest for digest, _, name in lines}
    here = _signed(folder)
    for name, digest in listed.items():
        if name.split("/")[0] == unopened:
            continue
        found = _digest(folder / name) if name in here else "the file is missing"
        if found != digest:
            yield Unsigned(name, digest, found)
    for name in here:
        if name not in listed:
            yield Unsigned(name, "", "was not signed")


def _signed(folder: Path) -> list[str]:
    return [name for name in contents(folder) if name not in (SUMS, SIGNATURE)]


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
