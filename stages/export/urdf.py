"""URDF: links and joints as a tree, one file for each piece of a shape."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element, SubElement

from stages.export.mesh_files import MESH_FOLDER, hull_stem, mesh_files, mesh_stem
from stages.export.model import Link, LinkJoint, SimulationModel
from stages.export.obj import main_color
from stages.shape.arrays import FloatArray

MAX_EFFORT = 1000.0
"""Largest force of a joint in newtons, or torque in newton metres."""
MAX_SPEED = 10.0
"""In metres or radians a second."""
JOINT_DAMPING, JOINT_FRICTION = 0.5, 0.2
"""Of drawers in newton seconds a metre and newtons; of doors with radians in place of metres."""


def urdf_files(model: SimulationModel) -> Mapping[str, bytes]:
    """Return the URDF of each piece of a model, and the meshes, by their paths below its folder.

    A URDF is one tree. Of several pieces the files are `<name>-0.urdf` and so on, in one system of coordinates. If the
    base is fixed, the first link is `world`.
    """
    several = len(model.roots) > 1
    files = {}
    for index, root in enumerate(model.roots):
        name = f"{model.name}-{index}" if several else model.name
        robot = Element("robot", name=name)
        if model.fixed_base:
            _add_world(robot, model, root)
        _add_tree(robot, model, root)
        files[f"{name}.urdf"] = xml_bytes(robot)
    return {**files, **mesh_files(model)}


def xml_bytes(document: Element) -> bytes:
    """Return a document as indented XML."""
    ET.indent(document)
    content: bytes = ET.tostring(document, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def numbers(values: Iterable[float]) -> str:
    """Return numbers as text with nine digits."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def _add_world(robot: Element, model: SimulationModel, root: int) -> None:
    """Add the link `world`, to which simulators fix what hangs on it."""
    name = model.links[root].name
    SubElement(robot, "link", name="world")
    joint = SubElement(robot, "joint", name=f"world to {name}", type="fixed")
    SubElement(joint, "parent", link="world")
    SubElement(joint, "child", link=name)


def _add_tree(robot: Element, model: SimulationModel, link: int) -> None:
    waiting = [link]
    while waiting:
        index = waiting.pop()
        _add_link(robot, model, index)
        for joint in model.joints_below(index):
            _add_joint(robot, model, joint)
            waiting.append(joint.child)


def _add_link(robot: Element, model: SimulationModel, index: int) -> None:
    link = model.links[index]
    element = SubElement(robot, "link", name=link.name)
    _add_inertial(element, link)
    for part in link.parts:
        mesh = int(model.shape.assembly.types[part])
        pose = model.pose_in_link(index, part)
        for kind, stem in (("visual", mesh_stem(model, mesh)), ("collision", hull_stem(model, mesh))):
            shown = SubElement(element, kind, name=f"{model.shape.part_names[part]} {kind}")
            _add_origin(shown, pose)
            geometry = SubElement(shown, "geometry")
            SubElement(geometry, "mesh", filename=f"{MESH_FOLDER}/{stem}.obj")
            if kind == "visual":
                color = main_color(model.shape.meshes[mesh])
                material = SubElement(shown, "material", name=f"color {numbers(color)}")
                SubElement(material, "color", rgba=numbers([*color, 1.0]))


def _add_inertial(element: Element, link: Link) -> None:
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "origin", xyz=numbers(link.centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=numbers([link.mass]))
    entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    SubElement(inertial, "inertia", {name: numbers([link.inertia[place]]) for name, place in entries.items()})


def _add_joint(robot: Element, model: SimulationModel, joint: LinkJoint) -> None:
    parent, child = model.links[joint.parent].name, model.links[joint.child].name
    element = SubElement(robot, "joint", name=f"{parent} to {child}", type=joint.kind)
    _add_origin(element, model.child_frame(joint))
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    if joint.kind != "fixed":
        SubElement(element, "axis", xyz=numbers(joint.axis))
        limits = {"lower": 0.0, "upper": joint.upper, "effort": MAX_EFFORT, "velocity": MAX_SPEED}
        SubElement(element, "limit", {name: numbers([value]) for name, value in limits.items()})
        SubElement(element, "dynamics", damping=numbers([JOINT_DAMPING]), friction=numbers([JOINT_FRICTION]))


def _add_origin(element: Element, pose: FloatArray) -> None:
    from scipy.spatial.transform import Rotation

    # lower-case: fixed axes, as URDF has them
    angles = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz", suppress_warnings=True)
    SubElement(element, "origin", xyz=numbers(pose[:3, 3]), rpy=numbers(angles))
