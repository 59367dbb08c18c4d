"""Do the contacts of a shape with stretched parts still hold, and no others? Asked of the meshes themselves, for
answers by relative pose are about parts as they are (substructures §5.2)."""

from __future__ import annotations

from stages.shape.geometry.contact import ContactTest, overlapping_boxes, world_boxes
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import relative_poses
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import kit_shape
from stages.shape.stretch import STRETCHED_DEPTH

NEAR = 1.1
"""Parts nearer to each other than so many contact tolerances are held against the record, as when it is verified."""


def broken_contact(kit: Kit, assembly: Assembly) -> str | None:
    """Why an assembly is none, or None: `contact lost`, `touches what it should not`, or `parts clash`, where a pair of
    parts reaches deeper into each other than in the exemplars by more than STRETCHED_DEPTH of the smaller one."""
    shape = kit_shape(kit, assembly)
    meshes, types, poses = shape.meshes, shape.assembly.types, shape.assembly.poses
    boxes = world_boxes(meshes, types, poses)
    pairs = overlapping_boxes(boxes, NEAR * kit.contact_tolerance)
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
