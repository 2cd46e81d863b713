"""Elements, collocation points and contact pairs as plain arrays, the same on every rank.

Curves are divided as the model says: the grading of elements is in `pbem.model` (`grading.py`, `sizing.py`), kinds of
elements are in `pbem.geometry.elements`.
"""
