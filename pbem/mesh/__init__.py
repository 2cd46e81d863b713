"""Elements, collocation points and contact pairs as plain arrays, the same on every rank."""
