"""The paper's figure 3 from a study's data set: composition of the outflow in each experiment of the plan.

python docs/examples/figure3.py results/dataset.nc figure3.png
"""

import sys

import matplotlib.pyplot as plt
import xarray as xr

data = xr.open_dataset(sys.argv[1])
fraction = data["mass_fraction"].mean("replicate").sel(size_class=["fine", "intermediate"])
figure, panels = plt.subplots(-(-data.sizes["experiment"] // 5), 5, sharex=True, sharey=True, squeeze=False)
for panel, experiment in zip(panels.flat, data["experiment"].values, strict=False):
    for size_class, style in {"fine": "-", "intermediate": "--"}.items():
        panel.plot(
            data["M"], fraction.sel(experiment=experiment, size_class=size_class), style, label=size_class
        )
    panel.set_title(experiment, fontsize="small")
panels[0, 0].legend(fontsize="xx-small")
figure.supxlabel("discharged mass fraction M")
figure.supylabel("mass fraction in the outflow")
figure.set_size_inches(9, 7)
figure.savefig(sys.argv[2], dpi=150)
