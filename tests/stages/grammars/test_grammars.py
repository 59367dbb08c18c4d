from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from eval.grammars.similarity import r_similarity, triangles_of
from stages.grammars.collisions import Collisions
from stages.grammars.derivation import START_SITE, Derivation, ResizedGrid
from stages.grammars.derivation_text import DerivationError, format_derivation, parse_derivation
from stages.grammars.derived_shape import (
    PlacedTerminal,
    compact_shape_of_text,
    exemplar_shape,
    placed_terminals,
    shape_of_derivation_text,
    surface_digest,
)
from stages.grammars.description import describe_grammar
from stages.grammars.distinct_shapes import random_derivation
from stages.grammars.editing import apply_option, editing_options
from stages.grammars.extraction.extract import ExtractedGrammar
from stages.grammars.files import load_grammar, write_grammar
from stages.grammars.grammar import ShapeGrammar
from tests.stages.symmetry.planted import area, wall


def original(grammar: ShapeGrammar, start: int) -> Derivation:
    return Derivation(start, tuple(known.original for known in grammar.productions[start].non_terminals))


def derived(grammar: ShapeGrammar, derivation: Derivation | ResizedGrid) -> np.ndarray:
    return triangles_of(shape_of_derivation_text(grammar, format_derivation(grammar, derivation)))


def similar_share(grammar: ShapeGrammar, shape: np.ndarray) -> float:
    """Return the share of 60 neighbourhoods that the exemplar has."""
    return r_similarity(wall(4), shape, grammar.radius, 60, np.random.default_rng(0)).share


class TestDerivations:
    def test_original_derivations_give_the_exemplar_back(self, grammar: ShapeGrammar) -> None:
        starts = grammar.productions_of_site[START_SITE]
        digests = {surface_digest(grammar, placed_terminals(grammar, original(grammar, start))) for start in starts}
        assert digests == {surface_digest(grammar, placed_terminals(grammar, ResizedGrid(0, grammar.grids[0].counts)))}
        for start in starts:
            assert area(derived(grammar, original(grammar, start))) == pytest.approx(area(wall(4)), rel=1e-7)

    def test_every_neighbourhood_of_random_shapes_is_one_of_the_exemplar(
        self, grammar: ShapeGrammar, collisions: Collisions
    ) -> None:
        """Symmetry §3.2, by an oracle that shares no code with the search."""
        shapes = {}
        for seed in range(10):
            drawn = random_derivation(grammar, collisions, 5, np.random.default_rng(seed))
            shapes[surface_digest(grammar, placed_terminals(grammar, drawn))] = derived(grammar, drawn)
        assert len(shapes) >= 3
        for shape in list(shapes.values())[:4]:
            share = similar_share(grammar, shape)
            assert share == 1.0

    def test_parsing_inverts_formatting(self, grammar: ShapeGrammar, collisions: Collisions) -> None:
        for seed in range(5):
            drawn = random_derivation(grammar, collisions, 4, np.random.default_rng(seed))
            assert parse_derivation(grammar, format_derivation(grammar, drawn)) == drawn
        assert parse_derivation(grammar, "G0[5]") == ResizedGrid(0, (5,))

    @pytest.mark.parametrize(
        ("text", "why"),
        [
            ("", "expected one of"),
            ("S99", "expected one of"),
            ("A0", "one of S0"),
            ("G9[1]", "no grid G9; it has G0"),
            ("G0[1,2]", "takes 1 numbers"),
            ("G0[999999999]", "takes 1 numbers"),
            ("(", "expected one of"),
        ],
    )
    def test_invalid_text_is_rejected_with_its_place(self, grammar: ShapeGrammar, text: str, why: str) -> None:
        with pytest.raises(DerivationError, match=why):
            parse_derivation(grammar, text)

    def test_trailing_text_is_rejected_with_its_place(self, grammar: ShapeGrammar) -> None:
        text = format_derivation(grammar, original(grammar, 0))
        with pytest.raises(DerivationError, match=f"at {len(text)} of"):
            parse_derivation(grammar, text + "A0")

    def test_compact_shape_has_only_its_own_meshes(self, grammar: ShapeGrammar) -> None:
        text = format_derivation(grammar, original(grammar, 0))
        whole, compact = shape_of_derivation_text(grammar, text), compact_shape_of_text(grammar, text)
        assert {mesh.name for mesh in compact.meshes} == {whole.meshes[kind].name for kind in whole.assembly.types}
        assert np.array_equal(triangles_of(compact), triangles_of(whole))
        assert compact.part_labels.tolist() == whole.part_labels.tolist()


class TestCollisions:
    def test_grids_of_any_size_do_not_collide(self, grammar: ShapeGrammar, collisions: Collisions) -> None:
        assert not any(collisions.grid_collides(ResizedGrid(0, (count,))) for count in (0, 1, 6))

    def test_terminal_collides_where_another_one_is(self, grammar: ShapeGrammar, collisions: Collisions) -> None:
        pieces = placed_terminals(grammar, ResizedGrid(0, (3,)))
        aside = pieces[0].pose.copy()
        aside[:3, 3] += (0.4, 0.1, 0.3)
        assert collisions.collides(PlacedTerminal(pieces[0].mesh, aside), pieces, [])
        away = pieces[0].pose.copy()
        away[1, 3] += 5.0
        assert not collisions.collides(PlacedTerminal(pieces[0].mesh, away), pieces, [])


class TestDigest:
    def test_digest_depends_on_neither_cuts_nor_pose(self, grammar: ShapeGrammar) -> None:
        one, other = (placed_terminals(grammar, ResizedGrid(0, (count,))) for count in (4, 5))
        turned = np.array([[0.0, -1, 0, 3], [1, 0, 0, -2], [0, 0, 1, 7], [0, 0, 0, 1]])
        moved = [PlacedTerminal(placed.mesh, turned @ placed.pose) for placed in one]
        assert surface_digest(grammar, one) == surface_digest(grammar, moved)
        assert surface_digest(grammar, one) != surface_digest(grammar, other)


class TestEditing:
    def test_end_of_the_wall_may_be_longer_or_shorter(self, found: ExtractedGrammar) -> None:
        """Symmetry figure 3c, d: a piece that contains what it replaces inserts, one contained in it deletes."""
        kinds: dict[str, int] = {}
        for index, options in editing_options(found).items():
            for option in options:
                kinds[option.kind] = kinds.get(option.kind, 0) + 1
                change = found.docked_pieces[option.other].area - found.docked_pieces[index].area
                assert option.kind != "insert" or change > 0
                assert option.kind != "delete" or change < 0
        assert kinds["insert"]
        assert kinds["delete"]

    def test_options_change_the_area_by_their_pieces_and_stay_similar(self, found: ExtractedGrammar) -> None:
        every = [option for options in editing_options(found).values() for option in options]
        options = [option for option in every if option.kind != "replace"]
        for option in options[:: max(1, len(options) // 3)]:
            stays, comes = apply_option(found, option)
            change = found.docked_pieces[option.other].area - found.docked_pieces[option.replaced].area
            assert stays.area + comes.area == pytest.approx((1 + change) * area(wall(4)), rel=0.02)
            share = similar_share(found.grammar, np.concatenate([stays.corners, comes.corners]))
            assert share == 1.0


class TestFiles:
    def test_loading_inverts_writing(self, found: ExtractedGrammar, tmp_path: Path) -> None:
        grammar, description = found.grammar, describe_grammar(found)
        text, arrays = io.BytesIO(), io.BytesIO()
        write_grammar(description, grammar, text, arrays)
        (tmp_path / "wall.json").write_bytes(text.getvalue())
        (tmp_path / "wall.tar").write_bytes(arrays.getvalue())
        back = load_grammar(tmp_path / "wall.json", tmp_path / "wall.tar")
        assert (back.unit, exemplar_shape(back).unit) == ("metre", "metre")
        for start in grammar.productions_of_site[START_SITE]:
            written = format_derivation(grammar, original(grammar, start))
            assert format_derivation(back, original(back, start)) == written
            assert (
                triangles_of(shape_of_derivation_text(back, written)) == derived(grammar, original(grammar, start))
            ).all()
        assert (derived(back, ResizedGrid(0, (6,))) == derived(grammar, ResizedGrid(0, (6,)))).all()
        assert back.labels == grammar.labels

    def test_json_lists_sites_productions_and_grids(self, found: ExtractedGrammar) -> None:
        stored = json.loads(json.dumps(describe_grammar(found)))
        assert stored["sites"][0]["name"] == "S"
        assert {name for site in stored["sites"] for name in site["productions"]} == {
            production["name"] for production in stored["productions"]
        }
        assert stored["grids"][0]["rows"][0]["cells"] == 3
        assert len(stored["editing"]) == stored["docked_pieces"]
