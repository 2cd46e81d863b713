"""Tangent operators: factored, condensed onto the contact pairs, and by products for GMRES."""
