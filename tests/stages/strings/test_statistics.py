from __future__ import annotations

from collections import Counter

import pytest

from stages.strings.statistics import StringFigures, StringStatistics, measure_string, summarize


@pytest.mark.parametrize(
    ("string", "figures"),
    [
        ("A", StringFigures(characters=1, tokens=1, nodes=1, cycles=0, branch_depth=0)),
        ("A0(DC)DCDB0", StringFigures(characters=11, tokens=11, nodes=7, cycles=1, branch_depth=1)),
        ("A%10(B(C)%(1)D)E%10", StringFigures(characters=19, tokens=12, nodes=5, cycles=1, branch_depth=2)),
        ("[a_1]0(B)([a(1)])C0", StringFigures(characters=19, tokens=10, nodes=4, cycles=1, branch_depth=1)),
    ],
)
def test_lengths_of_strings_are_in_tokens(string: str, figures: StringFigures) -> None:
    assert measure_string(string) == figures


def test_statistics_count_values_and_tokens() -> None:
    statistics = StringStatistics()
    for string in ("AB", "A0AA0", "BA"):
        statistics.add(string)
    assert statistics.seen == Counter({"A": 5, "B": 2, "0": 2})
    described = statistics.describe()
    assert described["strings"] == 3
    assert described["tokens"] == {"least": 2, "median": 2, "mean": 3.0, "most": 5, "histogram": {"2": 2, "5": 1}}
    assert described["cycles"] == {"least": 0, "median": 0, "mean": 0.333, "most": 1, "histogram": {"0": 2, "1": 1}}
    assert "cycle_rank" not in described


def test_figures_of_several_files_are_merged() -> None:
    first, second = StringStatistics(), StringStatistics()
    for statistics, strings, ranks in ((first, ["AB", "AAAAA"], [3]), (second, ["A0AA0"], [1, 7])):
        for string in strings:
            statistics.add(string)
        for rank in ranks:
            statistics.add_shape(rank)
    joined = summarize([first, second])
    assert (joined["tokens"], joined["cycles"]) == ({"median": 5, "most": 5}, {"median": 0, "most": 1})
    assert joined["cycle_rank"] == {"median": 3, "most": 7}
    assert second.describe()["cycle_rank"]["histogram"] == {"1": 1, "7": 1}
