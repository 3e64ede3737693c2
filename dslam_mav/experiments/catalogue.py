"""All experiments by name."""

from __future__ import annotations

from dslam_mav.experiments.experiment import Experiment
from dslam_mav.experiments.noiseless import FIG5, FIG6, FIG8, FIG9
from dslam_mav.experiments.noisy import FIG10, FIG11, FIG12, FIG13, FIG14
from dslam_mav.experiments.parametric import FIG7
from dslam_mav.experiments.tables import TABLE2, TABLE3

ALL = (FIG5, FIG6, FIG7, FIG8, FIG9, FIG10, FIG11, FIG12, FIG13, FIG14, TABLE2, TABLE3)
EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in ALL}
