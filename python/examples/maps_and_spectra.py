"""The tools of shape matching: spectra, descriptors, functional maps, geodesics."""

import numpy as np

import semfm
import semfm.zoo


def main() -> None:
    sphere = semfm.zoo.icosphere(4)
    stretched = semfm.Mesh(sphere.vertices * [1.0, 1.2, 1.5], sphere.faces)
    source, target = semfm.Shape(sphere, k=40), semfm.Shape(stretched, k=40)
    print("eigenvalues", np.round(source.basis.values[:5], 2), np.round(target.basis.values[:5], 2))

    # A map from three landmarks' heat, refined by ZoomOut. Point maps run target → source.
    landmarks = [0, 1, 2]
    labels = np.full(sphere.n_vertices, 99)
    labels[landmarks] = landmarks
    heat = [semfm.diffused_indicators(s.basis, labels, landmarks) for s in (source, target)]
    fitted = semfm.FunctionalMap.fit(
        source.basis, target.basis, heat[0], heat[1], k=40, laplacian=1e-2, coefficients=True
    )
    start = semfm.FunctionalMap(fitted.matrix[:12, :12])
    refined = start.zoomout(source.basis, target.basis, k_final=40, step=4)
    source_of = refined.to_point_map(source.basis, target.basis)

    # How far from the truth, which is the identity here, along the source?
    geodesics = semfm.HeatGeodesics(sphere)
    asked = range(0, sphere.n_vertices, 500)
    errors = [geodesics.distances(j)[source_of.source_of[j]] for j in asked]
    print(f"{refined}: mean geodesic error {np.mean(errors):.3f} of radius 1")


if __name__ == "__main__":
    main()
