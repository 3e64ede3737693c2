"""Figs. 5–9: without noise."""

from __future__ import annotations

from functools import partial

from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.experiments.experiment import Experiment, Shown, Worlds
from dslam_mav.experiments.limits import flight_line_bound
from dslam_mav.experiments.measures import FINISHED, first_centres, held_still, localise
from dslam_mav.experiments.pictures.curves import field_held_still, over_speed
from dslam_mav.experiments.pictures.layouts import scene_picture
from dslam_mav.experiments.tables import scene_of_table2
from dslam_mav.experiments.trials import Row

FIG5_PERIODS_S = (7.8125e-5, 1.65e-4, 1.65e-3)
FIG6_SPEEDS_M_S = (1.9, 3.0, 5.0, 8.0, 11.0, 15.0, 19.0, 30.0, 50.0)
FIG6_SNR_DB = 60.0


def _fig5(worlds: Worlds) -> list[Row]:
    world = worlds["fig5"]
    speeds = [world.spacing_m / period for period in FIG5_PERIODS_S]
    return [
        Row((f"{period:.5g}", f"{v:.4g}"), world.at(speed_m_s=v), held_still, once=True)
        for period, v in zip(FIG5_PERIODS_S, speeds, strict=True)
    ]


def _fig6(worlds: Worlds) -> list[Row]:
    base = worlds[scene_of_table2(2, 30, 1.65e-3)].at(snr_db=FIG6_SNR_DB)
    measure = partial(first_centres, relative=True)
    rows = []
    for v in FIG6_SPEEDS_M_S:
        world = base.at(speed_m_s=v)
        limits = {"Y": flight_line_bound(world, relative=True)}
        rows.append(Row((f"{v:g}", f"{world.spacing_m / v:.3g}"), world, measure, limits=limits))
    return rows


def _one(name: str, options: PaperOptions, printed: dict[str, float] | None = None) -> partial[list[Row]]:
    return partial(_single, name=name, options=options, printed=printed or {})


def _single(worlds: Worlds, name: str, options: PaperOptions, printed: dict[str, float]) -> list[Row]:
    world = worlds[name]
    k, legs = len(world.truth.amplitude), len(world.truth.vertices_m) - 1
    measure = partial(localise, options=options)
    return [Row((str(k), str(legs)), world, measure, printed=printed, once=True)]


ERRORS = (Shown("E_sources"), Shown("E_amp"), Shown("E_lines"))

FIG5 = Experiment(
    name="fig5",
    title="Fig. 5: an evolving field, and held still at its middle sample (IV-A)",
    worlds=("fig5",),
    columns=("T (s)", "v (m/s)"),
    shown=(Shown("reading", methods=("paper",)), Shown("Y", "m", methods=("paper",))),
    rows=_fig5,
    picture=field_held_still,
    notes=(
        "The paper prints no number. reading: largest difference between the field and its approximation, as a share "
        "of the largest reading; Y: what it does to the centre. The first row is the paper's T. The joint estimate "
        "uses the field as it evolves.",
    ),
)

FIG6 = Experiment(
    name="fig6",
    title="Fig. 6: relative error of Y_k1 on the first leg against the sensor's speed",
    worlds=(scene_of_table2(2, 30, 1.65e-3),),
    columns=("v (m/s)", "T (s)"),
    shown=(Shown("Y", average="rms", methods=("paper", "fitted", "joint")),),
    rows=_fig6,
    picture=over_speed,
    notes=(
        "The paper's: falls with the speed, negligible above 11 m/s. fitted: centres fitted to the leg's readings "
        "after the paper's filter, the field still held at its middle sample. joint: all legs, the field as it "
        "evolves. 60 dB; the bound is of all legs together.",
    ),
)

FIG8 = Experiment(
    name="fig8",
    title="Fig. 8: three sources, three legs, no noise",
    worlds=("fig8",),
    columns=("K", "L"),
    shown=ERRORS,
    rows=_one("fig8", FINISHED, {"E_sources": 4.6036e-10, "E_amp": 3.8365e-9, "E_lines": 9.2052e-10}),
    picture=scene_picture,
    notes=("Without noise the bound is zero.",),
)

FIG9 = Experiment(
    name="fig9",
    title="Fig. 9: in space, four sources, six legs, no noise",
    worlds=("fig9",),
    columns=("K", "L"),
    shown=(*ERRORS, Shown("misfit")),
    rows=_one("fig9", FINISHED),
    picture=scene_picture,
    notes=(
        "The paper prints no number, it shows the resynthesised readings to be the same: misfit is the largest "
        "difference, as a share of the largest reading. Errors after the orthogonal transformation that brings the "
        "paths together. Without noise the bound is zero.",
    ),
)
