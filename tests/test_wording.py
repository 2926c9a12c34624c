"""Counts in messages: one of a thing is never told in the plural."""

from hypothesis import given
from hypothesis import strategies as st

from fieldkit.wording import count, listed

NOUNS = ("columns", "files", "photographs", "plants", "plots", "stations", "visits")


@given(st.integers(2, 10**7), st.sampled_from(NOUNS))
def test_only_one_is_singular(number: int, nouns: str) -> None:
    noun = nouns.removesuffix("s")
    assert count(1, noun) == f"1 {noun}"
    assert count(number, noun) == f"{number:,} {noun}s"
    assert count(0, noun) == f"0 {noun}s"


def test_verbs_and_totals() -> None:
    assert count(1, "battery is", "batteries are") == "1 battery is"
    assert count(2, "battery is", "batteries are") == "2 batteries are"
    assert count(1, "photographs has", "photographs have", of=13) == "1 of 13 photographs has"
    assert count(3, "photographs has", "photographs have", of=1300) == "3 of 1,300 photographs have"


def test_names_are_listed() -> None:
    assert listed(["a"]) == "a"
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(list("abcdefg")) == "a, b, c, d and 3 more"
