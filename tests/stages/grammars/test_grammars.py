from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from eval.grammars.similarity import r_similarity, triangles_of
from stages.grammars.collisions import Collisions
from stages.grammars.derivation import START, Derivation
from stages.grammars.derivation_text import (
    DerivationError,
    PlacedTerminal,
    ResizedGrid,
    compact_shape_of_text,
    format_derivation,
    parse_derivation,
    placed_terminals,
    shape_of_text,
    surface_digest,
)
from stages.grammars.description import describe_grammar
from stages.grammars.editing import apply_option, editing_options
from stages.grammars.extraction.extract import ExtractedGrammar
from stages.grammars.files import load_grammar, write_grammar
from stages.grammars.grammar import ShapeGrammar
from stages.grammars.random_derivations import random_derivation
from tests.stages.symmetry.planted import area, wall


def original(grammar: ShapeGrammar, start: int) -> Derivation:
    return Derivation(start, tuple(each.original for each in grammar.productions[start].non_terminals))


def made(grammar: ShapeGrammar, what: Derivation | ResizedGrid) -> np.ndarray:
    return triangles_of(shape_of_text(grammar, format_derivation(grammar, what)))


def similar(grammar: ShapeGrammar, shape: np.ndarray) -> float:
    """The share of 60 neighbourhoods that the exemplar has."""
    return r_similarity(wall(4), shape, grammar.radius, 60, np.random.default_rng(0)).share


class TestDerivations:
    def test_what_the_exemplar_has_everywhere_gives_the_exemplar_back(self, grammar: ShapeGrammar) -> None:
        starts = grammar.productions_of_site[START]
        digests = {surface_digest(grammar, placed_terminals(grammar, original(grammar, each))) for each in starts}
        assert digests == {surface_digest(grammar, placed_terminals(grammar, ResizedGrid(0, grammar.grids[0].counts)))}
        for each in starts:
            assert area(made(grammar, original(grammar, each))) == pytest.approx(area(wall(4)), rel=1e-7)

    def test_random_shapes_are_everywhere_like_the_exemplar_somewhere(
        self, grammar: ShapeGrammar, collisions: Collisions
    ) -> None:
        """Symmetry §3.2, by an oracle that shares no code with the search."""
        shapes = {}
        for seed in range(10):
            drawn = random_derivation(grammar, collisions, 5, np.random.default_rng(seed))
            shapes[surface_digest(grammar, placed_terminals(grammar, drawn))] = made(grammar, drawn)
        assert len(shapes) >= 3
        for shape in list(shapes.values())[:4]:
            share = similar(grammar, shape)
            assert share == 1.0

    def test_a_text_is_read_as_it_was_written(self, grammar: ShapeGrammar, collisions: Collisions) -> None:
        for seed in range(5):
            drawn = random_derivation(grammar, collisions, 4, np.random.default_rng(seed))
            assert parse_derivation(grammar, format_derivation(grammar, drawn)) == drawn
        assert parse_derivation(grammar, "G0[5]") == ResizedGrid(0, (5,))

    @pytest.mark.parametrize(
        ("text", "why"),
        [
            ("", "must stand here"),
            ("S99", "must stand here"),
            ("A0", "one of S0"),
            ("G9[1]", "no grid G9; it has G0"),
            ("G0[1,2]", "takes 1 numbers"),
            ("G0[999999999]", "takes 1 numbers"),
            ("(", "must stand here"),
        ],
    )
    def test_a_text_that_is_none_is_refused_with_its_place(self, grammar: ShapeGrammar, text: str, why: str) -> None:
        with pytest.raises(DerivationError, match=why):
            parse_derivation(grammar, text)

    def test_what_stands_after_a_derivation_is_pointed_at(self, grammar: ShapeGrammar) -> None:
        text = format_derivation(grammar, original(grammar, 0))
        with pytest.raises(DerivationError, match=f"at {len(text)} of"):
            parse_derivation(grammar, text + "A0")

    def test_a_shape_alone_has_the_meshes_that_stand_in_it(self, grammar: ShapeGrammar) -> None:
        text = format_derivation(grammar, original(grammar, 0))
        whole, alone = shape_of_text(grammar, text), compact_shape_of_text(grammar, text)
        assert {each.name for each in alone.meshes} == {whole.meshes[each].name for each in whole.assembly.types}
        assert np.array_equal(triangles_of(alone), triangles_of(whole))
        assert alone.part_labels.tolist() == whole.part_labels.tolist()


class TestCollisions:
    def test_a_grid_of_any_size_runs_into_nothing(self, grammar: ShapeGrammar, collisions: Collisions) -> None:
        assert not any(collisions.whole(ResizedGrid(0, (count,))) for count in (0, 1, 6))

    def test_a_piece_where_another_stands_does(self, grammar: ShapeGrammar, collisions: Collisions) -> None:
        pieces = placed_terminals(grammar, ResizedGrid(0, (3,)))
        aside = pieces[0].pose.copy()
        aside[:3, 3] += (0.4, 0.1, 0.3)
        assert collisions.collides(PlacedTerminal(pieces[0].mesh, aside), pieces, [])
        away = pieces[0].pose.copy()
        away[1, 3] += 5.0
        assert not collisions.collides(PlacedTerminal(pieces[0].mesh, away), pieces, [])


class TestDigest:
    def test_shapes_are_one_however_they_are_cut_and_wherever_they_stand(self, grammar: ShapeGrammar) -> None:
        one, other = (placed_terminals(grammar, ResizedGrid(0, (count,))) for count in (4, 5))
        turned = np.array([[0.0, -1, 0, 3], [1, 0, 0, -2], [0, 0, 1, 7], [0, 0, 0, 1]])
        moved = [PlacedTerminal(each.mesh, turned @ each.pose) for each in one]
        assert surface_digest(grammar, one) == surface_digest(grammar, moved)
        assert surface_digest(grammar, one) != surface_digest(grammar, other)


class TestEditing:
    def test_an_end_of_the_wall_may_be_longer_or_shorter(self, found: ExtractedGrammar) -> None:
        """Symmetry figure 3c, d: what holds what it replaces inserts, what is held in it deletes."""
        kinds: dict[str, int] = {}
        for place, options in editing_options(found).items():
            for each in options:
                kinds[each.kind] = kinds.get(each.kind, 0) + 1
                less = found.docked_pieces[each.other].area - found.docked_pieces[place].area
                assert each.kind != "insert" or less > 0
                assert each.kind != "delete" or less < 0
        assert kinds["insert"]
        assert kinds["delete"]

    def test_what_is_inserted_or_deleted_is_as_large_as_it_says_and_like_the_exemplar(
        self, found: ExtractedGrammar
    ) -> None:
        listed = [each for listed in editing_options(found).values() for each in listed]
        options = [each for each in listed if each.kind != "replace"]
        for option in options[:: max(1, len(options) // 3)]:
            stays, comes = apply_option(found, option)
            change = found.docked_pieces[option.other].area - found.docked_pieces[option.docker].area
            assert stays.area + comes.area == pytest.approx((1 + change) * area(wall(4)), rel=0.02)
            share = similar(found.grammar, np.concatenate([stays.corners, comes.corners]))
            assert share == 1.0


class TestFiles:
    def test_a_grammar_comes_back_as_it_was_written(self, found: ExtractedGrammar, tmp_path: Path) -> None:
        grammar, described = found.grammar, describe_grammar(found)
        text, arrays = io.BytesIO(), io.BytesIO()
        write_grammar(described, grammar, text, arrays)
        (tmp_path / "wall.json").write_bytes(text.getvalue())
        (tmp_path / "wall.tar").write_bytes(arrays.getvalue())
        back = load_grammar(tmp_path / "wall.json", tmp_path / "wall.tar")
        for start in grammar.productions_of_site[START]:
            written = format_derivation(grammar, original(grammar, start))
            assert format_derivation(back, original(back, start)) == written
            assert (triangles_of(shape_of_text(back, written)) == made(grammar, original(grammar, start))).all()
        assert (made(back, ResizedGrid(0, (6,))) == made(grammar, ResizedGrid(0, (6,)))).all()
        assert back.labels == grammar.labels

    def test_the_json_says_what_may_stand_where(self, found: ExtractedGrammar) -> None:
        said = json.loads(json.dumps(describe_grammar(found)))
        assert next(each["name"] for each in said["non_terminals"]) == "S"
        assert {rule for each in said["non_terminals"] for rule in each["rules"]} == {
            each["name"] for each in said["rules"]
        }
        assert said["grids"][0]["rows"][0]["cells"] == 3
        assert len(said["editing"]) == said["dockers"]
