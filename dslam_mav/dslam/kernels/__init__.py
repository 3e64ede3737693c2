"""Compiled kernels of the search. Candidates are headings θ (L,), sources S (K, 2) measured from the start of their
first leg, and log amplitudes α (K,): a source adds e^{α − d²/C} φ(Y) to a leg (notation of theory, section 8).
"""
