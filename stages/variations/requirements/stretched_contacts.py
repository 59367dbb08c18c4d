"""Contacts of shapes with stretched parts, tested on the meshes (substructures §5.2).

The contact oracle knows parts only in their own size.
"""

from __future__ import annotations

from stages.shape.geometry.contact import ContactTest, overlapping_boxes, world_boxes
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import relative_poses
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from stages.shape.stretch import STRETCHED_DEPTH

MAX_GAP_TOLERANCES = 1.1
"""Pairs of parts up to this many contact tolerances apart are tested, as in verification."""


def broken_contact(kit: Kit, assembly: Assembly) -> str | None:
    """Return why the contacts of an assembly are not those of its edges, or None.

    Reasons: `contact lost`, `touches what it should not`, or `parts clash`, where parts interpenetrate deeper than in
    the exemplars by more than STRETCHED_DEPTH of the smaller one.
    """
    shape = kit_shape(kit, assembly)
    meshes, types, poses = shape.meshes, shape.assembly.types, shape.assembly.poses
    boxes = world_boxes(meshes, types, poses)
    pairs = overlapping_boxes(boxes, MAX_GAP_TOLERANCES * kit.contact_tolerance)
    contact, penetration = ContactTest(meshes, kit.contact_tolerance), PenetrationTest(meshes)
    wanted = {(i, j) for i, j in assembly.edges.tolist()}
    if not wanted <= {(i, j) for i, j in pairs.tolist()}:
        return "contact lost"
    for (i, j), pose in zip(pairs.tolist(), relative_poses(poses, pairs), strict=True):
        a, b = int(types[i]), int(types[j])
        touches = contact.touches(a, b, pose)
        if (i, j) in wanted and not touches:
            return "contact lost"
        if (i, j) not in wanted and touches and contact.kind(a, b, pose) in kit.contact_kinds:
            return "touches what it should not"
        ends = sorted((int(assembly.types[i]), int(assembly.types[j])))
        allowed = kit.grammar.depths.get((ends[0], ends[1]), 0.0) + kit.contact_tolerance
        allowed += STRETCHED_DEPTH * min(meshes[a].diagonal, meshes[b].diagonal)
        if depth_bound(boxes[i], boxes[j]) > allowed and penetration.depth(a, b, pose) > allowed:
            return "parts clash"
    return None
