"""The sensor of a camera: from expected electrons to gray values.

The model follows EMVA 1288: Poisson shot noise (Gaussian for many electrons), read noise, dark
signal, fixed maps of the differences between pixels, full well, gain, and integer gray values up
to full scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from virtual_lab.simulation.instruments.calibrated import CalibratedInstrument, draw_constants
from virtual_lab.simulation.instruments.camera.spec import SensorSpec
from virtual_lab.streams import Draws, Slots
from virtual_lab.uncertainty.estimate import Estimate

Pixels = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Sensor(CalibratedInstrument[SensorSpec]):
    """The sensor of one camera, with fixed maps of its pixels."""

    response: Pixels  # response of each pixel relative to the mean, (row, column)
    offset: Pixels  # dark signal of each pixel relative to the mean, (row, column) [e]

    @classmethod
    def commission(cls, spec: SensorSpec, draws: Draws, name: str) -> Self:
        shape = (spec.rows, spec.columns)
        response = 1 + spec.photo_response * draws.normal(f"{name}.response", shape)
        offset = spec.dark_signal * draws.normal(f"{name}.offset", shape)
        certificate = draw_constants(spec.certificate(), draws, name)
        return cls(spec, *certificate, response.astype(np.float32), offset.astype(np.float32))

    @property
    def gain(self) -> float:
        """Gray values per electron."""
        return float(self.true["gain"])

    def exact(self) -> dict[str, Estimate]:
        spec = self.spec
        return {
            "read_noise": Estimate(value=spec.read_noise),
            "photo_response": Estimate(value=spec.photo_response),
            "dark_signal": Estimate(value=spec.dark_signal),
            "black_level": Estimate(value=spec.black_level),
            "full_scale": Estimate(value=float(spec.full_scale)),
        }

    def expose(
        self,
        electrons: ArrayLike,
        corners: ArrayLike,
        draws: Draws,
        name: str,
        slots: Slots | None = None,
        exposure: float = 0.0,
    ) -> NDArray[Any]:
        """Return gray values of regions, (region, row, column).

        They are integers of 8 or 16 bits, or floats if the sensor does not digitize. `electrons`
        are the expected electrons of each pixel [e]. `corners`, (region, 2), are the first pixel
        (x, y) of each region. The noise of a region depends on its number in `slots`, by default 0,
        1, …. Dark current flows for `exposure` [s].
        """
        from virtual_lab.simulation.instruments.camera.sensor_kernel import (
            Electronics,
            expect,
            read_out,
        )

        spec = self.spec
        light = np.ascontiguousarray(electrons, dtype=np.float32)
        places = np.ascontiguousarray(corners, dtype=np.int64)
        means = np.empty_like(light)
        slots = np.arange(len(light)) if slots is None else slots
        dim = expect(light, places, self.response, spec.dark_current * exposure, means)
        kind = np.float32 if not spec.whole_counts else np.uint8 if spec.bits <= 8 else np.uint16
        out: NDArray[Any] = np.empty(light.shape, kind)
        read_out(
            means,
            places,
            self.offset,
            draws.normal(f"{name}.noise", light.shape[1:], slots),
            draws.uniform(f"{name}.shot", light.shape[1:] if dim else (0, 0), slots),
            Electronics(
                read=spec.read_noise,
                full_well=spec.full_well,
                gain=self.gain,
                black=spec.black_level,
                whole=spec.whole_counts,
                top=float(spec.full_scale),
            ),
            out,
        )
        return out

    def mean_of(
        self, electrons: Pixels, count: int, draws: Draws, name: str, exposure: float = 0.0
    ) -> Pixels:
        """Return the mean gray values of `count` whole frames of one scene, (row, column).

        `electrons` and `exposure` are the same as for `expose`. The noise of the mean is drawn
        once. It is much smaller than one gray value, so rounding is treated as additional variance.
        """
        spec = self.spec
        gathered = electrons * self.response + np.float32(spec.dark_current * exposure)
        charge = np.minimum(gathered, np.float32(spec.full_well)) + self.offset
        variance = self.gain**2 * (gathered + np.float32(spec.read_noise**2))
        if spec.whole_counts:
            variance += np.float32(1 / 12)
        noise = draws.normal(name, electrons.shape).astype(np.float32)
        grey = self.gain * charge + spec.black_level + np.sqrt(variance / count) * noise
        return np.asarray(np.clip(grey, 0.0, spec.full_scale), np.float32)
