"""One demonstrated object, many that turn up: prepare once, ask often."""

import semfm


def main() -> None:
    settings = semfm.TransferSettings("fused", n_hypotheses=2)
    mug = semfm.demo_object("containers", instance=0, n_vertices=800)
    source = semfm.prepare(mug.mesh, features=mug.shared_features(), settings=settings)
    body = semfm.Region.from_mask(mug.parts == mug.part_names.index("body"))
    for instance in range(1, 4):
        found = semfm.demo_object("containers", instance=instance, n_vertices=800)
        target = semfm.prepare(found.mesh, features=found.shared_features(), settings=settings)
        matching = semfm.Matching(source, target, settings=settings)
        for name, region in (("grip", mug.region), ("body", body)):
            result = matching.transfer(region)
            print(f"{found.kind:8} {name:7} {result.verdict:7} {result.confidence:.2f}")


if __name__ == "__main__":
    main()
