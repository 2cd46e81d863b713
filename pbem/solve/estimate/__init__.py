"""The second solution on a coarser mesh, from which errors are estimated."""
