"""method="paper": the paper's algebra, a file for each of its steps; `method.py` reads as its algorithm."""
