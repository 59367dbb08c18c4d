"""What may follow the beginning of a string, against all strings there are and against the grammar itself."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, STRICTNESS, admits
from stages.shape.kit import Docking, Grammar, Strictness
from stages.strings.compiled_grammar import compile_grammar, compile_patterns, patterns_json
from stages.strings.completion import NO_COMPLETION, tokens_to_complete
from stages.strings.decoder import decode
from stages.strings.encoder import encode
from stages.strings.grammar_mask import NO_TOKEN, GrammarMask, follows_grammar, masks_along
from stages.strings.mask_state import END_TOKEN
from stages.strings.tokens import StringError, make_alphabet
from stages.training.string_vae.vocabulary import Vocabulary
from tests.stages.strings.grammar_check import check_string
from tests.stages.training import toy_training

ALL_LEVELS: tuple[Strictness, ...] = (*STRICTNESS, *SLOT_LEVELS)


def grammar_of(*strings: str, strictness: Strictness = "multiset", hubs: tuple[int, ...] = ()) -> Grammar:
    """What is seen in some strings; hubs stand outside the neighbourhoods."""
    around: dict[int, dict[tuple[tuple[int, int], ...], int]] = {}
    dockings = []
    for string in strings:
        decoded = decode(string, AB)
        for node, kind in enumerate(decoded.types.tolist()):
            others = [int(decoded.types[i + j - node]) for i, j in decoded.edges.tolist() if node in (i, j)]
            dockings += [
                Docking(min(kind, neighbor), max(kind, neighbor), np.eye(4), "face", 1, 0.0) for neighbor in others
            ]
            kept = [neighbor for neighbor in others if neighbor not in hubs]
            if kind not in hubs:
                around.setdefault(kind, {})[
                    tuple((neighbor, kept.count(neighbor)) for neighbor in sorted(set(kept)))
                ] = 1
    return Grammar(around, tuple(dockings), {}, strictness, hubs)


AB = make_alphabet(["a", "b", "c"])
GRAMMARS = {
    "a chain": grammar_of("ABA", "ABBA"),
    "a star": grammar_of("A(B)(B)B", "AB"),
    "only rings end it": grammar_of("A0BAB0"),
    "a ring with a tail": grammar_of("A0B(C)B0"),
    "a free count": grammar_of("A(B)C", "A(B)(B)B", "BB", strictness="count_and_types"),
    "a hub": grammar_of("AB(CA)C", "BB", hubs=(2,)),
}


def every_string(vocabulary: Vocabulary, grammar: Grammar, most: int) -> set[tuple[int, ...]]:
    """All admitted strings of at most `most` tokens, each with its end."""
    found = set()
    for length in range(1, most + 1):
        for codes in product(range(1, len(vocabulary)), repeat=length):
            try:
                check_string(vocabulary.string(codes), vocabulary.alphabet, grammar)
            except StringError:
                continue
            found.add((*codes, END_TOKEN))
    return found


@pytest.mark.parametrize("name", GRAMMARS)
@pytest.mark.parametrize(("cycles", "most"), [(0, 6), (1, 5)])
def test_allowed_tokens_are_exactly_those_of_admitted_strings(name: str, cycles: int, most: int) -> None:
    vocabulary, grammar = Vocabulary(AB, cycles), GRAMMARS[name]
    strings = every_string(vocabulary, grammar, most)
    follows: dict[tuple[int, ...], set[int]] = {(): set()}
    for string in strings:
        for place, code in enumerate(string):
            follows.setdefault(string[:place], set()).add(code)
    compiled = compile_grammar(grammar, 3, cycles)
    for beginning, wanted in follows.items():
        # Cycles make a string shorter than its subtrees would be, so that it needs more room.
        mask = GrammarMask(compiled, cycles, 1, most if cycles == 0 else 3 * most)
        for code in beginning:
            mask.take(np.array([code]))
        allowed = set(np.flatnonzero(mask.allowed()[0]).tolist())
        assert wanted <= allowed, vocabulary.string(beginning)
        if cycles == 0:
            assert allowed == wanted, vocabulary.string(beginning)


def walk(grammar: Grammar, cycles: int, most: int, rng: np.random.Generator) -> tuple[list[int], bool]:
    """A string of random allowed tokens, and whether it came to its end, not to a dead one."""
    mask = GrammarMask(compile_grammar(grammar, 3, cycles), cycles, 1, most)
    codes: list[int] = []
    while True:
        allowed = np.flatnonzero(mask.allowed()[0])
        if not len(allowed):
            return codes, False
        code = int(rng.choice(allowed))
        if code == END_TOKEN:
            return codes, True
        codes.append(code)
        mask.take(np.array([code]))


@given(st.integers(0, 2**32), st.sampled_from(sorted(GRAMMARS)), st.integers(0, 3), st.sampled_from(ALL_LEVELS))
def test_strings_of_allowed_tokens_are_admitted_and_within_the_maximum_length(
    seed: int, name: str, cycles: int, strictness: Strictness
) -> None:
    known = GRAMMARS[name]
    grammar = Grammar(known.neighbourhoods, known.dockings, {}, strictness, known.hubs)
    codes, has_ended = walk(grammar, cycles, 30, np.random.default_rng(seed))
    if not has_ended:
        assert cycles or not codes, "without cycles there is always a way to the end"
        return
    assert len(codes) <= 30
    check_string(Vocabulary(AB, cycles).string(codes), AB, grammar)


@given(st.integers(0, 2**32), st.sampled_from(sorted(GRAMMARS)), st.integers(0, 3))
def test_the_chosen_token_is_the_best_allowed_one(seed: int, name: str, cycles: int) -> None:
    rng = np.random.default_rng(seed)
    mask = GrammarMask(compile_grammar(GRAMMARS[name], 3, cycles), cycles, 4, 12)
    for _ in range(12):
        allowed = mask.allowed()
        scores = np.where(rng.random(allowed.shape) < 0.2, -np.inf, rng.normal(size=allowed.shape))
        kept = np.array([NO_TOKEN, NO_TOKEN, NO_TOKEN, int(allowed[3].argmax())])
        masked = np.where(allowed, scores, -np.inf)
        wanted = np.where(np.isinf(masked).all(axis=1), NO_TOKEN, masked.argmax(axis=1))
        wanted[3] = kept[3]
        assert mask.choose(scores, kept).tolist() == wanted.tolist()
        mask.take(np.where(wanted == NO_TOKEN, END_TOKEN, wanted))


@given(st.integers(0, 2**32), st.booleans())
def test_certificates_of_open_cycles_do_not_change_the_mask(seed: int, partial: bool) -> None:
    rng = np.random.default_rng(seed)
    compiled = compile_grammar(grammar_of("A01(A)(AA0)A0(C1)CB0", "A0(C1(C2)(C02CA1)A)C"), 3, 4, partial)
    with_certificates, without_certificates = GrammarMask(compiled, 4, 1, 40), GrammarMask(compiled, 4, 1, 40)
    for _ in range(40):
        allowed = with_certificates.allowed()
        without_certificates.state.certificate[:] = NO_TOKEN
        assert (without_certificates.allowed() == allowed).all()
        state = with_certificates.state
        growing = {int(state.current[0]), *state.stack[0, : state.depth[0]].tolist()}
        for certificate in state.certificate[0][state.certificate[0] != NO_TOKEN].tolist():
            assert certificate in growing
            assert not state.finished[0, certificate]
        ways = np.flatnonzero(allowed[0])
        if not len(ways) or ways.tolist() == [END_TOKEN]:
            break
        numbers = ways[ways > 5]  # cycles are what this is about
        token = np.array([rng.choice(numbers if len(numbers) and rng.random() < 0.5 else ways)])
        with_certificates.take(token)
        without_certificates.take(token)


@given(
    st.integers(0, 2**32),
    st.integers(0, toy_training.SHAPES_PER_SHARD * len(toy_training.SPLITS) - 1),
    st.sampled_from(ALL_LEVELS),
)
def test_all_strings_of_an_admitted_graph_are_allowed(seed: int, number: int, strictness: Strictness) -> None:
    types, edges = toy_training.graphs()[number]
    grammar = Grammar(toy_training.grammar().neighbourhoods, (), {}, strictness)
    string = encode(types, edges, toy_training.ALPHABET, np.random.default_rng(seed)).string
    check_string(string, toy_training.ALPHABET, grammar)
    vocabulary = Vocabulary(toy_training.ALPHABET, 4)
    codes = np.append(vocabulary.codes(string), END_TOKEN).astype(np.int64)
    masks, most = masks_along(compile_grammar(grammar, 3, 4), 4, codes)
    assert masks[np.arange(len(codes)), codes].all()
    assert follows_grammar(compile_grammar(grammar, 3, 4), 4, codes)
    # With as many tokens as its beginnings need, no token of it is left out for want of room.
    mask = GrammarMask(compile_grammar(grammar, 3, 4), 4, 1, max(most, len(codes) - 1))
    for code in codes:
        assert mask.allowed()[0, code]
        mask.take(np.array([code]))


@pytest.mark.parametrize(
    ("string", "place"),
    [("BCD", 2), ("A", 1), ("B(A)", 3), ("A0B0", 3), ("A00", 2)],
    ids=["no such neighbours", "ends too soon", "branch ends too soon", "edge twice", "edge to itself"],
)
def test_strings_outside_the_grammar_are_rejected_at_the_first_wrong_token(string: str, place: int) -> None:
    alphabet = make_alphabet(["a", "b", "c", "d"])
    around = {0: {((1, 2),): 1}, 1: {((0, 2),): 1, ((2, 1),): 1}, 2: {((1, 1),): 1}, 3: {((3, 1),): 1}}
    compiled, vocabulary = compile_grammar(Grammar(around, (), {}), 4, 1), Vocabulary(alphabet, 1)
    codes = np.append(vocabulary.codes(string), END_TOKEN).astype(np.int64)
    with pytest.raises(ValueError, match=f"token {place} is not allowed"):
        masks_along(compiled, 1, codes)
    assert not follows_grammar(compiled, 1, codes)


@given(st.integers(0, 2**32), st.sampled_from(sorted(GRAMMARS)), st.sampled_from(ALL_LEVELS))
def test_partial_grammars_admit_parts_with_missing_neighbors(seed: int, name: str, strictness: Strictness) -> None:
    known = GRAMMARS[name]
    grammar = Grammar(known.neighbourhoods, known.dockings, {}, strictness, known.hubs)
    compiled = compile_grammar(grammar, 3, 1, partial=True)
    counts = np.random.default_rng(seed).integers(0, 3, 3)
    kind = int(np.random.default_rng(seed).integers(3))
    wider = [counts + more for more in np.ndindex(4, 4, 4)]
    whole = [tuple((other, int(count)) for other, count in enumerate(counts) if count) for counts in wider]
    docked = all(
        compiled.high[compiled.first[kind] : compiled.first[kind + 1], other].any() for other in np.flatnonzero(counts)
    )
    wanted = docked and any(admits(grammar, kind, multiset) for multiset in whole)
    assert (tokens_to_complete(compiled, kind, counts, 0, True) < NO_COMPLETION) == wanted


def test_partial_grammars_admit_a_spanning_tree() -> None:
    grammar = grammar_of("A0BAB0")
    vocabulary = Vocabulary(AB, 1)
    tree = np.append(vocabulary.codes("ABAB"), END_TOKEN).astype(np.int64)
    with pytest.raises(ValueError, match="is not allowed"):
        masks_along(compile_grammar(grammar, 3, 1), 1, tree)
    masks_along(compile_grammar(grammar, 3, 1, partial=True), 1, tree)


@pytest.mark.parametrize("name", GRAMMARS)
def test_compiled_grammars_are_restored_from_their_patterns(name: str) -> None:
    compiled = compile_grammar(GRAMMARS[name], 3, 1)
    again = compile_patterns(patterns_json(compiled), 1)
    assert all(np.array_equal(one, other) for one, other in zip(compiled, again, strict=True))
