"""Result folders that the tests of certificates copy; each is made once per process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
)

import virtual_lab as vl
from virtual_lab.certificate import verify as verifying
from virtual_lab.measurement.certification import Certification
from virtual_lab.records.session import Session


@pytest.fixture(scope="module")
def each_form_is_made_once() -> Iterator[None]:
    """Cache the forms and certifications of `verify`; their repeatability is tested elsewhere."""
    forms: dict[tuple[object, ...], Any] = {}
    files: dict[int, object] = {}  # digest of the records of a session
    load, certify = verifying.load_session, verifying.certify_session
    read_pdf = verifying.text_of_pdf

    def load_session(folder: Path) -> Session:
        key = tuple(
            (path.relative_to(folder), path.is_file() and path.read_bytes())
            for path in sorted(folder.rglob("*"))
        )
        session: Session = kept("session", key, lambda: load(folder))
        files[id(session)] = key
        return session

    def certify_session(session: Session) -> Certification:
        return kept("certification", files[id(session)], lambda: certify(session))

    def kept(kind: str, key: object, make: Callable[[], Any]) -> Any:
        if (kind, key) not in forms:
            forms[kind, key] = make()
        return forms[kind, key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verifying, "load_session", load_session)
        patch.setattr(verifying, "certify_session", certify_session)
        patch.setattr(
            verifying,
            "text_of_pdf",
            lambda path: kept("text", path.read_bytes(), lambda: read_pdf(path)),
        )
        for name in ("certificate_page", "certificate_pdf"):
            make = getattr(verifying, name)
            patch.setattr(
                verifying,
                name,
                lambda document, paper, name=name, make=make: kept(
                    name, (document.text, paper), lambda: make(document, paper)
                ),
            )
        yield


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a test with a PDF, a customer and a logo."""
    folder = tmp_path_factory.mktemp("made")
    cv2.imwrite(str(folder / "logo.png"), np.zeros((9, 9), np.uint8))
    lab = folder / "lab.toml"
    table = '[laboratory]\nname = "Bat Laboratory"\nlogo = "logo.png"\n'
    lab.write_text(f'{table}[customer]\nname = "Ashwood & Sons"\n')
    test = vl.certify("r161", seed=7, laboratory=lab)
    return test.save(folder / "result", pdf=True)


@pytest.fixture(scope="session")
def controlled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a test with a control bat."""
    folder = tmp_path_factory.mktemp("controlled")
    rules = folder / "controlled.toml"
    text = vl.procedure("bbcor").text
    rules.write_text(text.replace('method = "trampoline"', 'method = "control-bat"'))
    test = vl.certify("r161", procedure=rules, control_bat="check-cylinder", seed=7)
    return test.save(folder / "result")


@pytest.fixture(scope="session")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Save a result, a second one that replaces it, and a third one of the same records."""
    folder = tmp_path_factory.mktemp("chain")
    first, second = folder / "first", folder / "second"
    vl.certify("r161", seed=7).save(first)
    stated = {"customer": {"name": "second"}}
    named = vl.certify("r161", seed=7, laboratory=stated, replaces=first, reason="not first")
    named.save(second)
    vl.reduce(second / "records", replaces=second, reason="not second").save(folder / "third")
    return folder


@pytest.fixture(scope="session")
def keys(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Make a private key and its public part."""
    folder, private = tmp_path_factory.mktemp("keys"), Ed25519PrivateKey.generate()
    (folder / "private.pem").write_bytes(
        private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    )
    (folder / "public.pem").write_bytes(
        private.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    )
    return folder / "private.pem", folder / "public.pem"
