"""Maps of traces and meshes of other programs, read as cases."""
