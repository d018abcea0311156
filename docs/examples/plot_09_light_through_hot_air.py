"""
The same scene in Mitsuba
=========================

Shells are surfaces with a bsdf in a scene of Mitsuba. Here the integrator ``first_hit`` is
called through ``mi.render`` in a plain Mitsuba script, and its channels come back as a tensor.
"""

import matplotlib.pyplot as plt
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_mono")
import iriftrace.plugins
from iriftrace.scenes import folder_of

iriftrace.plugins.register()
file = folder_of("cylinder") / "scene.xml"
scene = mi.load_file(str(file), optimize=False, scale="0.2")
channels = np.array(mi.render(scene))
names = scene.sensors()[0].film().bitmap().struct_()
crossings = channels[:, :, [field.name for field in names].index("path.crossings")]

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
drawn = axes.imshow(crossings)
figure.colorbar(drawn, label="shells crossed")
axes.set_axis_off()

print(f"{channels.shape[2]} channels; up to {int(crossings.max())} crossings")
assert crossings.max() >= 13
