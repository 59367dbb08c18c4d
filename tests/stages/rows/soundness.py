"""Is a layout what its meshes say?"""

from __future__ import annotations

import numpy as np

from stages.proportions.warp_check import warp_fault
from stages.rows.layout import Layout
from stages.shape.geometry.contact import ContactTest
from stages.shape.kit import Kit


def assert_contacts_hold(kit: Kit, layout: Layout) -> None:
    """Assert that parts touch where a layout has contacts and nowhere else, by the contact test on their meshes."""
    shape = layout.shape(kit)
    found = ContactTest(shape.meshes, kit.contact_tolerance).contacts(shape.assembly.types, shape.assembly.poses)
    np.testing.assert_array_equal(found, layout.edges)
    assert warp_fault(kit, layout.assembly(), shape) is None


def assert_sound(kit: Kit, layout: Layout) -> None:
    """Assert that the contacts of a layout hold, and that it is in one piece."""
    assert_contacts_hold(kit, layout)
    assert layout.pieces().max() == 0
