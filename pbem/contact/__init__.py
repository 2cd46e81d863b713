"""Contact: laws and modes of the pairs, their history, and the map from the unknowns to displacements and tractions."""
