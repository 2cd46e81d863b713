"""The preconditioner of GMRES: overlapping subdomains (`schwarz.py`), or factors of many small bodies (`bodies.py`)."""
