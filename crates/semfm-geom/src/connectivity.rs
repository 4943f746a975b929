//! Edges, components, boundaries: how the triangles of a mesh hang together.
