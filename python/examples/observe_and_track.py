"""What a depth camera saw: as an object that a region is carried to, and from frame to frame."""

import tempfile

import numpy as np
import semfm


def main() -> None:
    # A kettle before a wall, rendered, stands in for a depth camera's pictures. Real ones are
    # `semfm.Observation.read("K.json", color="c.png", depth="d.png", mask="kettle.png")`, a bag
    # or a BOP scene `semfm.read_observations("recording.mcap")`.
    mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=1500) for i in (0, 1))
    low, high = kettle.mesh.bounds
    metres = semfm.Mesh(0.25 * (kettle.mesh.vertices - (low + high) / 2), kettle.mesh.faces)
    frames = [
        seen(semfm.Mesh(metres.vertices + [0.01 * i, 0, 0.6], metres.faces)) for i in range(5)
    ]

    # What was seen of it is an object like any other, in metres and in the camera's frame.
    surface = frames[0].surface()
    print(surface, f"and {len(surface.around)} points around it")
    result = semfm.transfer(mug.mesh, surface.mesh, mug.region, target_embeddings=surface.embed())
    print(f"{result.verdict}: {result.region} of what was seen")

    # Where the whole mesh is known, it is followed: each frame has a pose, a probability and a state.
    tracker = semfm.Tracker(metres, scale=1.0)
    with tempfile.TemporaryDirectory() as folder:
        bag = semfm.write_observations(f"{folder}/seen.mcap", frames)
        for frame in semfm.read_observations(bag):
            print(tracker.update(frame))


def seen(mesh: semfm.Mesh) -> semfm.Observation:
    """A mesh in the camera's frame, a metre before a wall, with its mask."""
    k = [[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]
    camera = semfm.Pinhole.from_matrix(k, 320, 240)
    view = semfm.render(mesh, [camera])[0]
    depth = np.where(np.isfinite(view.depth), view.depth, 1.0)
    return semfm.Observation(
        camera, color=view.rgb, depth=depth, masks={"kettle": view.triangles >= 0}
    )


if __name__ == "__main__":
    main()
