"""Contact: laws and statuses of the pairs, their internal variables, and the constraint map.

Friction laws are in `strength.py` (one class each, and the table `LAWS`), `rate_and_state.py`, `barton_bandis.py` and
`cohesive.py`; `laws.py` holds the laws of all pairs as arrays, and `modes.py` the update of the contact statuses.
"""
