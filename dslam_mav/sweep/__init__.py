"""Thousands of flights estimated and judged: points, who works them off, what is kept of them."""
