"""The version, read by the build, by the package and by what writes files."""

__version__ = "0.1.0"
