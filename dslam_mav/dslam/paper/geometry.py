"""From paired projections to every layout that stands: III-C, Appendices C, D, E, and what falls back."""

from __future__ import annotations

from itertools import combinations

from dslam_mav.dslam.paper.closed import by_closure
from dslam_mav.dslam.paper.distances import by_distances
from dslam_mav.dslam.paper.factorise import factorise
from dslam_mav.dslam.paper.layout import Failure, Layout, Projections, complete


def layouts(p: Projections, closed: bool) -> list[Layout] | Failure:
    """Layouts of these projections, by the step their numbers of sources and legs ask for."""
    k = len(p.y)
    if k == 1:
        return by_closure(p) if closed else Failure(
            "One source on an open path: its distance trades against its amplitude, whatever the path."
        )  # fmt: skip
    if k == 2 and p.dimensions == 2:
        return by_distances(p)
    found = factorise(p)
    if isinstance(found, Layout):
        return [found]
    return found if p.dimensions == 3 else _by_pairs(p, found)


def _by_pairs(p: Projections, why: Failure) -> list[Layout] | Failure:
    """Where the factorisation fails: any two of the sources settle the directions (Appendix C), these the others.

    PAPER DEVIATION: the paper has Appendix C for K = 2 only; theory, section 4, shows the failure to be the step's.
    """
    found: list[Layout] = []
    for pair in combinations(range(len(p.y)), 2):
        two = p._replace(
            **{name: getattr(p, name)[list(pair)] for name in ("y", "a", "c", "var_y", "var_ln_a", "c_first")}
        )
        answer = by_distances(two)
        if isinstance(answer, list):
            how = f"distances of sources {pair[0] + 1} and {pair[1] + 1}"
            found += [complete(layout.direction, p, how) for layout in answer]
    return found or Failure(f"{why.reason} Nor do the distances of any two of them settle the path.")
