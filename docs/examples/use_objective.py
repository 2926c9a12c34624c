"""Use the objective directly.

What is a set of cameras worth? The objective photographs the plot from it, reconstructs the photographs and compares
the cloud with the plants. Methods of your own can be built on it.
"""

# %%
from small_plot import scene

from fieldkit.planning.objective.objective import Objective, ObjectiveSettings
from fieldkit.planning.objective.simulated import Proxy, SimulatedSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit_sim.simulation import ring

# %% [markdown]
# A proxy is a scene and its truth: points on the plants, and the volume that counts.

# %%
objective = Objective(SimulatedSource(Proxy.from_description(scene())), ObjectiveSettings("draft"))

# %% [markdown]
# Two circles of six cameras: one at the plant's height, one looking down on it. A set that does not reconstruct is no
# error: its value says so.

# %%
for height_m in (0.35, 0.9):
    cameras = Cameras.from_poses(ring(6, 0.85, height_m, (0.0, 0.0, 0.18)))
    found = objective.evaluate(cameras)
    counted = f"{found.right} of {len(found.views)} photographs"
    print(f"from {height_m} m: {counted}, {1000 * found.value_m:.1f} mm", found.failure)
objective.close()
