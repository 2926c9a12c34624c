"""Tracks against a plain union-find."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.reconstruction.colmap_model import Track, build_tracks

Matches = dict[tuple[int, int], np.ndarray]


@st.composite
def problems(draw: st.DrawFn) -> tuple[list[int], Matches]:
    counts = draw(st.lists(st.integers(0, 6), min_size=1, max_size=6))
    pairs = [(i, j) for i in range(len(counts)) for j in range(i + 1, len(counts)) if counts[i] and counts[j]]
    matches = {}
    for i, j in draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []:
        one = st.tuples(st.integers(0, counts[i] - 1), st.integers(0, counts[j] - 1))
        chosen = draw(st.lists(one, max_size=5, unique=True))
        matches[i, j] = np.array(chosen, dtype=np.uint32).reshape(-1, 2)
    return counts, matches


def union_find(matches: Matches) -> list[Track]:
    group: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for (i, j), pairs in matches.items():
        for a, b in pairs.tolist():
            joined = group.get((i, a), {(i, a)}) | group.get((j, b), {(j, b)})
            for member in joined:
                group[member] = joined
    tracks = set()
    for members in group.values():
        images = [image for image, _ in members]
        kept = tuple(sorted(m for m in members if images.count(m[0]) == 1))
        if len(kept) >= 2:
            tracks.add(kept)
    return sorted(tracks)


@given(problems())
def test_union_find_gives_the_same(problem: tuple[list[int], Matches]) -> None:
    counts, matches = problem
    assert build_tracks(counts, matches) == union_find(matches)


@given(problems(), st.randoms())
def test_the_order_of_pairs_does_not_matter(problem: tuple[list[int], Matches], random: object) -> None:
    counts, matches = problem
    shuffled = list(matches.items())
    random.shuffle(shuffled)
    assert build_tracks(counts, dict(shuffled)) == build_tracks(counts, matches)


def test_a_chain_becomes_one_track() -> None:
    matches = {(0, 1): np.array([[4, 2]], np.uint32), (1, 2): np.array([[2, 0]], np.uint32)}
    assert build_tracks([5, 3, 1], matches) == [((0, 4), (1, 2), (2, 0))]


def test_an_image_met_twice_is_dropped_from_the_track() -> None:
    matches = {
        (0, 1): np.array([[0, 0]], np.uint32),
        (1, 2): np.array([[0, 0]], np.uint32),
        (0, 2): np.array([[1, 0]], np.uint32),
    }
    assert build_tracks([2, 1, 1], matches) == [((1, 0), (2, 0))]


def test_nothing_gives_nothing() -> None:
    assert build_tracks([], {}) == []
    assert build_tracks([3, 3], {(0, 1): np.zeros((0, 2), np.uint32)}) == []
