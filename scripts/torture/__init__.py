"""Seeded models of all kinds that a contact program meets, their runs, and what every run has to obey.

draft: a case as tables, its text, and the same case in other units. cracks, bodies, inclusions: the kinds of models.
kinds: all of them by name. runs: a model's run and its record. conditions: contact conditions, balance and energy of a
result. equilibrium: whether rigid bodies could be in balance at all. table: what is printed.
"""
