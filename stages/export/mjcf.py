"""MJCF: the links of a shape as nested bodies for MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement

from stages.export.mesh_files import MESH_FOLDER, hull_stem, mesh_files, mesh_stem
from stages.export.model import SimulationModel
from stages.export.obj import main_color
from stages.export.urdf import JOINT_DAMPING, JOINT_FRICTION, numbers, xml_bytes
from stages.shape.arrays import FloatArray

VISUAL_GROUP, COLLISION_GROUP = "2", "3"
"""MuJoCo draws group 2 and hides group 3, by default."""


def mjcf_files(model: SimulationModel) -> Mapping[str, bytes]:
    """Return the MJCF of a model and the meshes, by their paths below its folder.

    Each piece is a body with a free joint, unless the base is fixed. There is no ground: include the file in a scene.
    """
    root = Element("mujoco", model=model.name)
    # masses and inertias are stated, and a wide mesh has no volume that MuJoCo could measure
    SubElement(root, "compiler", angle="radian", autolimits="true", meshdir=MESH_FOLDER)
    assets, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    for index in model.hulls:
        for stem in (mesh_stem(model, index), hull_stem(model, index)):
            SubElement(assets, "mesh", name=stem, file=f"{stem}.obj", inertia="shell")
    bodies: dict[int, Element] = {}
    for index in model.roots:
        bodies[index] = _add_body(world, model, index, model.links[index].frame)
        if not model.fixed_base:
            SubElement(bodies[index], "freejoint", name=f"free {model.links[index].name}")
        _add_contents(bodies[index], model, index)
    for joint in model.joints:
        bodies[joint.child] = body = _add_body(bodies[joint.parent], model, joint.child, model.child_frame(joint))
        if joint.kind != "fixed":
            kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
            motion = {"axis": numbers(joint.axis), "range": numbers([0.0, joint.upper])}
            motion |= {"damping": numbers([JOINT_DAMPING]), "frictionloss": numbers([JOINT_FRICTION])}
            SubElement(body, "joint", {"name": model.links[joint.child].name, "type": kind, **motion})
        _add_contents(body, model, joint.child)
    contact = SubElement(root, "contact")
    for first, second in model.touching:
        SubElement(contact, "exclude", body1=model.links[first].name, body2=model.links[second].name)
    return {f"{model.name}.xml": xml_bytes(root), **mesh_files(model)}


def _add_body(parent: Element, model: SimulationModel, index: int, frame: FloatArray) -> Element:
    return SubElement(parent, "body", {"name": model.links[index].name, **_place(frame)})


def _add_contents(body: Element, model: SimulationModel, index: int) -> None:
    """Add the inertia of a link and the geoms of its parts, as they look and as they collide."""
    link = model.links[index]
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia.tolist()
    inertia = numbers([xx, yy, zz, xy, xz, yz])
    SubElement(body, "inertial", pos=numbers(link.centre), mass=numbers([link.mass]), fullinertia=inertia)
    for part in link.parts:
        mesh = int(model.shape.assembly.types[part])
        place = _place(model.pose_in_link(index, part))
        color = numbers([*main_color(model.shape.meshes[mesh]), 1.0])
        looks = {"type": "mesh", "mesh": mesh_stem(model, mesh), **place, "rgba": color, "mass": "0"}
        name = model.shape.part_names[part]
        SubElement(body, "geom", looks, name=name, group=VISUAL_GROUP, contype="0", conaffinity="0")
        collides = {"type": "mesh", "mesh": hull_stem(model, mesh), **place, "mass": "0"}
        SubElement(body, "geom", collides, name=f"{name} hull", group=COLLISION_GROUP)


def _place(pose: FloatArray) -> dict[str, str]:
    """Return the position and the quaternion, real part first, of a pose."""
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    return {"pos": numbers(pose[:3, 3]), "quat": numbers([quaternion[3], *quaternion[:3]])}
