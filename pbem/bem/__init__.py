"""Boundary integrals on straight and circular elements, and the rows of the integral equations made from them.

The kernels are C (`*.h`); `operator.py` is the dense operator, `hierarchical.py` the fast multipole method.
"""
