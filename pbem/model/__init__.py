"""The model: materials, curves, regions, interfaces and laws, conditions and their history; grading of elements."""
