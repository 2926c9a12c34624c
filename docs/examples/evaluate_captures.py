"""Evaluate captures and print their scores.

New photographs of a plot are reconstructed and compared with its reference. Nothing is optimised again. On the command
line: `fieldkit evaluate flights/ --reference plot_7-reference -o scores`.
"""

# %%
import tempfile
from pathlib import Path

from small_plot import SETTINGS, STATIONS, photograph

from fieldkit import Context, build_reference, evaluate, load_evaluation_report
from fieldkit.cache import StageCache

folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
context = Context(StageCache(folder / "cache"))
build_reference(photograph(folder / "dense"), folder / "reference", SETTINGS, context)

# %% [markdown]
# Two flights, one of all stations and one of six. A folder of folders is evaluated plot by plot.

# %%
photograph(folder / "flights" / "monday", seed=4)
photograph(folder / "flights" / "tuesday", STATIONS[:6], seed=5)
evaluate(folder / "flights", folder / "scores", SETTINGS, context, reference=folder / "reference")

# %%
for plot in load_evaluation_report(folder / "scores").plots:
    if plot.error is not None:
        print(f"{plot.name}: {plot.error.message}")
    elif plot.chamfer_m is not None and plot.f_score is not None:
        print(f"{plot.name}: {plot.right} of {plot.images} photographs, chamfer distance "
              f"{1000 * plot.chamfer_m:.1f} mm, F-score at 10 mm {plot.f_score['0.010']:.2f}")  # fmt: skip
