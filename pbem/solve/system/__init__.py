"""The integral equations as stored: dense, or by the fast multipole method."""
