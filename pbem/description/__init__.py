"""What a case says: its tables and keys with their types, ranges, defaults, and the faults they can have."""
