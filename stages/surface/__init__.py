"""Stage `surface`: exact facts about the surface of a shape, its watertight union, signed distances and occupancy."""
