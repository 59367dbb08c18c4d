"""A global constraint: what holds of a shape as a whole and no neighbourhood tells (substructures §5.3).

A constraint is a module of `stages.variations.constraints`, which is called what the constraint is called and holds
`CONSTRAINT = Constraint(...)`. A config asks for it by name, with the part labels that it speaks of.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pkgutil import iter_modules

from pipeline.config import nearest_word
from stages.shape.kit import Assembly, Kit
from stages.variations.requirements.named_labels import named_labels
from stages.variations.requirements.resizing import Resizer
from stages.variations.requirements.stretched_contacts import broken_contact

Labels = Mapping[str, Sequence[str]]
"""What a config says of a constraint: labels of parts, by what they are to it."""
Test = Callable[[Assembly], str | None]
"""The reason why an assembly is refused, None if it is not."""
Repair = Callable[[Assembly], Assembly | None]
"""An assembly of which parts are resized so that it is not refused; None where there is none."""


@dataclass(frozen=True)
class GlobalConstraint:
    """needs: the names of the lists of labels without which it says nothing; may: those that may be left out; test:
    makes the test of a kit's assemblies, with what is known of its exemplars; mend: where resizing parts may help,
    makes what tries it."""

    needs: tuple[str, ...]
    may: tuple[str, ...]
    test: Callable[[Kit, Labels], Test]
    repair: Callable[[Kit, Labels, Resizer], Repair] | None = None


def find_constraints(package: str = "stages.variations.constraints") -> dict[str, GlobalConstraint]:
    """All constraints there are, by name. Raises TypeError for a module that declares none."""
    found: dict[str, GlobalConstraint] = {}
    for name in sorted(each.name for each in iter_modules(importlib.import_module(package).__path__)):
        declared = getattr(importlib.import_module(f"{package}.{name}"), "CONSTRAINT", None)
        if not isinstance(declared, GlobalConstraint):
            raise TypeError(f"{package.replace('.', '/')}/{name}.py must hold CONSTRAINT = Constraint(...)")
        found[name] = declared
    return found


def module_of(name: str) -> str:
    """The module that holds a constraint."""
    return f"stages.variations.constraints.{name}"


def unknown_in(asked: Mapping[str, Labels]) -> str | None:
    """What is wrong with the constraints that a config asks for, and what would be right; None if nothing is."""
    known = find_constraints()
    for name, labels in asked.items():
        if name not in known:
            return f"{name!r} is no constraint; did you mean {nearest_word(name, known) or ', '.join(known)!r}?"
        constraint = known[name]
        allowed = (*constraint.needs, *constraint.may)
        wrong = next((each for each in labels if each not in allowed), None)
        if wrong is not None:
            return f"{name} knows no {wrong!r}; it knows {', '.join(allowed) or 'no labels'}"
        missing = next((each for each in constraint.needs if not labels.get(each)), None)
        if missing is not None:
            return f"{name} needs {missing!r}: a list of labels of parts"
    return None


def build_test(kit: Kit, asked: Mapping[str, Labels]) -> Test:
    """One test of all constraints that are asked for, in their order. Raises ConfigError for labels of parts that the
    kit has not."""
    known = find_constraints()
    for name, labels in asked.items():
        for what, listed in labels.items():
            named_labels(kit, listed, f"variations.require.constraints.{name}.{what}")
    tests = [known[name].test(kit, labels) for name, labels in asked.items()]

    def unmet(assembly: Assembly) -> str | None:
        return next((reason for reason in (test(assembly) for test in tests) if reason is not None), None)

    return unmet


def build_repair(kit: Kit, asked: Mapping[str, Labels], most: float, rigid: Sequence[str]) -> Repair:
    """What resizes parts of an assembly, each by `most` times at most and those labelled `rigid` never, until it meets
    all constraints that are asked for; None for what cannot be mended so, or whose contacts would not hold."""
    known, unmet, resizer = find_constraints(), build_test(kit, asked), Resizer(kit, most, rigid)
    mends = [mend(kit, labels, resizer) for name, labels in asked.items() if (mend := known[name].repair) is not None]

    def mended(assembly: Assembly) -> Assembly | None:
        found: Assembly | None = assembly
        for mend in mends:
            found = None if found is None else mend(found)
        if found is None or unmet(found) is not None or broken_contact(kit, found) is not None:
            return None
        return found

    return mended
