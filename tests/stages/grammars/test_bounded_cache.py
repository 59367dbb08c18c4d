from __future__ import annotations

from stages.grammars.bounded_cache import BoundedCache


def test_of_what_takes_more_than_is_allowed_that_goes_which_was_not_asked_for_the_longest() -> None:
    made: list[str] = []

    def make(key: str) -> str:
        made.append(key)
        return key * 4

    recent: BoundedCache[str, str] = BoundedCache(make, len, 8)
    assert [recent[each] for each in ("a", "b", "a", "c")] == ["aaaa", "bbbb", "aaaa", "cccc"]
    assert (made, len(recent)) == (["a", "b", "c"], 2)
    assert recent["a"] == "aaaa"
    assert made == ["a", "b", "c"], "a was asked for after b"
    assert recent["b"] == "bbbb"
    assert made == ["a", "b", "c", "b"]


def test_what_is_larger_than_all_may_be_is_held_alone() -> None:
    recent: BoundedCache[str, str] = BoundedCache(lambda key: key * 9, len, 8)
    assert recent["a"] == recent["a"] == "a" * 9
    assert (recent["b"], len(recent)) == ("b" * 9, 1)
