"""Global constraints: properties of a whole shape that no neighbourhood tells (substructures §5.3).

A constraint is a module of `stages.variations.constraints` with the constraint's name that defines `CONSTRAINT =
GlobalConstraint(...)`. A config asks for it by name, with the part labels that it concerns.
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
"""The labels of parts that a config gives a constraint, by role."""
Test = Callable[[Assembly], str | None]
"""Returns why an assembly is refused, or None."""
Repair = Callable[[Assembly], Assembly | None]
"""Returns an assembly with resized parts that is not refused, or None."""


@dataclass(frozen=True)
class GlobalConstraint:
    """A property that a config can require of every variant.

    needs: names of the lists of labels that must be given
    may: names of those that can be left out
    test: makes the test of a kit's assemblies
    repair: makes what tries to meet the constraint by resizing parts, where that can help
    """

    needs: tuple[str, ...]
    may: tuple[str, ...]
    test: Callable[[Kit, Labels], Test]
    repair: Callable[[Kit, Labels, Resizer], Repair] | None = None


def find_constraints(package: str = "stages.variations.constraints") -> dict[str, GlobalConstraint]:
    """Return all constraints by name. Raise TypeError for a module that declares none."""
    found: dict[str, GlobalConstraint] = {}
    for name in sorted(module.name for module in iter_modules(importlib.import_module(package).__path__)):
        declared = getattr(importlib.import_module(f"{package}.{name}"), "CONSTRAINT", None)
        if not isinstance(declared, GlobalConstraint):
            raise TypeError(f"{package.replace('.', '/')}/{name}.py must hold CONSTRAINT = Constraint(...)")
        found[name] = declared
    return found


def module_of(name: str) -> str:
    """Return the module that holds a constraint."""
    return f"stages.variations.constraints.{name}"


def unknown_in(constraints: Mapping[str, Labels]) -> str | None:
    """Return what is wrong with the constraints of a config, and the remedy; None if nothing is."""
    known = find_constraints()
    for name, labels in constraints.items():
        if name not in known:
            return f"{name!r} is no constraint; did you mean {nearest_word(name, known) or ', '.join(known)!r}?"
        constraint = known[name]
        allowed = (*constraint.needs, *constraint.may)
        wrong = next((role for role in labels if role not in allowed), None)
        if wrong is not None:
            return f"{name} knows no {wrong!r}; it knows {', '.join(allowed) or 'no labels'}"
        missing = next((role for role in constraint.needs if not labels.get(role)), None)
        if missing is not None:
            return f"{name} needs {missing!r}: a list of labels of parts"
    return None


def build_test(kit: Kit, constraints: Mapping[str, Labels]) -> Test:
    """Return one test of all constraints of a config, in order. Raise ConfigError for labels that the kit does not
    have.
    """
    known = find_constraints()
    for name, labels in constraints.items():
        for role, listed in labels.items():
            named_labels(kit, listed, f"variations.require.constraints.{name}.{role}")
    tests = [known[name].test(kit, labels) for name, labels in constraints.items()]

    def unmet(assembly: Assembly) -> str | None:
        return next((reason for reason in (test(assembly) for test in tests) if reason is not None), None)

    return unmet


def build_repair(kit: Kit, constraints: Mapping[str, Labels], max_factor: float, rigid: Sequence[str]) -> Repair:
    """Return what resizes parts of an assembly until it meets all constraints of a config.

    most: largest factor of a part; rigid: labels of parts that keep their size. The repair returns None where it fails
        or a contact would break.
    """
    known, unmet, resizer = find_constraints(), build_test(kit, constraints), Resizer(kit, max_factor, rigid)
    makers = [(known[name].repair, labels) for name, labels in constraints.items()]
    repairs = [make_repair(kit, labels, resizer) for make_repair, labels in makers if make_repair is not None]

    def repaired(assembly: Assembly) -> Assembly | None:
        result: Assembly | None = assembly
        for repair in repairs:
            result = None if result is None else repair(result)
        if result is None or unmet(result) is not None or broken_contact(kit, result) is not None:
            return None
        return result

    return repaired
