"""Generates shapes by sampling strings from trained models and instantiating them."""
