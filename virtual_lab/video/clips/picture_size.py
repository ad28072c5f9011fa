"""Sizes of pictures by their headers: a file of a few kilobytes may hold gigabytes of pixels."""

from __future__ import annotations

import warnings
from pathlib import Path

from virtual_lab.errors import InputError

LARGEST = 50e6  # pixels of a picture: a film of 8K has 33 million


def require_size(path: Path, wide: int, high: int) -> None:
    """Raise `InputError` where a picture of a file is larger than a clip's can be."""
    if wide * high > LARGEST:
        raise _too_large(path, f"{wide} x {high}")


def require_sizes(path: Path) -> None:
    """Raise `InputError` where an image file's header, of every page, says it is too large.

    What Pillow cannot read is left to the decoder.
    """
    from PIL import Image, ImageSequence

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            with Image.open(path) as image:
                sizes = [page.size for page in ImageSequence.Iterator(image)]
        except Image.DecompressionBombError as fault:
            raise _too_large(path, None) from fault
        except (OSError, SyntaxError, ValueError):
            sizes = []
    for size in sizes:
        require_size(path, *size)


def _too_large(path: Path, size: str | None) -> InputError:
    allowed = f"allowed: up to {LARGEST / 1e6:.0f} million pixels in a picture"
    return InputError(str(path), "size", size, allowed)
