"""Setting search: candidate settings, the strictest first, each tried by a short search until one suffices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.randomness import decision_rng
from stages.autoconfig.contact_analysis import ContactAnalysis, Setting
from stages.autoconfig.lost_support import lost_support
from stages.autoconfig.settings import RANDOM_STREAM
from stages.autoconfig.trial_search import MAX_GROWTH_DEGREE, TrialResult, TrialSearch, has_low_diversity
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Assembly, ContactKind, Kit, Strictness
from stages.shape.resolved_settings import RESOLVED_HUB_SHARE
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.requirements.identity import common_labels

SUFFICIENT_GRAPHS = 80
"""Distinct graphs of a trial search that promise hundreds in a long one."""
SUFFICIENT_HISTOGRAMS = 16
MIN_SEEN_FILLINGS_SHARE = 0.85
"""Share of parts with slot fillings of the exemplars, below which a grammar of slots is too loose for a kit."""
MIN_USEFUL_GRAPHS = 20
PROMISING_HISTOGRAMS = 10
"""Histograms in the first tries that earn a setting more tries; by meaning one is enough, since hits build on hits."""
EXTENDED_TRIES_FACTOR = 4
MIN_KEPT_SHARE = 0.6
"""Share of the parts that must be kept if some are left out."""
MAX_PART_TRIES = 8_000_000
"""Tries times parts after which only grammars of slots are tried, since tries take longer the more parts there are."""
MAX_HUB_TYPES = 4
"""Most hub types that are left out."""
CANDIDATE_GRAMMARS: tuple[Strictness, ...] = ("multiset", "count_and_pairs", *SLOT_LEVELS)
STRICTER_LEVELS: dict[Strictness, Strictness] = {"count_and_pairs": "count_and_set"}
"""Levels that are tried only once a looser one suffices. As candidates of their own they would use up MAX_PART_TRIES.

Under `count_and_pairs` a floor of equal tiles may have holes, since each of the tiles around one has a seen number of
neighbours and no new pair. Under `count_and_set` it may not.
"""
CANDIDATE_KINDS: tuple[tuple[ContactKind, ...], ...] = (("point", "line", "face"), ("line", "face"), ("face",))


@dataclass(frozen=True)
class SearchSpace:
    """The candidates of a setting search.

    kinds: kinds of contact, the strictest first.
    grammars: levels of strictness, the strictest first.
    hubs: the hub types that are left out; None if the search decides.
    may_drop_pieces: whether exemplars may lose what is apart from their largest piece.
    keeps_types: whether hits keep the labels that occur in every exemplar.
    """

    kinds: tuple[tuple[ContactKind, ...], ...] = CANDIDATE_KINDS
    grammars: tuple[Strictness, ...] = CANDIDATE_GRAMMARS
    hubs: tuple[int, ...] | None = None
    may_drop_pieces: bool = True
    keeps_types: bool = False


@dataclass(frozen=True)
class CandidateSetting:
    """A setting and the result of its trial search.

    kept_share: share of all parts that the setting keeps.
    most_different: the most different hits, with their hubs restored.
    lost_support: labels whose parts lose what is close above or below them in these hits.
    """

    setting: Setting
    trial: TrialResult
    kept_share: float
    most_different: Sequence[Assembly] = ()
    lost_support: tuple[str, ...] = ()

    @property
    def score(self) -> tuple[float, ...]:
        """The order of candidates that do not suffice: diversity times kept parts, then graphs times kept parts.

        Hubs are not left out for next to nothing, and shapes that look broken or lack part types count less.
        """
        trial, kept = self.trial, self.kept_share / (1 + len(self.trial.lost_labels))
        few = self.setting.hubs and trial.graphs < MIN_USEFUL_GRAPHS
        if few or trial.seen_fillings_share < MIN_SEEN_FILLINGS_SHARE:
            return (0.0, 0.0)
        if self.lost_support:
            return (0.0, trial.graphs * kept)
        diversity = trial.histograms * min(trial.distance, 0.2) * min(trial.pair_distance, 0.2)
        return (diversity * kept, trial.graphs * kept)

    @property
    def is_sufficient(self) -> bool:
        """Whether it promises a pool of some size and diversity whose shapes do not look broken."""
        return (
            self.trial.graphs >= SUFFICIENT_GRAPHS
            and self.trial.histograms >= SUFFICIENT_HISTOGRAMS
            and self.trial.seen_fillings_share >= MIN_SEEN_FILLINGS_SHARE
            and not has_low_diversity(self.trial)
            and not self.lost_support
        )


def parts_without_hubs(analysis: ContactAnalysis, hubs: tuple[int, ...]) -> int:
    """Return the number of parts of all models that are kept in one piece without the types `hubs`."""
    return sum(map(len, analysis.kept_parts(Setting(CANDIDATE_KINDS[0], CANDIDATE_GRAMMARS[0], hubs))))


def search_settings(analysis: ContactAnalysis, space: SearchSpace, tries: int) -> list[CandidateSetting]:
    """Return the candidates that were tried, the chosen one last.

    The first sufficient candidate is chosen, or its level of STRICTER_LEVELS if that suffices too and loses no other
    labels; else the one of the best score, of equals the stricter one.
    Each has `tries` by each method, and more if it looks promising; after MAX_PART_TRIES only slots are tried. The
    loosest level of slots admits whatever the other levels admit: if it finds next to nothing, they are skipped.
    """
    return _SettingSearch(analysis, space, tries).run()


class _SettingSearch:
    """A setting search with what its candidates share: contacts, tests for copies and results by setting."""

    def __init__(self, analysis: ContactAnalysis, space: SearchSpace, tries: int) -> None:
        self._analysis, self._space, self._tries = analysis, space, tries
        self._tried: list[CandidateSetting] = []
        self._oracles: dict[tuple[ContactKind, ...], ContactOracle] = {}
        self._copies: dict[Setting, CopyDetector] = {}
        self._candidates: dict[Setting, CandidateSetting | None] = {}

    def run(self) -> list[CandidateSetting]:
        for setting in _settings(self._analysis, self._space):
            if self._is_skipped(setting):
                continue
            candidate = self._candidate(setting)
            if candidate is None:
                continue
            self._tried.append(candidate)
            if candidate.is_sufficient:
                return self._with_stricter(candidate)
        if self._tried:
            best = max(range(len(self._tried)), key=lambda index: (self._tried[index].score, -index))
            self._tried.append(self._tried.pop(best))
        return self._tried

    def _with_stricter(self, chosen: CandidateSetting) -> list[CandidateSetting]:
        """Return what was tried and the stricter level of a sufficient candidate, the chosen one of both last."""
        grammar = STRICTER_LEVELS.get(chosen.setting.grammar)
        if grammar is None or len(self._space.grammars) == 1:
            return self._tried
        stricter = self._candidate(replace(chosen.setting, grammar=grammar))
        if stricter is not None:
            keeps_as_much = set(stricter.trial.lost_labels) <= set(chosen.trial.lost_labels)
            is_chosen = stricter.is_sufficient and keeps_as_much
            self._tried.insert(len(self._tried) - (not is_chosen), stricter)
        return self._tried

    def _is_skipped(self, setting: Setting) -> bool:
        if setting.grammar not in SLOT_LEVELS:
            spent = sum(candidate.trial.tries for candidate in self._tried)
            return spent * self._analysis.part_count > MAX_PART_TRIES
        loosest = replace(setting, grammar=self._space.grammars[-1])
        candidate = self._candidate(loosest)
        return setting != loosest and (candidate is None or candidate.trial.histograms < PROMISING_HISTOGRAMS)

    def _candidate(self, setting: Setting) -> CandidateSetting | None:
        """Return the candidate of a setting, tried once; None if it keeps too little of the models."""
        if setting not in self._candidates:
            self._candidates[setting] = self._try_if_kept(setting)
        return self._candidates[setting]

    def _try_if_kept(self, setting: Setting) -> CandidateSetting | None:
        kept = self._analysis.kept_parts(setting)
        share = sum(map(len, kept)) / self._analysis.part_count
        drops_too_much = share < 1.0 and (not self._space.may_drop_pieces or (self._tried and share < MIN_KEPT_SHARE))
        if min(map(len, kept)) < 2 or drops_too_much:
            return None
        kit = self._analysis.kit(setting)
        min_hubs = 1 if self._space.hubs else RESOLVED_HUB_SHARE
        kept_labels = common_labels(kit) if self._space.keeps_types else ()
        asked = setting, self._tries, min_hubs if setting.hubs else 0, kept_labels
        if asked not in self._analysis.trials:
            self._analysis.trials[asked] = self._try(kit, setting, share, min_hubs, kept_labels)
        candidate: CandidateSetting = self._analysis.trials[asked]
        return candidate

    def _try(
        self, kit: Kit, setting: Setting, share: float, min_hubs: float, kept_labels: tuple[str, ...]
    ) -> CandidateSetting:
        if setting.kinds not in self._oracles:
            self._oracles[setting.kinds] = ContactOracle(kit)
        oracle = self._oracles[setting.kinds] = self._oracles[setting.kinds].under(kit)
        any_grammar = replace(setting, grammar=CANDIDATE_GRAMMARS[0])
        if any_grammar not in self._copies:
            self._copies[any_grammar] = CopyDetector(kit, oracle.dockings)
        return _try_setting(oracle, setting, self._tries, share, min_hubs, self._copies[any_grammar], kept_labels)


def _try_setting(
    oracle: ContactOracle,
    setting: Setting,
    tries: int,
    kept_share: float,
    min_hubs: float,
    copies: CopyDetector,
    keep_types: Sequence[str],
) -> CandidateSetting:
    """Search with the first tries, and with more if they found something different.

    min_hubs: hubs that a hit must get back, if the setting leaves hubs out. copies, keep_types: as for TrialSearch.
    """
    names = [oracle.kit.types[index].name for index in setting.hubs]
    rng = decision_rng(0, RANDOM_STREAM, setting.grammar, *setting.kinds, *names)
    search = TrialSearch(oracle, rng, min_hubs if setting.hubs else 0, copies=copies, keep_types=keep_types)
    candidate = _candidate_of(setting, kept_share, search, search.run(tries, SUFFICIENT_GRAPHS, evenly=True))
    promising = candidate.trial.histograms >= (1 if candidate.trial.by_meaning else PROMISING_HISTOGRAMS)
    if promising and not candidate.is_sufficient and not candidate.lost_support:
        wanted = EXTENDED_TRIES_FACTOR * SUFFICIENT_GRAPHS
        more = search.run((EXTENDED_TRIES_FACTOR - 1) * tries, wanted, evenly=True)
        candidate = _candidate_of(setting, kept_share, search, more)
    return candidate


def _candidate_of(setting: Setting, kept_share: float, search: TrialSearch, trial: TrialResult) -> CandidateSetting:
    most_different = [search.with_hubs(index) for index in trial.most_different]
    return CandidateSetting(setting, trial, kept_share, most_different, lost_support(search.kit, most_different))


def _settings(analysis: ContactAnalysis, space: SearchSpace) -> Iterator[Setting]:
    """Yield settings, the strictest first and slots last; settings that the models cannot tell apart come once.

    Fewer kinds of contact come before a looser grammar. Tiles of a race track that touch in a point are neighbours if
    all kinds count, and a looser grammar takes such a neighbour for the corner that leads on.
    """
    distinct: dict[tuple[ContactKind, ...], tuple[ContactKind, ...]] = {}
    for kinds in space.kinds:
        occurring = tuple(kind for kind in kinds if kind in analysis.kinds)
        if occurring:
            distinct.setdefault(occurring, kinds)
    counting = [grammar for grammar in space.grammars if grammar not in SLOT_LEVELS]
    for hubs in _hub_candidates(analysis, space):
        yield from (Setting(kinds, grammar, hubs) for grammar in counting for kinds in distinct.values())
    hubs = space.hubs or ()
    assemblies = analysis.counted(Setting(CANDIDATE_KINDS[0], CANDIDATE_GRAMMARS[0], hubs))
    degree = max(int(np.bincount(assembly.edges.ravel(), minlength=1).max()) for assembly in assemblies)
    slots = [grammar for grammar in space.grammars if grammar in SLOT_LEVELS and degree <= MAX_GROWTH_DEGREE]
    yield from (Setting(kinds, grammar, hubs) for kinds in distinct.values() for grammar in slots)


def _hub_candidates(analysis: ContactAnalysis, space: SearchSpace) -> Iterator[tuple[int, ...]]:
    """Yield no hubs, then the most connected type added one at a time, while most parts are kept."""
    if space.hubs is not None:
        yield space.hubs
        return
    hubs: tuple[int, ...] = ()
    yield hubs
    for _ in range(MAX_HUB_TYPES):
        most_connected = analysis.most_connected_type(hubs)
        if most_connected is None:
            return
        hubs = tuple(sorted((*hubs, most_connected)))
        if parts_without_hubs(analysis, hubs) < MIN_KEPT_SHARE * analysis.part_count:
            return
        yield hubs
