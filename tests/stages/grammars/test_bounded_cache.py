from __future__ import annotations

from stages.grammars.bounded_cache import BoundedCache


def test_least_recently_used_values_are_dropped_beyond_the_limit() -> None:
    made: list[str] = []

    def make(key: str) -> str:
        made.append(key)
        return key * 4

    cache: BoundedCache[str, str] = BoundedCache(make, len, 8)
    assert [cache[key] for key in ("a", "b", "a", "c")] == ["aaaa", "bbbb", "aaaa", "cccc"]
    assert (made, len(cache)) == (["a", "b", "c"], 2)
    assert cache["a"] == "aaaa"
    assert made == ["a", "b", "c"], "a was used after b"
    assert cache["b"] == "bbbb"
    assert made == ["a", "b", "c", "b"]


def test_value_beyond_the_limit_is_kept_alone() -> None:
    cache: BoundedCache[str, str] = BoundedCache(lambda key: key * 9, len, 8)
    assert cache["a"] == cache["a"] == "a" * 9
    assert (cache["b"], len(cache)) == ("b" * 9, 1)
