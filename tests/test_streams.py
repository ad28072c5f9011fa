"""Random streams: known answers, independence, silence, and the commitment to a seed."""

import hashlib
from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from virtual_lab.streams import Quiet, Streams, commitment

NAMES = st.text(min_size=1, max_size=20)
SEEDS = st.integers(0, 2**128)
UNIFORM = [-0.3416412646067073, 0.22645349268755988, 0.36871685880759497]
NORMAL = [0.14407005175868343, -2.5716284159917735, 0.20309342430394695]
COMMITMENT = "3076cf22759f6d8e5b10a51e798f9d9a70deb65546b5c95096962772c3e592f4"


def test_known_answers() -> None:
    """Written down on the day of release: what a seed gives must never change again."""
    draws = Streams(20030101)
    assert draws.uniform("gates.start", 3).tolist() == UNIFORM
    assert draws.normal("gates.jitter", 3, 7).tolist() == NORMAL


@given(seed=SEEDS, name=NAMES, block=st.integers(0, 2**32 - 1))
def test_a_stream_is_numpys_own_by_seed_name_and_block(seed: int, name: str, block: int) -> None:
    """design.md: SeedSequence(seed, spawn_key=(crc32(name), block)); CRC-32 bit by bit here."""
    sequence = np.random.SeedSequence(seed, spawn_key=(_crc32(name.encode()), block))
    expected = np.random.Generator(np.random.PCG64DXSM(sequence)).standard_normal((2, 3))
    assert np.array_equal(Streams(seed).normal(name, (2, 3), block), expected)


def test_many_numbers_are_numpys_own_too() -> None:
    """Bit for bit, over lengths that end runs of bits anywhere; the longest passes 4 sigma."""
    for seed, shape in enumerate([(4096,), (3, 5461), (16_320,), (50_001,), (2, 3, 250_000)]):
        sequence = np.random.SeedSequence(seed, spawn_key=(_crc32(b"hit"), 0))
        expected = np.random.Generator(np.random.PCG64DXSM(sequence)).standard_normal(shape)
        assert np.array_equal(Streams(seed).normal("hit", shape), expected)
    assert np.abs(expected).max() > 4


def _crc32(data: bytes) -> int:
    """CRC-32 of IEEE 802.3, polynomial 0xEDB88320 reflected."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xEDB88320 * (crc & 1)
    return crc ^ 0xFFFFFFFF


@given(seed=SEEDS, name=NAMES, other=NAMES, block=st.integers(0, 1000))
def test_order_does_not_matter(seed: int, name: str, other: str, block: int) -> None:
    """What was asked before, and of whom, changes nothing."""
    first = Streams(seed).normal(name, 4, block)
    draws = Streams(seed)
    draws.uniform(other, 100)
    draws.normal(name, 1, block)
    assert np.array_equal(draws.normal(name, 4, block), first)


def test_more_shots_keep_the_first_ones() -> None:
    """A vector drawn longer starts the same (a property of PCG64 streams)."""
    draws = Streams(5)
    assert np.array_equal(draws.normal("a", 1000)[:10], draws.normal("a", 10))


@pytest.mark.parametrize(
    "pair",
    [
        (("a", 0, 1), ("b", 0, 1)),
        (("a", 0, 1), ("a", 1, 1)),
        (("a", 0, 1), ("a", 0, 2)),
        (("a", 0, 2**64), ("a", 0, 2**64 + 1)),
    ],
)
def test_streams_are_uncorrelated(pair: tuple) -> None:
    """N = 100 000 pairs, fixed seed: |r| < 4/√n (6e-5 by chance)."""
    n = 100_000
    x, y = (Streams(seed).normal(name, n, block) for name, block, seed in pair)
    assert abs(np.corrcoef(x, y)[0, 1]) < 4 / sqrt(n)
    assert not np.any(x == y)


def test_distributions_are_the_standard_ones() -> None:
    """Kolmogorov-Smirnov against the exact laws, n = 20 000, p > 1e-3 at a fixed seed."""
    draws = Streams(77)
    assert stats.kstest(draws.normal("n", 20_000), "norm").pvalue > 1e-3
    assert stats.kstest(draws.uniform("u", 20_000), "uniform", (-0.5, 1)).pvalue > 1e-3


def test_shapes() -> None:
    """A number where nothing is asked, an array where a shape is."""
    for draws in (Streams(1), Quiet()):
        for draw in (draws.normal, draws.uniform):
            assert np.shape(draw("x")) == ()
            assert np.shape(draw("x", 3)) == (3,)
            assert np.shape(draw("x", (2, 0))) == (2, 0)


@given(name=NAMES, block=st.integers(0, 1000))
def test_quiet_is_zero(name: str, block: int) -> None:
    """The mean of a standard normal and of a uniform about zero is 0."""
    assert not Quiet().normal(name, (3, 2), block).any()
    assert not Quiet().uniform(name, 5, block).any()


def test_commitment_known_answer() -> None:
    """SHA-256 of sixteen zero bytes and the digits 42, by hashlib written out."""
    assert commitment(bytes(16), 42) == hashlib.sha256(b"\0" * 16 + b"42").hexdigest()
    assert commitment(bytes(16), 42) == COMMITMENT


@given(a=SEEDS, b=SEEDS, salt=st.binary(min_size=16, max_size=16))
def test_commitment_binds(a: int, b: int, salt: bytes) -> None:
    """One seed, one hash under a salt of fixed length; another salt, another hash."""
    assert (commitment(salt, a) == commitment(salt, b)) == (a == b)
    flipped = bytes([salt[0] ^ 1]) + salt[1:]
    assert commitment(flipped, a) != commitment(salt, a)


def test_branches_share_nothing_with_each_other_or_the_trunk() -> None:
    """What numpy gives for the longer spawn key; the trunk's own numbers stay as they were."""
    trunk, first, second = Streams(7), Streams(7, (0,)), Streams(7, (1,))
    drawn = [draws.normal("hit", 1000, 2) for draws in (trunk, first, second)]
    apart = np.corrcoef(drawn)[np.triu_indices(3, 1)]
    assert np.abs(apart).max() < 4 / sqrt(1000)
    sequence = np.random.SeedSequence(7, spawn_key=(_crc32(b"hit"), 2, 1))
    expected = np.random.Generator(np.random.PCG64DXSM(sequence)).standard_normal(1000)
    assert np.array_equal(drawn[2], expected)
