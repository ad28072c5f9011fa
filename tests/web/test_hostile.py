"""Requests that no page of ours sends: one sentence each, and nothing is left."""

from __future__ import annotations

import errno
import json
import os
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO

import pytest

from tests.web.visiting import TOKEN, Visitor, clip_of, words_of


def zipped(promised: int = 0, **files: bytes) -> bytes:
    """Return a zip file. Its directory promises so many bytes more of each file than there are."""
    content = BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
        for each in archive.infolist():
            each.file_size += promised
    return content.getvalue()


def test_the_door_is_shut_to_strangers_and_large_forms(visitor: Visitor) -> None:
    """Twenty at once, also with the address that was used. The owner is served meanwhile."""
    refused = [(403, {"host": "evil.example"}), (403, {"cookie": ""})]
    refused += [(403, {"origin": "null"}), (413, {"content_length": "65537"})]
    for path in ("/form/certify", "/quit", "/run/1/cancel"):
        for status, headers in refused:
            answer = visitor.ask(path, b"bat=r161", **headers)
            assert (answer.status, answer.text.count("<p>")) == (status, 1)
    assert visitor.ask("/upload?name=a", b"", content_length=str(2**31)).status == 413
    with ThreadPoolExecutor(20) as pool:
        paths = ["/", f"/?token={TOKEN}"] * 20
        answers = list(pool.map(lambda path: visitor.ask(path, cookie="").status, paths))
    assert answers == [403] * 40
    assert "Start the program again for another address" in visitor.ask("/", cookie="").text
    assert visitor.door.last_request == 0  # strangers do not keep the page open
    for path in ("/run/1", "/run/1/file?name=../secret.txt", "/form/x", "/nowhere"):
        assert visitor.ask(path).status == 404
    assert visitor.ask("/").status == 200
    began = time.monotonic()
    assert visitor.ask("/icon.svg").status == 200  # as an open page asks once per minute
    assert began <= visitor.door.last_request
    assert (list(visitor.page.folder.iterdir()), visitor.quits) == ([], [])


NAMES = "..%2Fsecret.txt %2Fetc%2Fx a%2F..%2F..%2Fx C%3A%5Cx .. ..%5Csecret.txt a%00b"
ZIPS = {
    "climbs": zipped(**{"../secret.txt": b"x"}),
    "absolute": zipped(**{"/secret.txt": b"x"}),
    "bomb": zipped(2**29, a=b"x", b=b"x", c=b"x"),
    "damaged": zipped(a=b"x")[:40],
}


@pytest.mark.parametrize("name", ["", *NAMES.split(), *ZIPS])
def test_an_upload_stays_below_its_folder_or_leaves_nothing(visitor: Visitor, name: str) -> None:
    (visitor.page.folder.parent / "secret.txt").write_text("secret")
    name, content = ("records.zip", ZIPS[name]) if name in ZIPS else (name, b"data")
    answer = visitor.ask(f"/upload?name={name}", content)
    assert (answer.status, json.loads(answer.body)["fault"][-1]) == (422, ".")
    files = [path for path in visitor.page.folder.parent.rglob("*") if path.is_file()]
    assert [path.read_text() for path in files] == ["secret"]


def test_uploads_are_stored_once_and_offered(visitor: Visitor) -> None:
    """A file, a file of a folder, and the folder in a zip."""
    uploads = visitor.page.folder / "uploads"
    folder = zipped(**{"mine/session": b"", "mine/laboratory": b""})
    for name, content, stored in (
        ("ball.mp4", b"clip", "ball.mp4"),
        ("ball.mp4", b"clip", "ball.mp4"),
        ("ball.mp4", b"film", "ball-2.mp4"),  # as long, but another one
        ("records%2Fsession.json", b"{}", "records/session.json"),
        ("mine.zip", folder, "mine/mine"),
    ):
        answer = json.loads(visitor.ask(f"/upload?name={name}", content).body)
        assert (answer["title"], answer["path"]) == (f"uploads/{stored}", str(uploads / stored))
        assert answer["folder"] == str(uploads / stored.partition("/")[0])
    files = {str(path.relative_to(uploads)) for path in uploads.rglob("*") if path.is_file()}
    assert files == {
        *("ball.mp4", "ball-2.mp4", "records/session.json"),
        *("mine/mine/session", "mine/mine/laboratory"),
    }
    assert f'value="{uploads / "ball.mp4"}"' in visitor.ask("/form/track").text
    assert f'value="{uploads / "records"}"' in visitor.ask("/form/reduce").text


def test_a_full_disk_is_one_sentence(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither an upload nor a run leaves a file or a folder of a run."""

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    upload = json.loads(visitor.ask("/upload?name=a.mp4", b"data").body)["fault"]
    assert upload == "The file cannot be stored: No space left on device."
    answer = visitor.ask("/form/show", b"name=r161")
    assert answer.status == 422
    assert "cannot be written (No space left on device)" in words_of(answer)
    assert {path.name for path in visitor.page.folder.rglob("*")} == {"runs", "uploads"}


def test_only_clips_of_the_folder_are_shown(visitor: Visitor) -> None:
    home = visitor.page.folder
    outside, within = clip_of(home.parent / "a.avi"), clip_of(home / "a.avi")
    (home / "link.avi").symlink_to(outside)
    for path in (outside, f"{home}/../a.avi", home / "link.avi", "/etc/passwd", "%00", ""):
        assert visitor.ask(f"/clip?path={path}").status == 404
    sizes, pictures, address = [], [], f"/clip?path={within}"
    for first in (0, 5):  # the file is replaced
        clip_of(within, first)
        assert visitor.ask(f"{address}&frame={12 - first}").status == 404
        sizes.append(json.loads(visitor.ask(address).body))
        pictures.append(visitor.ask(f"{address}&frame=3"))
        assert pictures[-1].headers["content-type"] == "image/jpeg"
    states = {each.pop("state") for each in sizes}
    assert sizes == [{"count": 12 - each, "width": 320, "height": 240} for each in (0, 5)]
    assert (len(states), pictures[0].body == pictures[1].body) == (2, False)
