"""pbem: boundary elements for frictional contact in two-dimensional elasticity.

Signs, once for the whole program. The plane is x (right), y (up). Stress and traction are positive in tension; a
region's normal points out of it, and its boundary is travelled with the region on the left. A contact pair has a
first side r and a second side l; n is the outward normal of the first side and s is n turned by +90 degrees:

    opening  g_n = (u_l - u_r) . n + gap  >= 0
    slip     g_s = (u_l - u_r) . s
    traction p   = traction on the first side; p_n <= 0 in compression; the second side carries -p

Inside the program a point or a vector of the plane is one complex number x + iy.
"""

__version__ = "0.1.0"
