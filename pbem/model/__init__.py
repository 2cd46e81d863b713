"""What is modelled: materials, curves, regions, interfaces and their laws, conditions and their history."""
