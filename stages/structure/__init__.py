"""Part hierarchies and symmetries of samples, where they are known or follow from the geometry."""
