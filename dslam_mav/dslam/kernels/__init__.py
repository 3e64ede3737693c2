"""Compiled kernels of the search. Candidates are headings θ (L,), sources S (K, 2) measured from the start of their
first leg, and log amplitudes α (K,): a source adds e^{α − d²/C} φ(Y) to a leg (notation of theory, section 8).

Two forms of the same least squares: `fit` on generalised samples, exact, one candidate at a time, ends a round; all
before it (`corner`, `scan`, `beam_fit`) works on inner products (`products`), eight candidates at a time (`lanes`).
"""
