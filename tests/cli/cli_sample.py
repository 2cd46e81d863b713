"""A small case for the command line: two blocks on a joint that slips, solved in a moment."""

BLOCKS = """\
title = "Small blocks"
[units]
length = "m"
stress = "MPa"
[materials.soft]
young = 1000.0
poisson = 0.3
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 2 }
right_lower = { points = [[2, 0], [2, 1]], elements = 2 }
left_lower = { points = [[0, 0], [0, 1]], elements = 2 }
joint = { points = [[0, 1], [2, 1]], elements = 4 }
right_upper = { points = [[2, 1], [2, 2]], elements = 2 }
left_upper = { points = [[0, 1], [0, 2]], elements = 2 }
top = { points = [[0, 2], [2, 2]], elements = 2 }
[regions.lower]
material = "soft"
boundary = ["bottom", "right_lower", "joint", "left_lower"]
[regions.upper]
material = "soft"
boundary = ["top", "right_upper", "joint", "left_upper"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[interfaces.joint]
law = "coulomb"
friction = 0.2
[[stages]]
name = "press"
steps = 1
[stages.boundary.top]
ux = 0.0
uy = -0.01
[[stages]]
name = "shear"
steps = 2
[stages.boundary.top]
ux = 0.02
uy = -0.01
"""
