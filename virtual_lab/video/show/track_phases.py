"""What `virtual-lab track --phases` prints and writes: whether places lean with the phase."""

from __future__ import annotations

import csv
from pathlib import Path

from virtual_lab.errors import InputError
from virtual_lab.video.track.phase import PhaseBias, phase_bias
from virtual_lab.video.track.tracking import Tracked

__all__ = ["phases_of", "phases_text", "write_phases"]

Found = dict[tuple[str, str], PhaseBias | str]  # by flight and axis; words where none can tell


def phases_of(tracked: Tracked) -> Found:
    """Return the bias of the places of each flight along each axis, or why there is none."""
    located, legs = tracked.located, tracked.legs
    found: Found = {}
    for flight, used in (("in", legs.used_in), ("out", legs.used_out)):
        for axis, places in (("x", located.x), ("y", located.y)):
            if not used.any():
                continue
            try:
                found[flight, axis] = phase_bias(places[used], tracked.times[used])
            except InputError as fault:
                found[flight, axis] = f"{fault.key}: {fault.value}, {fault.allowed}"
    return found


def phases_text(found: Found) -> str:
    """Return a line a flight and axis."""
    lines = ["bias by the phase between pixels"]
    for (flight, axis), bias in found.items():
        if isinstance(bias, str):
            lines.append(f"  {flight}, {axis}: cannot be told ({bias})")
            continue
        verdict = "SEEN" if bias.seen else "none seen"
        lines.append(
            f"  {flight}, {axis}: {verdict}; {bias.bias:.4f} px at the worst phase, "
            f"u {bias.bias_u:.4f}; {bias.frames} frames that scatter by {bias.scatter:.4f} px"
        )
    return "\n".join(lines)


def write_phases(found: Found, path: Path) -> None:
    """Write the mean error at each phase as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("flight", "axis", "phase_px", "mean_error_px", "frames"))
        for (flight, axis), bias in found.items():
            if isinstance(bias, str):
                continue
            for phase, mean, count in zip(bias.phases, bias.means, bias.counts, strict=True):
                writer.writerow((flight, axis, f"{phase:g}", f"{mean:.6g}" if count else "", count))
