"""Closed-form integrals on straight elements and the rows of the boundary integral equations made from them."""
