"""The digests of all files of a result folder, and a signature of their list.

The list has the format of ``sha256sum``. The signature is Ed25519, with a PEM key as OpenSSL writes
it. Anybody can rewrite the list, so without a signature it shows only damage and careless changes.
"""

from __future__ import annotations

import hashlib
from base64 import b64decode, b64encode
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from virtual_lab.certificate.comparing import FolderFinding, Mismatch, Unchecked
from virtual_lab.errors import InputError, of_extra
from virtual_lab.files import contents, read_bytes, read_text
from virtual_lab.records.session import digest_of_text

SUMS, SIGNATURE = "SHA256SUMS", "SHA256SUMS.sig"
TEXTS = (".csv", ".html", ".json", ".toml")  # types of files in which copying may change line ends


def require_key(path: Path, *, private: bool) -> Any:
    """Return the private or public Ed25519 key in a PEM file, an object of ``cryptography``.

    Raises `InputError` if the file cannot be read or holds no such key, if the key has a password,
    or if the extra ``sign`` is not installed.
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
        raise InputError(str(path), "key", type(key).__name__, "must be an Ed25519 key")
    return key


def write_sums(folder: Path, key: Path | None = None) -> None:
    """Write the SHA-256 digests of all files in a folder, and their signature if there is a key.

    The list is written to ``SHA256SUMS``, and its signature to ``SHA256SUMS.sig``, in base64. The
    list does not contain these two files. `key` is the file of a private key. Raises `InputError`
    if it cannot be used, as described for `require_key`.
    """
    private = None if key is None else require_key(key, private=True)
    lines = [f"{digest_of_file(folder / name)}  {name}\n" for name in list_files(folder)]
    text = "".join(lines).encode()
    (folder / SUMS).write_bytes(text)
    if private:
        (folder / SIGNATURE).write_bytes(b64encode(private.sign(text)) + b"\n")


def compared_sums(folder: Path, optional: tuple[str, ...]) -> Iterator[FolderFinding]:
    """Compare a folder with its list of digests; yield one finding per difference.

    These are mismatches: a missing list, a missing file, a file that is not listed, and a changed
    file. Changed line ends are not a mismatch. `optional` holds the names of folders directly in
    `folder`. If such a folder is listed but missing, one finding reports it as unchecked.
    """
    try:
        lines = _text_of_sums(folder).decode(errors="replace").split("\n")
    except InputError as fault:
        yield Mismatch(file=SUMS, key="", stated=fault.allowed, expected="")
        return
    stated = [(name, digest) for digest, _, name in (line.partition("  ") for line in lines[:-1])]
    absent = {top for top in optional if not (folder / top).exists()}
    there = [each for each in stated if each[0].split("/")[0] not in absent]
    yield from compared_digests(folder, there)
    for name in sorted({*list_files(folder)} - {name for name, _ in stated}):
        yield Mismatch(file=name, key="sha256", stated=f"is not listed in {SUMS}", expected="")
    for top in sorted(absent & {name.split("/")[0] for name, _ in stated}):
        yield Unchecked(f"{top}: the folder is missing")


def compared_digests(folder: Path, stated: Iterable[tuple[str, str]]) -> Iterator[FolderFinding]:
    """Yield a mismatch for each file in pairs of name and digest that is changed or missing.

    Changed line ends are not a mismatch.
    """
    here = {*list_files(folder)}
    for name, digest in stated:
        actual = digest_of_file(folder / name) if name in here else "the file is missing"
        if actual != digest and not _same_lines(folder / name, digest, name in here):
            yield Mismatch(file=name, key="sha256", stated=actual, expected=str(digest))


def signature_fault(folder: Path, key: Path) -> Mismatch | Unchecked | None:
    """Return the fault of the signature of the list of digests, None if it is valid.

    A missing signature leaves the list unchecked; one that is not valid is a mismatch. `key` is the
    file of the public key. Raises `InputError` if the key cannot be used, as described for
    `require_key`.
    """
    public = require_key(key, private=False)
    if not (folder / SIGNATURE).exists():
        return Unchecked(f"{SIGNATURE}: the maker is unknown")
    from cryptography.exceptions import InvalidSignature

    try:
        public.verify(b64decode(read_text(folder / SIGNATURE)), _text_of_sums(folder))
    except InputError as fault:
        return Mismatch(file=SIGNATURE, key="signature", stated=fault.allowed, expected="")
    except (InvalidSignature, ValueError):
        wrong = "was made with another key, or for another list"
        return Mismatch(file=SIGNATURE, key="signature", stated=wrong, expected="")
    return None


def _text_of_sums(folder: Path) -> bytes:
    return read_bytes(folder / SUMS).replace(b"\r\n", b"\n")


def list_files(folder: Path) -> list[str]:
    """Return the paths of all files in a folder, except for the list of digests and its signature.

    Litter is left out.
    """
    return [
        name
        for name, kind in contents(folder).items()
        if kind == "file" and name not in (SUMS, SIGNATURE)
    ]


def digest_of_file(path: Path) -> str:
    """Return the SHA-256 of a file, as 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _same_lines(path: Path, digest: str, exists: bool) -> bool:
    """Return whether a text file has this digest after its line ends are converted."""
    return exists and path.suffix in TEXTS and digest_of_text(read_bytes(path)) == digest
