"""Files that come from the browser: they are stored below the folder of the page."""

from __future__ import annotations

import shutil
import zipfile
from filecmp import cmp
from pathlib import Path, PurePosixPath

from starlette.requests import Request

from virtual_lab.errors import InputError
from virtual_lab.files import first_free, inside, whole_file

LARGEST_UPLOAD = 2**30  # largest file, and largest content of a zip file [B]
MOST_FILES = 10_000
UPLOADS = "uploads"


async def receive(request: Request, folder: Path) -> Path:
    """Store the body of a request below a folder, and return the path of its file or folder.

    The query states the name of the file, and for a file of a folder the path in it. A zip file is
    unpacked into a folder. Raises `InputError` for a name that leads elsewhere, for a zip file that
    is damaged or too large, and if the disk is full.
    """
    home = folder / UPLOADS
    name = request.query_params.get("name", "")
    parts = _parts(name)
    earlier = inside(home, "/".join(parts), name, "file")
    path = first_free(earlier) if len(parts) == 1 else earlier
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as file:
            async for chunk in request.stream():
                file.write(chunk)
        if path != earlier and cmp(earlier, path, shallow=False):  # the same file once more
            path.unlink()
            return earlier
        return _unpack(path) if path.suffix.lower() == ".zip" else path
    except OSError as fault:
        allowed = f"The file cannot be stored: {fault.strerror}."
        raise InputError("", "name", name, allowed) from fault


def _parts(name: str) -> tuple[str, ...]:
    """Return the parts of a path. Raises `InputError` if it is empty or leads elsewhere."""
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if not parts or any(part in ("..", "/") or {":", "\0"} & {*part} for part in parts):
        raise InputError("", "name", name, f"The name “{name}” cannot be used.")
    return parts


def _unpack(path: Path) -> Path:
    """Unpack a zip file into a new folder beside it, and remove it. Return the folder."""
    target = first_free(path.with_suffix(""))
    try:
        with zipfile.ZipFile(path) as archive:
            members = [each for each in archive.infolist() if not each.is_dir()]
            size = sum(each.file_size for each in members)
            if len(members) > MOST_FILES or size > LARGEST_UPLOAD:
                allowed = "A zip file may hold at most 10 000 files and 1 GB."
                raise InputError("", "name", path.name, allowed)
            for each in members:
                _parts(each.filename)
            archive.extractall(target, members)
    except (zipfile.BadZipFile, OSError, RuntimeError, InputError) as fault:
        shutil.rmtree(target, ignore_errors=True)
        if isinstance(fault, InputError):
            raise
        raise InputError("", "name", path.name, "This zip file cannot be unpacked.") from fault
    finally:
        path.unlink(missing_ok=True)
    inner = list(target.iterdir())
    return inner[0] if len(inner) == 1 and inner[0].is_dir() else target
