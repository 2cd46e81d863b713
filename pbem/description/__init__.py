"""The tables and keys of a case (`schema.py`), with their types, ranges, defaults and checks."""
