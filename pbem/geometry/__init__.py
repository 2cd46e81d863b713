"""Curves of straight and circular legs: their shapes, loops, crossings and distances."""
