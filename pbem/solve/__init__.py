"""The distributed operator, linear solvers, Newton's method and the march through the load history."""
