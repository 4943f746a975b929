//! Whether an edge of a tree or a chord of a path is free.

use super::joint_space::between;
use super::validity::Validity;

/// True where the straight line from joint values that are free to others is. The end and some states between are asked
/// first: most lines that are not free are found there, in a fraction of what a motion takes. (To check states only, and
/// motions when the path is done, takes no less: most motions that are asked are free.)
pub(super) fn edge_is_free(validity: &impl Validity, from: &[f64], to: &[f64]) -> bool {
    validity.is_free(to)
        && SHARES.iter().all(|&share| validity.is_free(&between(from, to, share)))
        && validity.motion_is_free(from, to)
}

/// Places of the states that are asked first.
const SHARES: [f64; 3] = [0.5, 0.25, 0.75];
