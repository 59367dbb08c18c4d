"""A VAE of graphs of parts, as StructureNet is (Mo and others 2019): boxes within boxes, edges where they touch."""
