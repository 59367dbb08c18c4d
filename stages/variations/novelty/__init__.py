"""How new a variant is: its features, the MAP-Elites archive, verbatim pieces of exemplars, distances and their
summary.
"""
