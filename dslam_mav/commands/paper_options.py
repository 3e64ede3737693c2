"""Options of `paper`: one subcommand a figure or table, and all of them."""

from __future__ import annotations

import argparse
from typing import Any

from dslam_mav.commands.options import COUNT, SEED

WHAT = {
    "fig5": "an evolving field against its mid-leg static approximation",
    "fig6": "error of the centres on the first leg against the sensor's speed",
    "fig7": "a parametric trajectory over two sources",
    "fig8": "three sources, three legs, no noise",
    "fig9": "in space: four sources, six legs, no noise",
    "fig10": "two sources, an evolving field, 10 dB",
    "fig11": "error of the centres on one line against SNR, with the Cramér–Rao bound",
    "fig12": "error of the centres on one line against the sources' distance, with the bound",
    "fig13": "two separated sources with unknown activation times",
    "fig14": "one source on real recordings, a closed triangle",
    "table2": "known activation times: errors by K, SNR and sampling period",
    "table3": "unknown activation times: errors by SNR and sampling period",
    "all": "all of them",
}
TRIALS = 1000


def add_paper(commands: Any, example_of: type[argparse.HelpFormatter]) -> None:
    """`paper NAME` for every name, each with an example in its help."""
    text = "the paper's experiments: its figures, its method, the joint method and the bound"
    parser = commands.add_parser(
        "paper",
        help=text,
        description=f"{text[0].upper()}{text[1:]}, side by side, with pictures.",
        epilog="example: dslam-mav paper table2 --trials 50",
        formatter_class=example_of,
    )
    names = parser.add_subparsers(metavar="NAME", required=True)
    for name, what in WHAT.items():
        one = names.add_parser(
            name,
            help=what,
            description=f"{what[0].upper()}{what[1:]}.",
            epilog=f"example: dslam-mav paper {name} --trials 50 --out logs/paper",
            formatter_class=example_of,
        )
        one.set_defaults(run=("paper", "run"), experiment=name)
        one.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
        one.add_argument("--trials", metavar="N", type=COUNT, default=TRIALS, help=f"a row (default: {TRIALS})")
        one.add_argument("--seed", metavar="N", type=SEED, default=0, help="of the noise (default: 0)")
        one.add_argument("--workers", metavar="N", type=COUNT, help="processes (default: as many as cores)")
        one.add_argument("--out", metavar="DIR", default="logs/paper", help="for pictures (default: logs/paper)")
    _add_scenes(names, example_of)


def _add_scenes(names: Any, example_of: type[argparse.HelpFormatter]) -> None:
    what = "choose scenes that fit Table II, whose coordinates the paper does not print"
    one = names.add_parser(
        "scenes",
        help=what,
        description=f"{what[0].upper()}{what[1:]}.",
        epilog="example: dslam-mav paper scenes --scene table2_k2_static_30dB --draws 20 --out logs/scenes",
        formatter_class=example_of,
    )
    one.set_defaults(run=("paper_choose", "run"))
    one.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    one.add_argument("--scene", metavar="NAME", help="one scene file (default: all)")
    one.add_argument("--draws", metavar="N", type=COUNT, default=20, help="scenes tried a row (default: 20)")
    one.add_argument("--seed", metavar="N", type=SEED, default=0, help="of scenes (default: 0)")
    one.add_argument("--out", metavar="DIR", default="logs/scenes", help="for scene files (default: logs/scenes)")
