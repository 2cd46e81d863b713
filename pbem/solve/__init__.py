"""The systems of equations, linear solvers and preconditioners, Newton's method, and the load stepping."""
