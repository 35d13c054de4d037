"""The bar's grid: differences, closures, nodes and half-nodes."""
