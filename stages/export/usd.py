"""OpenUSD as text: meshes with the physics schemas of USD (rigid bodies, masses, collision pieces, joints)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from stages.export.model import LinkJoint, SimulationModel
from stages.export.urdf import JOINT_DAMPING
from stages.shape.arrays import FloatArray
from stages.shape.kit import PartMesh
from stages.shape.views.palette import srgb_to_linear

HEADER = """#usda 1.0
(
    defaultPrim = "shape"
    metersPerUnit = 1
    kilogramsPerUnit = 1
    upAxis = "Z"
)
"""
INDENT = "    "


def usd_files(model: SimulationModel) -> Mapping[str, bytes]:
    """Return the stage of a model, by its file name.

    Each link is a prim with a rigid body, and each joint a prim among them. Each mesh is stored once.
    """
    names = _identifiers([link.name for link in model.links])
    moves = any(joint.kind != "fixed" for joint in model.joints)
    schemas = ["PhysicsArticulationRootAPI"] if moves else []
    lines = [HEADER, *_definition("Xform", "shape", schemas), "{", f"{INDENT}string name = {json.dumps(model.name)}"]
    for index, name in enumerate(names):
        lines += _indented(_link(model, index, name, names))
    for joint in model.joints:
        lines += _indented(_joint(model, joint, names))
    if model.fixed_base:
        for root in model.roots:
            lines += _indented(_fixed_root(model, root, names))
    lines += ["}", "", 'class "meshes"', "{"]
    for index, hull in model.hulls.items():
        lines += _indented(_mesh(f"mesh_{index}", model.shape.meshes[index], is_hull=False))
        lines += _indented(_mesh(f"hull_{index}", hull, is_hull=True))
    lines.append("}")
    return {f"{model.name}.usda": ("\n".join(lines) + "\n").encode()}


def _link(model: SimulationModel, index: int, name: str, names: list[str]) -> Iterator[str]:
    link = model.links[index]
    touching = [second for first, second in model.touching if first == index]
    schemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI", *(["PhysicsFilteredPairsAPI"] if touching else [])]
    moments, axes = np.linalg.eigh(link.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    yield from _definition("Xform", name, schemas, link.name)
    yield "{"
    yield f"{INDENT}matrix4d xformOp:transform = {_matrix(link.frame)}"
    yield f'{INDENT}uniform token[] xformOpOrder = ["xformOp:transform"]'
    yield f"{INDENT}float physics:mass = {_number(link.mass)}"
    yield f"{INDENT}point3f physics:centerOfMass = {_tuple(link.centre)}"
    yield f"{INDENT}float3 physics:diagonalInertia = {_tuple(moments)}"
    yield f"{INDENT}quatf physics:principalAxes = {_quaternion(axes)}"
    if touching:
        targets = ", ".join(f"</shape/{names[other]}>" for other in touching)
        yield f"{INDENT}rel physics:filteredPairs = [{targets}]"
    parts = _identifiers([model.shape.part_names[part] for part in link.parts])
    for part, part_name in zip(link.parts, parts, strict=True):
        mesh = int(model.shape.assembly.types[part])
        pose = model.pose_in_link(index, part)
        yield from _indented(_reference(part_name, f"mesh_{mesh}", pose, is_hull=False))
        yield from _indented(_reference(f"{part_name}_hull", f"hull_{mesh}", pose, is_hull=True))
    yield "}"


def _reference(name: str, mesh: str, pose: FloatArray, is_hull: bool) -> Iterator[str]:
    """Yield a placed mesh. Its schemas of physics are stated here, since some tools read only those of the prim."""
    schemas = ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI"] if is_hull else []
    yield from _definition("Mesh", name, schemas, reference=f"</meshes/{mesh}>")
    yield "{"
    yield f"{INDENT}matrix4d xformOp:transform = {_matrix(pose)}"
    yield f'{INDENT}uniform token[] xformOpOrder = ["xformOp:transform"]'
    yield "}"


def _mesh(name: str, mesh: PartMesh, is_hull: bool) -> Iterator[str]:
    yield from _definition("Mesh", name, [])
    yield "{"
    yield f"{INDENT}point3f[] points = [{', '.join(map(_tuple, mesh.vertices.tolist()))}]"
    yield f"{INDENT}int[] faceVertexCounts = [{', '.join(['3'] * len(mesh.faces))}]"
    yield f"{INDENT}int[] faceVertexIndices = [{', '.join(map(str, mesh.faces.reshape(-1).tolist()))}]"
    yield f'{INDENT}uniform token subdivisionScheme = "none"'
    if is_hull:
        yield f'{INDENT}uniform token purpose = "guide"'
        yield f'{INDENT}uniform token physics:approximation = "convexHull"'
    else:
        colors = ", ".join(map(_tuple, srgb_to_linear(mesh.face_colors).tolist()))
        yield f'{INDENT}color3f[] primvars:displayColor = [{colors}] (interpolation = "uniform")'
    yield "}"


def _joint(model: SimulationModel, joint: LinkJoint, names: list[str]) -> Iterator[str]:
    """Yield a joint. Its frames have their x axis along the axis of the joint."""
    kind = {"fixed": "Fixed", "revolute": "Revolute", "prismatic": "Prismatic"}[joint.kind]
    drive = {"revolute": "angular", "prismatic": "linear"}.get(joint.kind, "")
    turn = np.eye(3) if joint.kind == "fixed" else _turn_of_x(joint.axis)
    frame = model.child_frame(joint)
    schemas = [f"PhysicsDriveAPI:{drive}"] if drive else []
    yield from _definition(f"Physics{kind}Joint", f"{names[joint.child]}_joint", schemas)
    yield "{"
    yield f"{INDENT}rel physics:body0 = </shape/{names[joint.parent]}>"
    yield f"{INDENT}rel physics:body1 = </shape/{names[joint.child]}>"
    yield f"{INDENT}point3f physics:localPos0 = {_tuple(frame[:3, 3])}"
    yield f"{INDENT}quatf physics:localRot0 = {_quaternion(frame[:3, :3] @ turn)}"
    yield f"{INDENT}point3f physics:localPos1 = (0, 0, 0)"
    yield f"{INDENT}quatf physics:localRot1 = {_quaternion(turn)}"
    if drive:
        upper = np.degrees(joint.upper) if joint.kind == "revolute" else joint.upper
        yield f'{INDENT}uniform token physics:axis = "X"'
        yield f"{INDENT}float physics:lowerLimit = 0"
        yield f"{INDENT}float physics:upperLimit = {_number(upper)}"
        yield f"{INDENT}float drive:{drive}:physics:damping = {_number(JOINT_DAMPING)}"
        yield f"{INDENT}float drive:{drive}:physics:stiffness = 0"
    yield "}"


def _fixed_root(model: SimulationModel, root: int, names: list[str]) -> Iterator[str]:
    frame = model.links[root].frame
    yield from _definition("PhysicsFixedJoint", f"{names[root]}_world_joint", [])
    yield "{"
    yield f"{INDENT}rel physics:body1 = </shape/{names[root]}>"
    yield f"{INDENT}point3f physics:localPos0 = {_tuple(frame[:3, 3])}"
    yield f"{INDENT}quatf physics:localRot0 = {_quaternion(frame[:3, :3])}"
    yield "}"


def _definition(kind: str, name: str, schemas: Iterable[str], shown: str = "", reference: str = "") -> Iterator[str]:
    """Yield the head of a prim.

    shown: the name that people read, where it is not an identifier
    reference: path of the prim that it has its content from
    """
    facts = [f"displayName = {json.dumps(shown, ensure_ascii=False)}"] if shown and shown != name else []
    listed = ", ".join(json.dumps(schema) for schema in schemas)
    facts += [f"prepend apiSchemas = [{listed}]"] if listed else []
    facts += [f"prepend references = {reference}"] if reference else []
    yield f'def {kind} "{name}"'
    if facts:
        yield "("
        yield from (INDENT + fact for fact in facts)
        yield ")"


def _identifiers(names: Iterable[str]) -> list[str]:
    """Return distinct identifiers of USD for names: letters, digits and underscores."""
    found: list[str] = []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9_]", "_", name)
        word = word if re.match(r"[A-Za-z_]", word) else f"_{word}"
        while word in found:
            word += "_"
        found.append(word)
    return found


def _turn_of_x(axis: FloatArray) -> FloatArray:
    """Return a rotation that takes x to an axis, float64 (3, 3)."""
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    return np.stack([axis, across, np.cross(axis, across)], axis=1)


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (INDENT + line for line in lines)


def _number(value: float) -> str:
    return f"{value + 0.0:.9g}"


def _tuple(values: Iterable[float]) -> str:
    return f"({', '.join(map(_number, values))})"


def _matrix(pose: FloatArray) -> str:
    """Return a matrix as USD has it, for row vectors."""
    return f"({', '.join(map(_tuple, pose.T))})"


def _quaternion(rotation: FloatArray) -> str:
    from scipy.spatial.transform import Rotation

    x, y, z, real = Rotation.from_matrix(rotation).as_quat(canonical=True).tolist()
    return _tuple([real, x, y, z])
