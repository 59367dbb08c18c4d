"""Members of one name and two formats are two in Croissant."""

from __future__ import annotations

from stages.package.croissant import _identified


def test_the_second_member_of_a_name_is_called_by_its_format_too() -> None:
    names = ("glb", "points.npy", "normals1.npy", "normals1.png", "urdf.tar.gz", "caption.json")
    identifiers = [member["identifier"] for member in _identified([{"name": name} for name in names])]
    assert identifiers == ["glb", "points", "normals1", "normals1-png", "urdf", "caption"]
