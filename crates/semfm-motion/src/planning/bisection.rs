//! Is a stretch of a curved motion free? Answered by clearance: what has to move farther than the gap cannot touch.

use super::validity::Validity;

/// A motion over one parameter (a curve's or time).
pub(crate) trait Stretch {
    /// Joint values at the parameter.
    fn position(&self, at: f64) -> Vec<f64>;
    /// For each joint an upper bound of its way from the position at `middle` within `middle` ± `half`.
    fn travel(&self, middle: f64, half: f64) -> Vec<f64>;
}

/// Where no point of the robot moves farther than this, metres, the middle answers for the stretch although its
/// clearance is less.
pub(crate) const RESOLUTION: f64 = 5e-4;

/// The first parameter within `from` … `to` at which something was found to touch. The ends are not asked.
pub(crate) fn first_contact(
    validity: &impl Validity,
    motion: &impl Stretch,
    from: f64,
    to: f64,
) -> Option<f64> {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let q = motion.position(middle);
    let displacement = validity.displacement(&motion.travel(middle, half));
    if displacement <= RESOLUTION {
        return (!validity.is_free(&q)).then_some(middle);
    }
    let clearance = validity.clearance(&q);
    if clearance > displacement {
        return None;
    }
    let before = first_contact(validity, motion, from, middle);
    if before.is_some() {
        return before;
    }
    if clearance <= 0.0 && !validity.is_free(&q) {
        return Some(middle);
    }
    first_contact(validity, motion, middle, to)
}
