"""The numbers of a real leg from its logs: least squares over batches of simulated legs."""
