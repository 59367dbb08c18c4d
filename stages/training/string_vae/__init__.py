"""A variational autoencoder of a kit's strings (strings §5)."""
