"""The discretised problem: what Newton's method knows of a system of equations and of its tangent operator."""
