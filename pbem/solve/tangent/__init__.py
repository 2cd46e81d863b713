"""Tangent operators: factored, condensed onto the contact pairs, or applied by products for GMRES."""
