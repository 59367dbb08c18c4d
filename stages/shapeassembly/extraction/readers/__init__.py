"""Readers_of_part_hierarchies,_by_file_format."""
