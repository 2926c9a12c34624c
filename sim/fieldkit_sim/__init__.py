"""The simulated field: maize, weeds, soil and light as meshes, and new plots of them.

fieldkit loads it by `fieldkit.scenes.simulated_field` where a scene is built or made, and nowhere else.
"""
