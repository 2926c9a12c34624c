"""Build a reference.

A dense capture of one plot becomes the cloud that later captures are scored against, and that views are planned for.
On the command line: `fieldkit reference plot_7/ -o plot_7-reference`.
"""

# %%
import tempfile
from pathlib import Path

from small_plot import SETTINGS, photograph

from fieldkit import Context, build_reference, load_reference_report
from fieldkit.cache import StageCache
from fieldkit.clouds import read_cloud

folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
captures = photograph(folder / "plot_7")

# %% [markdown]
# The cache keeps what stages computed, so that a run that is repeated or interrupted goes on from there.
# `default_cache_root()` is the one of the command line.

# %%
context = Context(StageCache(folder / "cache"))
report = build_reference(captures, folder / "plot_7-reference", SETTINGS, context)
print(f"{report.right} of {report.images} photographs have a pose that counts")
print(f"their positions are {1000 * report.pose_rms_m:.1f} mm (RMS) from those of poses.csv")

# %% [markdown]
# The result is a folder. Its report can be read again, and its cloud goes to any program for point clouds.

# %%
again = load_reference_report(folder / "plot_7-reference")
cloud = read_cloud(folder / "plot_7-reference" / "cloud.ply")
print(f"{len(cloud):,} points, up to {cloud.points[:, 2].max():.2f} m high, made by fieldkit {again.fieldkit}")
