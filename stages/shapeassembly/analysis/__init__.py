"""Program_analysis:_signatures,_distances_and_statistics."""
