"""The tools of shape matching: spectra, descriptors, functional maps, geodesics."""

import numpy as np

import semfm


def main() -> None:
    # A hammer and a stretched copy of it, so that the true map is known: the identity.
    hammer = semfm.demo_object("tools", n_vertices=1500).mesh
    longer = semfm.Mesh(hammer.vertices * [1.0, 1.1, 1.2], hammer.faces)
    source, target = semfm.Shape(hammer, k=60), semfm.Shape(longer, k=60)
    print("eigenvalues of the source", np.round(source.basis.values[:5], 1))
    print("eigenvalues of the target", np.round(target.basis.values[:5], 1))

    # Eight landmarks, clicked on both. Each vertex belongs to the nearest, along the surface.
    landmarks = semfm.farthest_points(hammer.vertices, 8)
    sides = []
    for shape in (source, target):
        distances = semfm.HeatGeodesics(shape.original).distances_from_each(landmarks)
        labels = shape.onto_working(distances.argmin(axis=1).astype(float)).astype(int)
        sides.append(semfm.diffused_indicators(shape.basis, labels, range(8), t=0.01))

    # Functional maps run source → target, point maps target → source.
    start = semfm.FunctionalMap.fit(
        source.basis,
        target.basis,
        *(heat[:20] for heat in sides),
        k=20,
        laplacian=0.01,
        coefficients=True,
    )
    refined = start.zoomout(source.basis, target.basis, k_final=60, step=5)
    for name, found in (("fitted", start), ("refined", refined)):
        source_of = found.to_point_map(source.basis, target.basis).source_of
        print(f"{name:8} {found}: mean error {error(source, source_of):.3f} of the diagonal")


def error(shape: semfm.Shape, source_of: np.ndarray) -> float:
    """Mean geodesic distance on the source between where a vertex is sent and where it belongs."""
    geodesics = semfm.HeatGeodesics(shape.working)
    asked = np.arange(0, len(source_of), 10)
    distances = geodesics.distances_from_each(asked)
    return float(distances[source_of[asked], np.arange(len(asked))].mean()) / shape.working.diagonal


if __name__ == "__main__":
    main()
