"""Conditions and loads of every kind, each in a model whose answer is known exactly, for `scripts/study_conditions.py`.

place: where a model lies, how large and in which units. field: displacements that the elements' shapes contain.
draft: a case as tables, and conditions that a field fulfils. trial: a case with the figures that tell how far its
results are off. values, loads, rest, joints, rigid, stages, planes: the conditions.
"""
