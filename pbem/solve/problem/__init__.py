"""The discretised problem: the interface between Newton's method and the system of equations with its tangent."""
