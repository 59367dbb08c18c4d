"""Samples that a trained model dreamt: strings drawn from it, put together as shapes, and kept where they are valid."""
