//! Why candidates were refused, and the one that came nearest.

use crate::grasp::Grasp;

/// Why a candidate is no grasp, in the order in which candidates are examined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Reason {
    /// No opposite surface, or nothing between the pads.
    NoContact,
    /// The approach lies outside the asked cone (radians beyond it).
    Approach,
    /// Too little of a pad touches (share missing).
    Contact,
    /// The line between the contacts leaves a friction cone (radians beyond it).
    ForceClosure,
    /// Too little of a pad lies in the region (share missing).
    Region,
    /// Wider or narrower than the gripper or the limit allows (metres beyond it).
    Width,
    /// The gripper would be in the table, or nearer to it than asked (metres too near).
    Table,
    /// The gripper runs into the object where it grasps (metres to back off until it is free).
    Collision,
    /// The open gripper hits the object or the scene on its way in (metres to back off).
    ApproachPath,
    /// A finger hits something before its pad touches (metres to back off).
    Closing,
    /// The gripper runs into the scene where it grasps (metres to back off).
    Scene,
    /// The gripper would be inside of something solid (metres to back off).
    Inside,
    /// The open gripper is nearer to something than asked (metres too near).
    Clearance,
}

impl Reason {
    /// Every reason, in the order of examination.
    pub const ALL: [Self; 13] = [
        Self::NoContact,
        Self::Approach,
        Self::Contact,
        Self::ForceClosure,
        Self::Region,
        Self::Width,
        Self::Table,
        Self::Collision,
        Self::ApproachPath,
        Self::Closing,
        Self::Scene,
        Self::Inside,
        Self::Clearance,
    ];

    /// Its name in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoContact => "no_contact",
            Self::Approach => "approach",
            Self::Width => "width",
            Self::Table => "table",
            Self::Region => "region",
            Self::Contact => "contact",
            Self::ForceClosure => "force_closure",
            Self::Collision => "collision",
            Self::ApproachPath => "approach_path",
            Self::Closing => "closing",
            Self::Scene => "scene",
            Self::Inside => "inside",
            Self::Clearance => "clearance",
        }
    }

    /// Unit of the amount by which a candidate failed: `m`, `rad` or `share`.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Approach | Self::ForceClosure => "rad",
            Self::Region | Self::Contact => "share",
            _ => "m",
        }
    }

    /// One line for a person.
    pub fn explanation(self) -> &'static str {
        match self {
            Self::NoContact => "no opposite surface, or nothing between the pads",
            Self::Approach => "the approach lies outside the asked cone",
            Self::Width => "wider or narrower than the gripper or the limit allows",
            Self::Table => "the gripper would be in the table or too near to it",
            Self::Region => "too little of a pad lies in the region",
            Self::Contact => "too little of a pad touches",
            Self::ForceClosure => "the contacts would slip at this friction",
            Self::Collision => "the gripper runs into the object where it grasps",
            Self::ApproachPath => "the open gripper hits something on its way in",
            Self::Closing => "a finger hits something before its pad touches",
            Self::Scene => "the gripper runs into the scene where it grasps",
            Self::Inside => "the gripper would be inside of something solid",
            Self::Clearance => "the open gripper is nearer to something than asked",
        }
    }

    /// Names of the options (of the settings, of Python's `find_grasps`, with `-` for `_` of the shell) that would
    /// change it, the likeliest first.
    pub fn options(self) -> &'static [&'static str] {
        match self {
            Self::NoContact => &["scale", "n_samples"],
            Self::Approach => &["approach_cone", "approach"],
            Self::Width => &["scale", "width_range", "gripper"],
            Self::Table => &["table", "approach"],
            Self::Region => &["pad_in_region"],
            Self::Contact => &["gripper", "scale"],
            Self::ForceClosure => &["friction"],
            Self::Collision | Self::Closing => &["gripper", "n_samples"],
            Self::ApproachPath => &["scene", "gripper", "n_samples"],
            Self::Scene => &["scene_margin", "scene"],
            Self::Inside => &["scene"],
            Self::Clearance => &["clearance"],
        }
    }

    /// What to do about it, in a few words.
    pub fn advice(self) -> &'static str {
        match self {
            Self::NoContact => "check the scale, or grow the region over both sides of its part",
            Self::Approach => "widen the cone, or turn it",
            Self::Width => {
                "check the scale, allow other widths, or take a gripper that opens wider"
            }
            Self::Table => "check where the table is, or let the gripper come from above",
            Self::Region => "let less of each pad lie in the region, or enlarge the region",
            Self::Contact => "check the scale, or take a gripper with smaller pads",
            Self::ForceClosure => {
                "raise the friction if the pads hold better, or enlarge the region"
            }
            Self::Collision | Self::Closing => {
                "take a slimmer gripper, try more samples, or move the region to where there is room"
            }
            Self::ApproachPath => "clear the way, take a slimmer gripper, or try more samples",
            Self::Scene => {
                "keep less from the scene's points, or leave the object itself out of the scene"
            }
            Self::Inside => "leave out of the scene what encloses the gripper",
            Self::Clearance => "ask for less clearance",
        }
    }
}

/// What a candidate failed, and by how much in the unit of the reason.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Refusal {
    pub(crate) reason: Reason,
    pub(crate) by: f64,
}

impl Refusal {
    /// `Ok` where `by` is not positive: the amount by which a limit is missed.
    pub(crate) fn where_positive(reason: Reason, by: f64) -> Result<(), Self> {
        if by > 0.0 { Err(Self { reason, by }) } else { Ok(()) }
    }
}

impl From<Reason> for Refusal {
    /// A failure whose amount is not known.
    fn from(reason: Reason) -> Self {
        Self { reason, by: 0.0 }
    }
}

/// A refused candidate: what it failed, and by how much.
#[derive(Clone, Debug)]
pub struct Miss {
    /// The first thing that it failed.
    pub reason: Reason,
    /// By how much, in the unit of the reason.
    pub by: f64,
    /// The candidate; what comes after the failed stage is zero, its score included.
    pub grasp: Grasp,
}

/// How many candidates failed at each stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rejected {
    counts: [usize; Reason::ALL.len()],
}

impl Rejected {
    /// Candidates refused for `reason`.
    pub fn count(&self, reason: Reason) -> usize {
        self.counts[reason as usize]
    }

    /// Candidates refused in all.
    pub fn total(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Reasons that occurred, with their counts, in the order of examination.
    pub fn iter(&self) -> impl Iterator<Item = (Reason, usize)> + '_ {
        Reason::ALL.into_iter().map(|reason| (reason, self.count(reason))).filter(|row| row.1 > 0)
    }

    /// The stage that kept most candidates from being grasps: of those that reached it, it let the smallest share
    /// through. `None` where nothing was refused.
    ///
    /// Each share is that of one more than passed, so that the last stage, which passes none where nothing is found,
    /// counts for little where few came so far.
    pub(crate) fn main_reason(&self, n_candidates: usize) -> Option<Reason> {
        let mut reached = n_candidates;
        let mut main = None;
        for (reason, count) in self.iter() {
            let passed = reached.saturating_sub(count);
            let share = (passed + 1) as f64 / (reached + 1) as f64;
            if main.is_none_or(|(_, least)| share < least) {
                main = Some((reason, share));
            }
            reached = passed;
        }
        main.map(|(reason, _)| reason)
    }

    pub(crate) fn add(&mut self, reason: Reason, n: usize) {
        self.counts[reason as usize] += n;
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, count)| *sum += count);
    }
}

impl FromIterator<(Reason, usize)> for Rejected {
    fn from_iter<I: IntoIterator<Item = (Reason, usize)>>(counted: I) -> Self {
        let mut rejected = Self::default();
        for (reason, count) in counted {
            rejected.counts[reason as usize] += count;
        }
        rejected
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_numbered_and_named_once() {
        let mut names = std::collections::BTreeSet::new();
        for (i, reason) in Reason::ALL.into_iter().enumerate() {
            assert_eq!(reason as usize, i);
            assert!(names.insert(reason.name()));
            assert!(!reason.options().is_empty() && !reason.advice().is_empty());
        }
        let mut counts = Rejected::default();
        counts.add(Reason::Width, 1);
        counts.merge(&counts.clone());
        assert_eq!(counts.iter().collect::<Vec<_>>(), [(Reason::Width, 2)]);
        assert_eq!(counts.total(), 2);
    }

    #[test]
    fn the_main_reason_is_what_keeps_most_back() {
        let counts = |rows: &[(Reason, usize)]| rows.iter().copied().collect::<Rejected>();
        // Too thick, but ten that a gripper could span run into the object.
        let thick =
            counts(&[(Reason::ForceClosure, 6000), (Reason::Width, 3990), (Reason::Collision, 10)]);
        assert_eq!(thick.main_reason(10_000), Some(Reason::Width));
        // Good grasps all of them, but for what is asked last.
        let near = counts(&[(Reason::ForceClosure, 9000), (Reason::Clearance, 1000)]);
        assert_eq!(near.main_reason(10_000), Some(Reason::Clearance));
        assert_eq!(Rejected::default().main_reason(0), None);
    }
}
