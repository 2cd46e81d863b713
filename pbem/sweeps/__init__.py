"""Many cases that differ in some values: what is computed of each, and the table of them all."""
