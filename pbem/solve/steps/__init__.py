"""Load steps: stages, cut-backs, and what is said of each step."""
