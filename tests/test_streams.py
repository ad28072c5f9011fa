"""Random numbers: known answers, independence, quiet draws, and the commitment to a seed."""

import hashlib
from math import sqrt
from struct import unpack

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.special import ndtri

from virtual_lab.errors import InputError
from virtual_lab.streams import Quiet, Streams, commitment, generator, of_owners, owners_and_slots
from virtual_lab.streams.philox import fill

NAMES = st.text(min_size=1, max_size=20)
SEEDS = st.integers(0, 2**128 - 1)
WORDS = st.integers(0, 2**32 - 1)
COMMITMENT = "3076cf22759f6d8e5b10a51e798f9d9a70deb65546b5c95096962772c3e592f4"
# rows of philox4x32 10 in kat_vectors of the Random123 library: counter, key, answer
KNOWN = (
    ("00000000 00000000 00000000 00000000", "00000000 00000000",
     "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff",
     "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0",
     "d16cfe09 94fdcceb 5001e420 24126ea1"),
)  # fmt: skip


def _words(text: str) -> tuple[int, ...]:
    return tuple(int(word, 16) for word in text.split())


def philox(counter: tuple[int, ...], key: tuple[int, ...]) -> tuple[int, ...]:
    """Return Philox4x32-10 in Python integers, after Salmon et al., SC11, section 4.3."""
    a, b, c, d = counter
    x, y = key
    for _ in range(10):
        p, q = a * 0xD2511F53, c * 0xCD9E8D57
        a, b, c, d = q >> 32 ^ b ^ x, q % 2**32, p >> 32 ^ d ^ y, p % 2**32
        x, y = (x + 0x9E3779B9) % 2**32, (y + 0xBB67AE85) % 2**32
    return a, b, c, d


def key_of(seed: int, branch: tuple[int, ...], name: str) -> tuple[int, ...]:
    owner = "/".join([str(seed), *map(str, branch), name])
    return unpack("<3I", hashlib.blake2b(owner.encode(), digest_size=12).digest())


def uniform_of(
    seed: int, branch: tuple[int, ...], name: str, slot: int, index: int, laboratory: int = 0
) -> float:
    """Return one number between -1/2 and 1/2, computed from its counter alone."""
    *key, tag = key_of(seed, branch, name)
    words = philox((index // 2, slot, laboratory, tag), tuple(key))
    low, high = words[2 * (index % 2) :][:2]
    return ((high << 32 | low) >> 12) * 2.0**-52 - 0.5 + 2.0**-53


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_the_oracle_gives_the_known_answers(counter: str, key: str, answer: str) -> None:
    """The answers are those published with Random123."""
    assert philox(_words(counter), _words(key)) == _words(answer)


@given(
    seed=SEEDS,
    branch=st.lists(st.integers(0, 2**40), max_size=2),
    name=NAMES,
    slots=st.lists(WORDS, min_size=1, max_size=5),
    each=st.integers(1, 7),
    laboratory=WORDS,
)
def test_every_number_depends_only_on_its_key_and_counter(
    seed: int, branch: list[int], name: str, slots: list[int], each: int, laboratory: int
) -> None:
    """The key is from seed, branch and name; the counter from laboratory, slot and index."""
    branches = tuple(branch)
    numbers = Streams(seed, branches, laboratory).uniform(name, each, np.array(slots))
    rows = [[(slot, index, laboratory) for index in range(each)] for slot in slots]
    assert numbers.tolist() == [
        [uniform_of(seed, branches, name, *at) for at in row] for row in rows
    ]


@pytest.mark.parametrize("each", [1, 2, 3, 4, 7, 300, 513])
def test_a_laboratory_draws_in_a_block_what_it_draws_alone(each: int) -> None:
    """Any block, across the chunks of the compiled code, with slots and without."""
    numbers = np.random.default_rng(2).integers(0, 2**32, 400)
    slots = np.random.default_rng(3).integers(0, 2**32, 400)
    block = Streams(9, (4,), numbers)
    without, with_slots = block.normal("a", each), block.normal("a", each, slots)
    for row in (0, 1, 255, 256, 399):
        alone = Streams(9, (4,), int(numbers[row]))
        assert np.array_equal(without[row], alone.normal("a", each))
        assert np.array_equal(with_slots[row], alone.normal("a", each, slots[row : row + 1])[0])
    some = np.array([399, 5, 5])
    assert np.array_equal(block.at(some).normal("a", each, slots[some]), with_slots[some])


@pytest.mark.parametrize("laboratory", [-1, 2**32, np.array([3, -1]), np.array([2**32, 0])])
def test_laboratory_numbers_out_of_range_are_refused(laboratory: int) -> None:
    with pytest.raises(InputError, match=r"laboratory = .*allowed: 0 to 2\^32 - 1"):
        Streams(1, (), laboratory)


@pytest.mark.parametrize("each", [1, 2, 3, 255, 256, 257, 511, 512, 513, 1537])
def test_long_arrays_have_the_same_counters(each: int) -> None:
    """Across the chunks of the compiled code, each slot agrees with itself alone and the oracle."""
    slots = np.array([5, 0, 2**32 - 1, 7, 7, 300])
    numbers = Streams(3).uniform("many", each, slots)
    for row, slot in zip(numbers, slots, strict=True):
        assert np.array_equal(row, Streams(3).uniform("many", each, np.array([slot]))[0])
        for index in (0, each // 2, each - 1):
            assert row[index] == uniform_of(3, (), "many", int(slot), index)


def test_a_row_depends_only_on_its_slot() -> None:
    """5000 slots in any order, with odd and even numbers per slot."""
    slots = np.random.default_rng(1).permutation(5000)
    for each in (1, 2, 5, 6):
        numbers = Streams(4).normal("a", each, slots)
        owners_and_slots = Streams(4).normal("a", each, np.arange(5000))
        assert np.array_equal(numbers, owners_and_slots[slots])
        assert np.array_equal(
            owners_and_slots[::7], Streams(4).normal("a", each, np.arange(0, 5000, 7))
        )


def test_normal_numbers_are_the_quantiles_of_the_uniform_ones() -> None:
    """The oracle is scipy's inverse normal of the same 400 000 numbers, to 2e-15."""
    n = 400_000
    uniform, normal = Streams(6).uniform("x", n), Streams(6).normal("x", n)
    exact = -np.sign(uniform) * ndtri(0.5 - np.abs(uniform))
    assert np.abs(normal / exact - 1).max() < 2e-15
    assert np.abs(normal).max() > 4.5


def test_the_normal_quantile_is_right_in_the_farthest_tails() -> None:
    """Tails down to 2^-53, which one number in 5e15 reaches; the oracle is scipy."""
    from numba import njit

    from virtual_lab.streams.philox import _normal

    @njit  # only kernels can call the function, which has no wrapper
    def convert(numbers, values, tails, at):
        _normal(numbers, values, tails, at)

    tail = 2.0 ** -np.arange(4.0, 54.0)
    numbers = np.concatenate([0.5 - tail, tail - 0.5])
    exact = np.concatenate([-ndtri(tail), ndtri(tail)])
    size = numbers.size
    convert(numbers, np.empty(size), np.empty(size + 1), np.empty(size + 1, np.int64))
    assert np.abs(numbers / exact - 1).max() < 2e-15
    assert exact.max() > 8.2


def test_uniform_numbers_stay_inside_a_half() -> None:
    """Numbers are odd multiples of 2^-53: never 0, and symmetric within ±1/2."""
    n = 200_000
    steps = Streams(8).uniform("x", n) * 2.0**53
    assert np.all(steps % 2 == 1)
    assert np.abs(steps).max() < 2.0**52


@pytest.mark.parametrize("slots", [[-1], [0, 2**32], [3, -7]])
def test_slots_out_of_range_are_refused(slots: list[int]) -> None:
    with pytest.raises(InputError, match="allowed as slots"):
        Streams(1).normal("a", 2, np.array(slots))
    one = np.zeros(1, np.int64)
    assert not fill((0, 0, 0), one, np.array(slots), 2, True, np.empty(2 * len(slots)))


@given(seed=SEEDS, name=NAMES, other=NAMES, slot=WORDS)
def test_order_does_not_matter(seed: int, name: str, other: str, slot: int) -> None:
    """Earlier draws, also of other names, change nothing."""
    slots = np.array([slot])
    first = Streams(seed).normal(name, 4, slots)
    draws = Streams(seed)
    draws.uniform(other, 100)
    draws.normal(name, 1, slots)
    assert np.array_equal(draws.normal(name, 4, slots), first)


def test_without_slots_numbers_are_those_of_slot_0() -> None:
    draws = Streams(5)
    assert np.array_equal(draws.normal("a", (2, 3)), draws.normal("a", (2, 3), np.array([0]))[0])
    assert np.array_equal(draws.normal("a", 1000)[:11], draws.normal("a", 11))


@pytest.mark.parametrize(
    "pair",
    [
        ((1, (), 0, "a", 0), (1, (), 0, "b", 0)),
        ((1, (), 0, "a", 0), (1, (), 0, "a", 1)),
        ((1, (), 0, "a", 0), (1, (), 1, "a", 0)),
        ((1, (), 0, "a", 1), (1, (), 1, "a", 0)),
        ((1, (), 0, "a", 0), (2, (), 0, "a", 0)),
        ((2**127, (), 0, "a", 0), (2**127 + 1, (), 0, "a", 0)),
        ((7, (), 0, "a", 0), (7, (0,), 0, "a", 0)),
        ((7, (0,), 0, "a", 0), (7, (1,), 0, "a", 0)),
    ],
)
def test_streams_are_uncorrelated(pair: tuple) -> None:
    """Seed, branch, laboratory, name, slot: 100 000 pairs, |r| < 4/√n (6e-5 by chance).

    Squares and products of neighbors are compared, too, because a correlation alone would not show
    their dependence.
    """
    n = 100_000
    x, y = (
        Streams(seed, branch, laboratory).normal(name, n, np.array([slot]))[0]
        for seed, branch, laboratory, name, slot in pair
    )
    assert not np.any(x == y)
    for left, right in ((x, y), (x**2, y**2), (x[1:], y[:-1]), (x[1:] * x[:-1], y[1:] * y[:-1])):
        assert abs(np.corrcoef(left, right)[0, 1]) < 4 / sqrt(n)


def test_numbers_of_one_slot_and_of_one_index_are_uncorrelated() -> None:
    """Along the index and along the slots, lags 1 to 8: |r| < 4.5/√n (7e-6 each by chance)."""
    n = 100_000
    rows = Streams(2).normal("a", n), Streams(2).normal("a", slots=np.arange(n))
    for x in rows:
        for lag in range(1, 9):
            assert abs(np.corrcoef(x[lag:], x[:-lag])[0, 1]) < 4.5 / sqrt(n)


def test_random_numbers_have_their_stated_distributions() -> None:
    """Kolmogorov-Smirnov test against the exact laws, n = 200 000, p > 1e-3, fixed seed."""
    draws, slots = Streams(77), np.arange(50_000)
    for normal in (draws.normal("n", 200_000), draws.normal("n", 4, slots).ravel()):
        assert stats.kstest(normal, "norm").pvalue > 1e-3
    assert stats.kstest(draws.uniform("u", 200_000), "uniform", (-0.5, 1)).pvalue > 1e-3
    bits = np.unpackbits(((draws.uniform("u", 100_000) + 0.5) * 256).astype(np.uint8)[:, None], 1)
    ones = bits.sum(axis=0, dtype=int)
    assert np.abs(ones - 50_000).max() < 4.5 * sqrt(25_000)


def test_a_draw_has_the_requested_shape() -> None:
    """A number without a shape, an array with one, and a leading axis of slots."""
    for draws in (Streams(1), Quiet()):
        for draw in (draws.normal, draws.uniform):
            assert np.shape(draw("x")) == ()
            assert np.shape(draw("x", 3)) == (3,)
            assert np.shape(draw("x", (2, 0))) == (2, 0)
            assert np.shape(draw("x", slots=np.arange(4))) == (4,)
            assert np.shape(draw("x", 3, np.arange(4))) == (4, 3)
            assert np.shape(draw("x", (3, 1), np.arange(0))) == (0, 3, 1)


def test_a_block_has_a_leading_axis_of_laboratories() -> None:
    """The axis is there with slots per laboratory or without."""
    for draws in (Streams(1, (), np.arange(4)), Quiet(np.arange(4))):
        for draw in (draws.normal, draws.uniform):
            assert np.shape(draw("x")) == (4,)
            assert np.shape(draw("x", (3, 1))) == (4, 3, 1)
            assert np.shape(draw("x", 3, np.zeros(4, int))) == (4, 3)
        assert np.shape(draws.at(np.array([1, 1])).normal("x", 3, np.arange(2))) == (2, 3)
        with pytest.raises(InputError, match=r"slots = \(3,\).*allowed: one per row, \(4,\)"):
            Streams(1, (), np.arange(4)).normal("x", 2, np.arange(3))


def test_readings_in_turn_count_laboratory_after_laboratory() -> None:
    owner, slots = owners_and_slots((2,), 3)
    assert owner.tolist() == [0, 0, 0, 1, 1, 1]
    assert slots.tolist() == [0, 1, 2, 0, 1, 2]
    owner, slots = owners_and_slots((), 3)
    assert owner is ...
    assert slots.tolist() == [0, 1, 2]


def test_one_laboratory_owns_every_shot() -> None:
    """Its draws are the same, and its numbers remain numbers."""
    assert Streams(1, (), 5).at(...) == Streams(1, (), 5)
    assert isinstance(of_owners(2.5, ...), float)
    assert of_owners([2.5, 3.5], np.array([1, 0, 1])).tolist() == [3.5, 2.5, 3.5]


@given(name=NAMES, slot=WORDS)
def test_quiet_draws_are_zero(name: str, slot: int) -> None:
    """The mean of a standard normal and of a uniform about zero is 0."""
    assert not Quiet().normal(name, (3, 2), np.array([slot])).any()
    assert not Quiet().uniform(name, 5).any()


def test_the_commitment_is_the_known_hash() -> None:
    """The oracle is SHA-256 of sixteen zero bytes and the digits 42, by hashlib."""
    assert commitment(bytes(16), 42) == hashlib.sha256(b"\0" * 16 + b"42").hexdigest()
    assert commitment(bytes(16), 42) == COMMITMENT


@given(a=SEEDS, b=SEEDS, salt=st.binary(min_size=16, max_size=16))
def test_the_commitment_binds_the_seed(a: int, b: int, salt: bytes) -> None:
    """Under a salt of fixed length each seed has its own hash; another salt gives another hash."""
    assert (commitment(salt, a) == commitment(salt, b)) == (a == b)
    flipped = bytes([salt[0] ^ 1]) + salt[1:]
    assert commitment(flipped, a) != commitment(salt, a)


@pytest.mark.parametrize("seed", [-1, 2**128, 10**5000], ids=["negative", "longer", "huge"])
def test_seeds_out_of_range_are_refused(seed: int) -> None:
    for draw in (Streams, lambda seed: generator(seed, "a", 0)):
        with pytest.raises(InputError, match=r"seed = .*0 to 2\^128 - 1"):
            draw(seed)
