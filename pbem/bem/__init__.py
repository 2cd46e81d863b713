"""Closed-form integrals on straight and circular elements, and the rows of the integral equations made from them."""
