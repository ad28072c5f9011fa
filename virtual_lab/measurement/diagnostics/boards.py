"""Checks of the boards at the bat: their positions, and the heights at which balls pass them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from math import sqrt
from typing import Self

import numpy as np

from virtual_lab.measurement.diagnostics.evidence import FEWEST_SHOTS, Evidence
from virtual_lab.measurement.diagnostics.flag import Pairs, pairs
from virtual_lab.measurement.reduction.gates import INBOUND, OUTBOUND, GateReadings
from virtual_lab.measurement.reduction.shot_algebra import drag_of
from virtual_lab.records import AimMarks
from virtual_lab.relations.flight import time_before
from virtual_lab.uncertainty.budget import Components, Variants, type_a_component
from virtual_lab.uncertainty.estimate import Estimates
from virtual_lab.units import Array, Mask

WAYS = {INBOUND: "", OUTBOUND: " back"}
DROP_U = 2e-5  # uncertainty of a ball's drop, because its parabola neglects drag [m]
SCALE_U = 0.01  # uncertainty for a harmless relative difference of two boards' height scales


def boards_in_line(evidence: Evidence) -> Iterator[Pairs]:
    """Yield one comparison of surveyed and timed position per inner gate and flight direction.

    Inner gates are all gates except the first and the last. The timed position of an inner gate
    follows from the times at which a ball passed the gates. It is computed for a flight with drag
    that passes the first and the last gate at their measured times. The difference is the surveyed
    position minus the mean timed position. `Pairs.sigmas`, (laboratory,), is the absolute
    difference in units of its standard uncertainty. Nothing is yielded with fewer than three gates,
    or for instruments other than gates and light boards. A laboratory with fewer than
    `FEWEST_SHOTS` shots is not compared.
    """
    constants, best, gates = evidence.reduced.constants, evidence.best, evidence.readings.flights
    if not isinstance(gates, GateReadings):
        return
    last = _boards(gates)[-1]
    if last < 2:
        return
    of_shots = {name: value[evidence.owner, 0, 0] for name, value in best.items()}
    drag = drag_of(of_shots, evidence.shots.ball_mass)
    for direction, board in product((INBOUND, OUTBOUND), range(1, last)):
        along = drag if direction == INBOUND else -drag
        unit_times = [time_before(of_shots[_distance(k)], 1.0, along) for k in range(last + 1)]
        times = gates.passages.times[:, direction]
        part = (times[:, board] - times[:, 0]) / (times[:, last] - times[:, 0])
        deviation = unit_times[board] - unit_times[0] - part * (unit_times[last] - unit_times[0])
        mask = evidence.reduced.valid & np.isfinite(deviation)
        mean, u, number = evidence.mean_of(deviation, mask)
        share, _, _ = evidence.mean_of(part, mask)
        survey = _survey_u(constants, board, last, np.where(number > 0, share, 0.5))
        yield pairs(
            "boards-in-line",
            _board_sentence(board, direction, mean, mask, evidence),
            mean,
            survey + type_a_component("scatter", mean, u, number - 1),
            of=f"board {board + 1}{WAYS[direction]}",
            least=1e-5,
            moves=evidence.moves(survey),
            compared=number >= FEWEST_SHOTS,
        )


def _board_sentence(
    board: int, direction: int, mean: Array, mask: Mask, evidence: Evidence
) -> Callable[[int], str]:
    return lambda i: (
        f"on the way {'in' if direction == INBOUND else 'back'}, board {board + 1} is "
        f"{mean[i] * 1e3:+.2f} mm out of line with the first and last boards (impact/gates, "
        f"{evidence.shots_of(mask, i)})"
    )


def _survey_u(constants: Mapping[str, Estimates], board: int, last: int, part: Array) -> Components:
    """Return the uncertainty of a board's deviation that the survey of three boards causes."""
    variants = Variants.of({_distance(k): constants[_distance(k)] for k in (0, board, last)})
    first, here, end = (column[..., 0] for column in variants.columns.values())
    return variants.components(here - first - part[:, None] * (end - first))


@dataclass(frozen=True, slots=True)
class Heights:
    """Heights at which balls pass the boards on the way in.

    Each height is corrected by g t²/2, where t is the time from the board to contact. The corrected
    heights of one ball are on a straight line.
    """

    evidence: Evidence
    distances: Array  # distances of the boards from the target, (laboratory, board) [m]
    level: Array  # heights above the line of fire, corrected for the drop, (shot, board) [m]
    # uncertainty of `level` from the thresholds of the beams, the same in all shots [m]
    level_u: Array
    used: Mask  # (shot,)

    @classmethod
    def of(cls, evidence: Evidence, gates: GateReadings) -> Self:
        """Return the heights of a block."""
        zeros, distances = (
            np.concatenate([evidence.best[name(k)][:, 0] for k in _boards(gates)], axis=1)
            for name in (_height, _distance)
        )
        to_come = gates.raw.contact[:, None] - gates.passages.times[:, INBOUND]
        fall = evidence.best["hall.gravity"][evidence.owner, 0] / 2 * to_come**2
        level = gates.passages.heights[:, INBOUND] + zeros[evidence.owner] + fall
        return cls(
            evidence=evidence,
            distances=distances,
            level=level,
            level_u=gates.passages.heights_u[:, INBOUND],
            used=np.isfinite(level).all(axis=1) & ~evidence.off_flight,
        )

    def off_neighbours(self, board: int) -> Array:
        """Return the weights of the boards, (laboratory, board), for the deviation of one board.

        The sum of the heights with these weights is the height of `board` above the line through
        the first and the last board.
        """
        first, here, last = (self.distances[:, k] for k in (0, board, -1))
        weights = np.zeros(self.distances.shape)
        weights[:, board] = 1.0
        weights[:, 0] = (last - here) / (first - last)
        weights[:, -1] = (here - first) / (first - last)
        return weights

    @property
    def at_target(self) -> Array:
        """Weights of the boards, (laboratory, board), for the height at the target.

        The sum of the heights with these weights is the height at the target of a least-squares
        line through all boards.
        """
        middle = self.distances.mean(axis=1, keepdims=True)
        deviation = self.distances - middle
        lever = middle / np.sum(deviation**2, axis=1, keepdims=True)
        return np.asarray(1 / deviation.shape[1] - lever * deviation)

    def each(self, weights: Array) -> Array:
        """Return the weighted sum of the heights of each shot, (shot,) [m]."""
        return np.asarray(np.sum(weights[self.evidence.owner] * self.level, axis=1))

    def mean(self, weights: Array) -> tuple[Array, Components, Array]:
        """Return the weighted sum averaged over the shots [m], its uncertainty, and their number.

        `weights` are (laboratory, board). Mean and number are (laboratory,).
        """
        evidence, of_shots = self.evidence, weights[self.evidence.owner]
        mean, u, number = evidence.mean_of(self.each(weights), self.used)
        square, _, _ = evidence.mean_of(np.sum((of_shots * self.level_u) ** 2, axis=1), self.used)
        names = [_height(board) for board in range(weights.shape[1])]
        variants = Variants.of({name: evidence.reduced.constants[name] for name in names})
        columns = np.concatenate([*variants.columns.values()], axis=2)
        survey = variants.components(np.sum(weights[:, None] * columns, axis=2))
        survey += type_a_component("beams", mean, np.sqrt(square))
        return mean, survey + type_a_component("scatter", mean, u, number - 1), number

    def growth(self, values: Array) -> tuple[Array, Array, Array]:
        """Return the slope of `values` (shot,) over the height at the target, its u, and its dof.

        Each result is (laboratory,). The slope is in units of `values` per meter.
        """
        evidence, at = self.evidence, self.each(self.at_target)
        mean, _, number = evidence.mean_of(at, self.used)
        centre, _, _ = evidence.mean_of(values, self.used)
        x = np.where(self.used, at - mean[evidence.owner], 0.0)
        y = np.where(self.used, values - centre[evidence.owner], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            base = evidence.per_laboratory(x**2)
            slope = evidence.per_laboratory(x * y) / base
            residual = evidence.per_laboratory((y - slope[evidence.owner] * x) ** 2)
            return slope, np.sqrt(residual / (number - 2) / base), number - 2


def heights(evidence: Evidence) -> Iterator[Pairs]:
    """Yield comparisons of the heights of incoming balls at the light boards and at the bat.

    Each board except the first and the last has two comparisons. They use the deviation of a ball:
    its height at the board, minus the height of the line through its heights at the first and the
    last board.

    * The first comparison is the mean deviation against 0.
    * The second comparison is a slope against 0: the slope of the deviation as a function of the
      ball's height. This slope differs from 0 if the height scale of the board is wrong relative to
      the first and last boards.

    One more comparison is the mean height at the bat against the mean height of the marks on the
    aim paper. It is left out if there are too few marks or none.

    `Pairs.sigmas`, (laboratory,), is the absolute difference in units of its standard uncertainty.
    Nothing is yielded if the instrument does not measure heights. A laboratory with too few shots
    is not compared.
    """
    gates = evidence.readings.flights
    if not isinstance(gates, GateReadings) or not gates.shows_height:
        return
    heights_of_balls = Heights.of(evidence, gates)
    for board in _boards(gates)[1:-1]:
        weights = heights_of_balls.off_neighbours(board)
        mean, components, number = heights_of_balls.mean(weights)
        yield pairs(
            "heights",
            _height_sentence(
                f"board {board + 1} shows balls", "the line through the first and last boards", mean
            ),
            mean,
            components,
            of=f"board {board + 1}",
            least=DROP_U,
            moves=evidence.moves(components),
            compared=number >= FEWEST_SHOTS,
        )
        slope, u, dof = heights_of_balls.growth(heights_of_balls.each(weights))
        yield pairs(
            "heights",
            _growth_sentence(board, slope),
            slope,
            type_a_component("scatter", slope, u, dof),
            of=f"board {board + 1} over height",
            least=SCALE_U,
            compared=dof >= 1,
        )
    marks = evidence.block.impact.get("aim")
    if not isinstance(marks, AimMarks) or marks.across.size < FEWEST_SHOTS * evidence.laboratories:
        return
    mean, components, number = heights_of_balls.mean(heights_of_balls.at_target)
    across = marks.across.reshape(evidence.laboratories, -1)
    difference, mark_count = mean - across.mean(axis=1), across.shape[1]
    yield pairs(
        "heights",
        _height_sentence("balls strike the bat", "the marks of impact/aim", difference),
        difference,
        components
        + type_a_component(
            "marks", difference, across.std(axis=1, ddof=1) / sqrt(mark_count), mark_count - 1.0
        ),
        of="marks",
        least=DROP_U,
        moves=evidence.moves(components),
        compared=number >= FEWEST_SHOTS,
    )


def _height_sentence(what: str, against: str, mean: Array) -> Callable[[int], str]:
    return lambda i: f"{what} {mean[i] * 1e3:+.2f} mm above {against} on average (impact/gates)"


def _growth_sentence(board: int, slope: Array) -> Callable[[int], str]:
    return lambda i: (
        f"the height scale of board {board + 1} is {1 + slope[i]:.2f} times that of the first and "
        "last boards (impact/gates)"
    )


def _boards(gates: GateReadings) -> range:
    return range(gates.distances.shape[-1])


def _distance(gate: int) -> str:
    return f"impact.gates.distance_{gate}"


def _height(board: int) -> str:
    return f"impact.gates.height_{board}"
