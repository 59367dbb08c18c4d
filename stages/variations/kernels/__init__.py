"""Compiled code that all operators share: named tuples of arrays, tables of a kit, contacts and neighbourhoods of a
variant.
"""
