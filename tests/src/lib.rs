//! Roads through the built binary.
