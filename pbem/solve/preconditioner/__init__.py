"""Subdomains that overlap, and the preconditioner made of their inverses."""
