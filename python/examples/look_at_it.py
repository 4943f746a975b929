"""Pictures of a transfer, and the same in trimesh's hands: `pip install matplotlib trimesh`."""

import matplotlib

matplotlib.use("Agg")  # files only; leave it out for windows

import matplotlib.pyplot as plt

import semfm
import semfm.plot
from semfm.adapters import to_trimesh


def main() -> None:
    mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=1500) for i in (0, 1))
    result = semfm.transfer(
        mug.mesh,
        kettle.mesh,
        mug.region,
        source_embeddings=mug.embeddings("easy"),
        target_embeddings=kettle.embeddings("easy"),
    )
    semfm.plot.transfer(result).savefig("transfer.png", dpi=150)
    semfm.plot.confidence(result).savefig("confidence.png", dpi=150)
    semfm.plot.anchors(result).savefig("anchors.png", dpi=150)

    # Any function on the vertices, in axes of your own.
    figure, axes = plt.subplots(1, 2, figsize=(8, 4), layout="constrained")
    from_top = semfm.geodesic_distances(mug.mesh, int(mug.mesh.vertices[:, 2].argmax()))
    semfm.plot.mesh(mug.mesh, from_top, title="geodesic distance", ax=axes[0])
    semfm.plot.region(kettle.mesh, result.region, title=result.verdict, ax=axes[1])
    figure.savefig("mine.png", dpi=150)

    # A scene with both objects, the regions painted: .show() opens it, .export() writes it.
    to_trimesh(result).export("pair.glb")
    print("transfer.png, confidence.png, anchors.png, mine.png, pair.glb")


if __name__ == "__main__":
    main()
