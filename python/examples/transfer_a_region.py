"""One demonstration, one new object: the short call, then the pieces it is made of."""

import numpy as np

import semfm


def main() -> None:
    # Two procedural tools stand in for scanned ones: a real object is `semfm.Mesh.read("mug.obj")`.
    # The built-in encoder makes the features; `encoder=` names another.
    hammer = semfm.demo_object("tools", instance=0, n_vertices=1500)
    pickaxe = semfm.demo_object("tools", instance=1, n_vertices=1500)
    result = semfm.transfer(hammer.mesh, pickaxe.mesh, hammer.region)
    print(f"{result.verdict} with confidence {result.confidence:.2f}")
    print(f"IoU with the true grip: {result.region.iou(pickaxe.region):.2f}")

    # Where on the target? The region's weighted centre, in the target's own frame.
    weights = result.weights
    centre = weights @ result.target.mesh.vertices / weights.sum()
    print(f"reach for {np.round(centre, 3)}")

    # How it came about: which parts were paired, and which source vertex each vertex stands for.
    for anchor in result.report["anchors"]:
        print(f"part {anchor['source']} ~ part {anchor['target']}: cosine {anchor['cosine']:.2f}")
    height = np.asarray(result.source.mesh.vertices)[:, 2]
    print(f"pulled back: {result.point_map.pull_back(height).shape}")
    for path in result.write("transfer"):
        print(path)


if __name__ == "__main__":
    main()
