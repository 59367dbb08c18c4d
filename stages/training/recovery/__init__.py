"""The recovery network: its training shapes, model and losses (geocode §3.3)."""
