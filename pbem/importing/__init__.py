"""Cases from maps of traces and from meshes: a reader for each format, entered in `importer.py`."""
