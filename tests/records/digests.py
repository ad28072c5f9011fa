"""Digests of channels in ``session.json``, computed as docs/raw-records.md describes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def channel_digest(session: Mapping[str, Any], path: Path) -> str:
    """Return the digest of a channel's file in ``session.json``."""
    simulation = session.get("simulation")
    start = json.dumps(simulation, sort_keys=True) if simulation else ""
    return hashlib.sha256(start.encode() + path.read_bytes()).hexdigest()
