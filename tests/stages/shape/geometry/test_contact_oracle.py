"""Contact answers are whole: what is known of a contact from one side alone is no answer."""

from __future__ import annotations

import numpy as np

from stages.shape.geometry.contact_lookup import FORBIDDEN_CONTACT, LABEL_BASE
from stages.shape.geometry.contact_oracle import ContactOracle
from tests.toy_kits.chains_and_rings import box, kit_of, pose, with_arrow

MESHES = {"plate": with_arrow(box(10.0, 0.2, 10.0)), "stud": with_arrow(box(0.5, 0.2, 0.3))}


def test_docking_seen_from_one_side_only_is_forbidden() -> None:
    """A stud below a plate: what turns it by a hair moves the plate, seen from the stud, by twenty hairs."""
    kit = kit_of(MESHES, [[("plate", pose(0, 0, 0)), ("stud", pose(2.0, -0.2, 1.0)), ("plate", pose(0, -0.4, 0))]])
    names = [part_type.name for part_type in kit.types]
    plate, stud = names.index("plate"), names.index("stud")
    answers, seen = ContactOracle(kit), kit.exemplars[0].assembly
    at = {entry: seen.poses[seen.types.tolist().index(entry)] for entry in (plate, stud)}
    answered = set()
    hair = kit.pose_tolerance / kit.types[stud].diagonal
    for angle in np.linspace(0, hair, 21):
        moved = at[stud] @ _turn(angle)
        value = answers.around(np.array([plate]), at[plate][None], stud, moved)[0]
        answered.add("refused" if value == FORBIDDEN_CONTACT else "docked")
        assert value == FORBIDDEN_CONTACT or (value // LABEL_BASE < 2 * len(kit.grammar.dockings) > value % LABEL_BASE)
    assert answered == {"refused", "docked"}


def _turn(angle: float) -> np.ndarray:
    """A turn about the vertical."""
    turn = np.eye(4)
    turn[[0, 2], [0, 2]], turn[0, 2], turn[2, 0] = np.cos(angle), np.sin(angle), -np.sin(angle)
    return turn
