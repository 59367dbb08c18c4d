"""Rigid transforms that map parts of a surface onto others, and what they match."""
