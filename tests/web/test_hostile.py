"""Requests that no page of ours sends: one sentence each, and nothing is left."""

from __future__ import annotations

import errno
import json
import os
import zipfile
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

import pytest

from tests.web.visiting import TOKEN, Visitor, clip_of


@pytest.fixture
def visitor(tmp_path: Path) -> Visitor:
    (tmp_path / "lab").mkdir()
    (tmp_path / "secret.txt").write_text("secret")
    return Visitor(tmp_path / "lab")


def zipped(promised: int = 0, **files: bytes) -> bytes:
    """Return a zip file. Its directory promises so many bytes more of each file than there are."""
    content = BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name.replace("__", "/"), data)
        for each in archive.infolist():
            each.file_size += promised
    return content.getvalue()


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "evil.example"}, 403),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"cookie": ""}, 403),
        ({"content_length": "65537"}, 413),
        ({"transfer_encoding": "chunked"}, 411),
    ],
)
def test_a_request_from_elsewhere_is_refused(
    visitor: Visitor, headers: dict[str, str], status: int
) -> None:
    for path in ("/form/certify", "/quit", "/run/1/cancel"):
        answer = visitor.ask(path, b"bat=r161", **headers)
        assert answer.status == status
        assert answer.text.count("<p>") == 1
    assert list(visitor.page.folder.iterdir()) == []
    assert not visitor.quits


def test_only_the_first_browser_enters(tmp_path: Path) -> None:
    """A look at the address spends nothing, and afterwards the token is gone from it."""
    visitor = Visitor(tmp_path, enters=False)
    assert visitor.ask("/").status == 403
    assert visitor.ask(f"/?token={TOKEN}", method="HEAD").status == 403
    assert visitor.ask(f"/?token={TOKEN}", sec_purpose="prefetch").status == 403
    assert visitor.ask(f"/?token={TOKEN}").headers["location"] == "/"
    assert visitor.ask("/").status == 200
    visitor.cookie = ""
    assert visitor.ask(f"/?token={TOKEN}").status == 403


def test_what_is_not_there_is_not_found(visitor: Visitor) -> None:
    for path in ("/run/1", "/run/1/file?name=../secret.txt", "/form/x", "/nowhere"):
        assert visitor.ask(path).status == 404


NAMES = "..%2Fsecret.txt %2Fetc%2Fx a%2F..%2F..%2Fx C%3A%5Cx .. ..%5Csecret.txt a%00b"
ZIPS = {
    "climbs": zipped(**{"..__secret.txt": b"x"}),
    "absolute": zipped(**{"__secret.txt": b"x"}),
    "bomb": zipped(2**29, a=b"x", b=b"x", c=b"x"),
    "damaged": zipped(a=b"x")[:40],
}


@pytest.mark.parametrize("name", ["", *NAMES.split(), *ZIPS])
def test_an_upload_stays_below_its_folder_or_leaves_nothing(visitor: Visitor, name: str) -> None:
    of_zip = ("records.zip", ZIPS.get(name, b""))
    name, content = of_zip if name in ZIPS else (name, b"data")
    answer = visitor.ask(f"/upload?name={name}", content)
    assert (answer.status, json.loads(answer.body)["fault"][-1]) == (422, ".")
    files = [path for path in visitor.page.folder.parent.rglob("*") if path.is_file()]
    assert [path.read_text() for path in files] == ["secret"]


def test_uploads_are_stored_once_and_offered(visitor: Visitor) -> None:
    """A file, a file of a folder, and the folder in a zip; 2 GB are refused."""
    assert visitor.ask("/upload?name=a.mp4", b"", content_length=str(2**31)).status == 413
    for _ in range(2):
        answer = visitor.ask("/upload?name=ball.mp4", b"clip")
        assert json.loads(answer.body)["title"] == "uploads/ball.mp4"
    other = visitor.ask("/upload?name=ball.mp4", b"film")  # as long, but another one
    assert json.loads(other.body)["title"] == "uploads/ball-2.mp4"
    assert visitor.ask("/upload?name=records%2Fsession.json", b"{}").status == 200
    content = zipped(mine__session=b"", mine__laboratory=b"")
    path = Path(json.loads(visitor.ask("/upload?name=mine.zip", content).body)["path"])
    assert {each.name for each in path.iterdir()} == {"session", "laboratory"}
    uploads = visitor.page.folder / "uploads"
    assert sorted(each.name for each in uploads.iterdir()) == [
        "ball-2.mp4",
        "ball.mp4",
        "mine",
        "records",
    ]
    assert f'value="{uploads / "ball.mp4"}"' in visitor.ask("/form/track").text
    assert f'value="{uploads / "records"}"' in visitor.ask("/form/reduce").text


def test_a_full_disk_is_one_sentence(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither an upload nor a run leaves a file or a folder of a run."""

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    upload = json.loads(visitor.ask("/upload?name=a.mp4", b"data").body)["fault"]
    assert upload == "The file cannot be stored: No space left on device."
    answer = visitor.submit("show", [("name", "r161")])
    assert answer.status == 422
    assert "cannot be written (No space left on device)" in answer.words
    assert visitor.page.runs.all() == []
    left = [path for path in visitor.page.folder.rglob("*") if path.name not in ("runs", "uploads")]
    assert left == []


def test_twenty_strangers_disturb_nobody(visitor: Visitor) -> None:
    """Also with the address that the owner has used; his own page is served meanwhile."""
    stranger = Visitor(visitor.page.folder, enters=False)
    stranger.door = visitor.door
    with ThreadPoolExecutor(20) as pool:
        answers = list(pool.map(lambda _: stranger.ask("/").status, range(20)))
        assert answers == [403] * 20
        assert visitor.ask("/").status == 200
        path = f"/?token={TOKEN}"  # this token has been used
        assert set(pool.map(lambda _: stranger.ask(path).status, range(20))) == {403}


def test_only_clips_of_the_folder_are_shown(visitor: Visitor) -> None:
    home = visitor.page.folder
    outside, within = clip_of(home.parent / "a.avi"), clip_of(home / "a.avi")
    (home / "link.avi").symlink_to(outside)
    for path in (outside, f"{home}/../a.avi", home / "link.avi", "/etc/passwd", "%00", ""):
        assert visitor.ask(f"/clip?path={path}").status == 404
    size = json.loads(visitor.ask(f"/clip?path={within}").body)
    state = size.pop("state")
    assert size == {"count": 12, "width": 320, "height": 240}
    assert visitor.ask(f"/clip?path={within}&frame=3").headers["content-type"] == "image/jpeg"
    assert visitor.ask(f"/clip?path={within}&frame=12").status == 404
    before = visitor.ask(f"/clip?path={within}&frame=3").body
    clip_of(within, first=5)  # the file is replaced
    assert json.loads(visitor.ask(f"/clip?path={within}").body)["state"] != state
    assert visitor.ask(f"/clip?path={within}&frame=3").body != before
    assert visitor.ask(f"/clip?path={within}&frame=7").status == 404
