from __future__ import annotations

from stages.strings.tokens import make_alphabet


def test_the_first_52_types_are_letters_upper_case_first() -> None:
    alphabet = make_alphabet([f"part {index}" for index in range(52)])
    assert "".join(alphabet.tokens) == "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
    assert alphabet.vocabulary()["a"] == "part 26"
    assert alphabet.types["z"] == 51


def test_with_53_types_tokens_are_bracketed_names() -> None:
    alphabet = make_alphabet([f"part {index}" for index in range(53)])
    assert alphabet.tokens[0] == "[part_0]"
    assert alphabet.vocabulary()["[part_52]"] == "part 52"


def test_equal_bracketed_names_get_numbers() -> None:
    names = ["a b", "a_b", "a_b_2", "a]b", "(1)", "ü", *(f"part {index}" for index in range(50))]
    alphabet = make_alphabet(names)
    assert alphabet.tokens[:6] == ("[a_b]", "[a_b_2]", "[a_b_2_2]", "[a_b_3]", "[_1_]", "[_]")
    assert len(set(alphabet.tokens)) == len(names)
    assert tuple(alphabet.vocabulary().values()) == tuple(names)
