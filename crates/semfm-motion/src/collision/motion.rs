//! Whether anything touches on the straight way between two lists of joint values.

use super::checker::{CollisionChecker, Scratch, with_scratch};
use super::moving_body::Carried;
use crate::planning::{Contact, Validity};

/// Distances are looked at as far as this, metres: what is farther away is not worth the look. For the motions of
/// `check_problems` (crates/semfm-eval/examples) .05 takes a quarter longer, and .2 as long.
const LOOK: f64 = 0.1;

impl CollisionChecker {
    /// Whether nothing touches while each joint goes evenly from one value to the other (no short way round: the caller
    /// has unrolled continuous joints), both ends included.
    ///
    /// The way is cut in halves until all of it is covered: where the arm is free at a state, so is the part of the way
    /// around it on which no gap can close (`Approach`). While this says yes, nothing
    /// comes nearer than half the contact distance at any time, and nothing is nearer than all of it at the states that
    /// were looked at.
    pub fn motion_is_free(&self, from: &[f64], to: &[f64]) -> bool {
        if !(self.is_sound(from) && self.is_sound(to)) {
            return false;
        }
        with_scratch(|scratch| {
            scratch.travel.clear();
            scratch.travel.extend(from.iter().zip(to).map(|(from, to)| (to - from).abs()));
            scratch.carried.resize_with(self.groups.len(), Default::default);
            for (group, carried) in self.groups.iter().zip(&mut scratch.carried) {
                group.set_travel(&scratch.travel, carried);
            }
            scratch.open.clear();
            // The far end is the likelier to touch: the near one is mostly where the last motion ended.
            let Some(after) = self.free_share(from, to, 1.0, 1.0, scratch) else { return false };
            let Some(before) = self.free_share(from, to, 0.0, 1.0 - after, scratch) else {
                return false;
            };
            scratch.open.push_back([before, 1.0 - after]);
            while let Some([start, end]) = scratch.open.pop_front() {
                if start >= end {
                    continue;
                }
                let middle = start.midpoint(end);
                let most = 0.5 * (end - start);
                let Some(share) = self.free_share(from, to, middle, most, scratch) else {
                    return false;
                };
                if share < most {
                    scratch.open.extend([[start, middle - share], [middle + share, end]]);
                }
            }
            true
        })
    }

    /// How much of the motion before and after its state at `time` (0 to 1) is surely free, at most `most`; `None` where
    /// something touches at the state itself.
    fn free_share(
        &self,
        from: &[f64],
        to: &[f64],
        time: f64,
        most: f64,
        scratch: &mut Scratch,
    ) -> Option<f64> {
        let mut q = std::mem::take(&mut scratch.q);
        q.clear();
        q.extend(from.iter().zip(to).map(|(from, to)| from + time * (to - from)));
        self.place(&q, scratch);
        scratch.q = q;
        let Scratch { joints, centres, carried, travel, .. } = &mut *scratch;
        for ((group, carried), &centre) in self.groups.iter().zip(carried).zip(&*centres) {
            group.set_state(travel, joints, centre, carried);
        }
        let contact = self.contact();
        let kept = 0.5 * contact;
        let mut share = most;
        for pair in &self.scene_pairs {
            let approach = scratch.carried[pair.group].after(0);
            let wanted = (approach.gap(share) + kept).clamp(contact, LOOK);
            let gap = self.scene_gap(pair, scratch, wanted);
            if gap < contact {
                return None;
            }
            // Rounding must not leave slivers of the motion open.
            if gap < wanted || wanted == LOOK {
                share = share.min(approach.share(gap - kept));
            }
        }
        for pair in &self.group_pairs {
            let common = pair.common;
            let a = scratch.carried[pair.a].after(common);
            let approach = a.and(&scratch.carried[pair.b].after(common));
            let wanted = (approach.gap(share) + kept).clamp(contact, LOOK);
            let gap = self.group_gap(pair, scratch, wanted);
            if gap < contact {
                return None;
            }
            if gap < wanted || wanted == LOOK {
                share = share.min(approach.share(gap - kept));
            }
        }
        Some(share)
    }
}

impl Validity for CollisionChecker {
    fn is_free(&self, q: &[f64]) -> bool {
        Self::is_free(self, q)
    }

    fn motion_is_free(&self, from: &[f64], to: &[f64]) -> bool {
        Self::motion_is_free(self, from, to)
    }

    fn clearance(&self, q: &[f64]) -> f64 {
        Self::clearance(self, q)
    }

    fn displacement(&self, travel: &[f64]) -> f64 {
        let mut carried = Carried::default();
        let ways = self.groups.iter().map(|group| {
            group.set_travel(travel, &mut carried);
            carried.anywhere()
        });
        ways.fold(0.0, f64::max)
    }

    fn first_contact(&self, q: &[f64]) -> Option<Contact> {
        Self::first_contact(self, q)
    }
}
