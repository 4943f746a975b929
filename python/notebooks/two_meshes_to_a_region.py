# %% [markdown]
# # From two meshes to a region
#
# One object was demonstrated to a robot: where to hold it. Here is where to hold another of its kind.
#
# SemFM finds semantic parts that two objects share, lays a *functional map* between their surfaces
# through those anchors, and transfers the demonstrated region along it. This notebook does so
# with two procedural objects and simulated embeddings, so that it runs anywhere within a minute:
# `pip install matplotlib notebook`. With your own objects only the first two cells change.

# %%
import matplotlib.pyplot as plt
import numpy as np

import semfm
import semfm.plot

mug = semfm.demo_object("containers", instance=0, n_vertices=2500)
kettle = semfm.demo_object("containers", instance=1, n_vertices=2500)
source, target = mug.mesh, kettle.mesh  # or semfm.Mesh.read("mug.obj"), from trimesh, from open3d
for name, mesh in (("source", source), ("target", target)):
    report = mesh.report()
    print(f"{name}: {mesh}, components: {report['components']}, watertight: {report['watertight']}")

# %% [markdown]
# ## The demonstration
#
# A region is a weight on each vertex of the source: painted, picked, masked in a camera's image, or
# everything near a contact. Here it is the handle, of which the procedural object knows.

# %%
demonstrated = mug.region  # or semfm.Region.near(source, contact=[x, y, z], radius=r)
figure, axes = plt.subplots(1, 2, figsize=(8, 4), layout="constrained")
semfm.plot.region(source, demonstrated, ax=axes[0], title="source: held here")
semfm.plot.mesh(target, ax=axes[1], title="target: hold it where?")
plt.show()

# %% [markdown]
# ## What a network sees
#
# An image encoder looks at views rendered from all around. For real objects,
# `semfm.ViewsFile(source, views).write("mug.views.mcap")` followed by
# `semfm-embed mug.views.mcap --encoder dinov2` at the shell writes the file to pass as
# `embeddings="mug.emb.mcap"`. Here the embeddings are made up: noisy, and they say so.

# %%
views = semfm.render(source, semfm.rig(source, count=14))
figure, axes = plt.subplots(1, 5, figsize=(10, 2.2), layout="constrained")
for ax, view in zip(axes, views):
    ax.imshow(view.rgb)
    ax.set_axis_off()
plt.show()
source_embeddings, target_embeddings = mug.embeddings("medium"), kettle.embeddings("medium")
print(f"{len(source_embeddings)} views × {source_embeddings.patches[0].data.shape[:2]} patches")
print(f"{source_embeddings.dim} dimensions, simulated: {source_embeddings.simulated}")

# %% [markdown]
# ## Two shapes
#
# Preparing an object lifts the embeddings onto its surface and computes the eigenfunctions of its
# Laplacian: the low frequencies of the shape, in which maps are small matrices. It is done once per
# object and can be cached (`cache=True`).

# %%
prepared = [
    semfm.prepare(source, embeddings=source_embeddings),
    semfm.prepare(target, embeddings=target_embeddings),
]
print(prepared[0].cloud, prepared[0].shape)
figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
for ax, number in zip(axes, (1, 4)):
    function = prepared[0].shape.basis.functions[:, number]
    on_given = prepared[0].shape.onto_original(function)
    semfm.plot.mesh(source, on_given, cmap="coolwarm", ax=ax, title=f"eigenfunction {number}")
semfm.plot.spectra({"source": prepared[0].shape, "target": prepared[1].shape}, ax=axes[2])
plt.show()

# %% [markdown]
# ## The map
#
# Matching a pair is costly next to asking it: one `Matching` transfers any number of regions. The
# functional map *C* takes coefficients of functions on the source to coefficients on the target; the
# point map runs the other way and says for each target vertex which source vertex it stands for.

# %%
matching = semfm.Matching(*prepared)
result = matching.transfer(demonstrated)
semfm.plot.anchors(result)
plt.show()
semfm.plot.functional_map(matching.functional_map)
plt.show()

# %% [markdown]
# ## The region
#
# Above the region, below the map as colours: equal colours are matched places.

# %%
semfm.plot.transfer(result)
plt.show()

# %% [markdown]
# ## May the robot rely on it?
#
# The confidence is agreement with an independent opinion. The verdict is *accept*, *check* (look
# first; the hypotheses say where else it could be) or *refuse*.

# %%
semfm.plot.confidence(result)
plt.show()
print(f"{result.verdict}, confidence {result.confidence:.2f}")
print(f"overlap with the true handle (IoU): {result.region.iou(kettle.region):.2f}")
weights = result.weights
centre = weights @ target.vertices / weights.sum()
print(f"reach for {np.round(centre, 3)}, in the target's own frame")

# %% [markdown]
# ## Further
#
# `result.write("transfer")` writes everything that `semfm-cli transfer` writes, among it a scene for
# Foxglove or Rerun; `semfm.adapters` hands all of this to trimesh, open3d, polyscope and rerun.
