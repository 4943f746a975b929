"""One demonstrated object, many that turn up: prepare once, ask often."""

import semfm


def main() -> None:
    settings = semfm.TransferSettings("fused", n_hypotheses=2)
    mug = semfm.demo_object("containers", instance=0, n_vertices=800)
    source = semfm.prepare(mug.mesh, features=mug.shared_features(), settings=settings)
    handle = mug.region
    rim = semfm.Region.near(mug.mesh, mug.mesh.vertices[0], radius=0.2)
    for instance in range(1, 4):
        found = semfm.demo_object("containers", instance=instance, n_vertices=800)
        target = semfm.prepare(found.mesh, features=found.shared_features(), settings=settings)
        matching = semfm.Matching(source, target, settings=settings)
        for name, region in (("handle", handle), ("rim", rim)):
            carried = matching.transfer(region)
            print(f"{found.kind:8} {name:7} {carried.verdict:7} {carried.confidence:.2f}")


if __name__ == "__main__":
    main()
