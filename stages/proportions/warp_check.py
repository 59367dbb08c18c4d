"""Does a shape in other proportions still hold together? Asked of its meshes: the map is followed by vertices alone,
and a large face across several intervals is straight where the map is not."""

from __future__ import annotations

from stages.shape.geometry.contact import ContactTest, overlapping_boxes, world_boxes
from stages.shape.geometry.penetration import PenetrationTest, depth_bound
from stages.shape.geometry.pose import relative_poses
from stages.shape.kit import Assembly, Kit
from stages.shape.shape import Shape
from stages.shape.stretch import STRETCHED_DEPTH


def warp_fault(kit: Kit, exemplar: Assembly, shape: Shape) -> str | None:
    """Why a shape that `warped` has made is none, or None: `contact lost`, where parts that touch in the exemplar are
    apart by more than STRETCHED_DEPTH of the smaller one's diagonal; `parts clash`, where parts without contact there
    reach into each other by more."""
    meshes, poses = shape.meshes, shape.assembly.poses
    boxes = world_boxes(meshes, shape.assembly.types, poses)
    slack = {part: STRETCHED_DEPTH * mesh.diagonal for part, mesh in enumerate(meshes)}
    contact, penetration = ContactTest(meshes, kit.contact_tolerance), PenetrationTest(meshes)
    wanted = exemplar.edges
    for (i, j), pose in zip(wanted.tolist(), relative_poses(poses, wanted), strict=True):
        if not contact.touches(i, j, pose, kit.contact_tolerance + min(slack[i], slack[j])):
            return "contact lost"
    touching = {(i, j) for i, j in wanted.tolist()}
    pairs = overlapping_boxes(boxes, 0.0)
    for (i, j), pose in zip(pairs.tolist(), relative_poses(poses, pairs), strict=True):
        if (i, j) in touching:
            continue
        a, b = sorted((int(exemplar.types[i]), int(exemplar.types[j])))
        allowed = kit.grammar.depths.get((a, b), 0.0) + kit.contact_tolerance + min(slack[i], slack[j])
        is_near = depth_bound(boxes[i], boxes[j]) > allowed and contact.touches(i, j, pose, 0.0)
        if is_near and penetration.depth(i, j, pose) > allowed:
            return "parts clash"
    return None
