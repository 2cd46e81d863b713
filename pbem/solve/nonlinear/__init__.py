"""Newton's method for the contact statuses of one load step."""
