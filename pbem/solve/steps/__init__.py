"""Load steps: stages, cut-backs, and the notes on each step."""
