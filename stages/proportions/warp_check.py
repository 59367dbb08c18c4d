"""Does a resized exemplar keep its contacts? Tested on its meshes.

The map moves vertices only, and a large face across several intervals stays straight where the map does not.
"""

from __future__ import annotations

from stages.shape.geometry.contact import ContactTest, overlapping_boxes, world_boxes
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import relative_poses
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import Shape
from stages.shape.stretch import STRETCHED_DEPTH


def warp_fault(kit: Kit, exemplar: Assembly, shape: Shape) -> str | None:
    """Return why a shape of `warped`, or of a layout, is rejected, or None.

    exemplar: the same parts by types of the kit, with the contacts that they must have

    `contact lost`: parts that touch in the exemplar are apart by more than STRETCHED_DEPTH of the smaller one's
    diagonal. `parts clash`: parts without contact in the exemplar penetrate deeper than that.
    """
    meshes, kinds, poses = shape.meshes, shape.assembly.types.tolist(), shape.assembly.poses
    boxes = world_boxes(meshes, shape.assembly.types, poses)
    slack = [STRETCHED_DEPTH * meshes[kind].diagonal for kind in kinds]
    contact, penetration = ContactTest(meshes, kit.contact_tolerance), PenetrationTest(meshes)
    wanted = exemplar.edges
    for (i, j), pose in zip(wanted.tolist(), relative_poses(poses, wanted), strict=True):
        if not contact.touches(kinds[i], kinds[j], pose, kit.contact_tolerance + min(slack[i], slack[j])):
            return "contact lost"
    touching = {(i, j) for i, j in wanted.tolist()}
    pairs = overlapping_boxes(boxes, 0.0)
    for (i, j), pose in zip(pairs.tolist(), relative_poses(poses, pairs), strict=True):
        if (i, j) in touching:
            continue
        a, b = sorted((int(exemplar.types[i]), int(exemplar.types[j])))
        allowed = kit.grammar.depths.get((a, b), 0.0) + kit.contact_tolerance + min(slack[i], slack[j])
        is_near = depth_bound(boxes[i], boxes[j]) > allowed and contact.touches(kinds[i], kinds[j], pose, 0.0)
        if is_near and penetration.depth(kinds[i], kinds[j], pose) > allowed:
            return "parts clash"
    return None
