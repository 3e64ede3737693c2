"""Three plots of a flight log: python three_plots.py flight.mcap plots.png (needs matplotlib)."""

import sys

import matplotlib.pyplot as plt

from dslam_mav import read_log

log = read_log(sys.argv[1])
answer = log.estimates[-1].estimate
figure, (readings, along, ground) = plt.subplots(1, 3, figsize=(15, 4.5), layout="constrained")

readings.plot(log.readings.time_s, log.readings.value, ".", markersize=2)
readings.set(title="Readings", xlabel="time, s", ylabel="reading")

for number, leg in enumerate(log.legs, 1):
    along.plot(leg.distance_m, leg.reading, label=f"leg {number}")
along.set(title="Along each leg", xlabel="distance, m", ylabel="reading")
along.legend(fontsize="small")

ground.plot(*answer.path.vertices_m[:, :2].T, "-o", markersize=3, label="path")
for place, sd_m in zip(answer.sources.position_m, answer.sd_m, strict=True):
    ground.add_patch(plt.Circle(place[:2], 2.45 * sd_m, alpha=0.3, color="C3"))
ground.plot(*answer.sources.position_m[:, :2].T, "x", color="C3", label="sources, 95 %")
ground.set(title=answer.verdict.name, xlabel="x, m", ylabel="y, m", aspect="equal")
ground.legend(fontsize="small")

figure.savefig(sys.argv[2])
