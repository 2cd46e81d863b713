"""Parameter sweeps: many cases that differ in some values, the quantities computed for each, and their table."""
