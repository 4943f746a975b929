//! Which demonstrations resemble an object.

use semfm_fmap::likeness::PlainFeatures;
use semfm_geom::LikenessScale;

use super::Memory;
use crate::files::EntryRecord;

/// A demonstration and how much the target resembles it at first sight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Its place among those that were looked at.
    pub place: usize,
    /// Cosine of the mean features.
    pub similarity: f64,
}

/// The `count` demonstrations whose mean feature is nearest to that of the target, most similar first; each is
/// given by its name and [descriptor](PlainFeatures::descriptor). Those that are equally similar stand by name.
///
/// Every one is looked at: ten thousand descriptors of 416 numbers take 28 ms on a busy machine, a
/// hundredth of what matching the shortlist takes, so there is no search tree.
pub fn shortlist<'a>(
    target: &PlainFeatures,
    demonstrations: impl Iterator<Item = (&'a str, &'a [f32])>,
    count: usize,
) -> Vec<Candidate> {
    let mut found: Vec<(Candidate, &str)> = demonstrations
        .enumerate()
        .map(|(place, (name, descriptor))| {
            let similarity = cosine(descriptor, target.descriptor());
            (Candidate { place, similarity }, name)
        })
        .collect();
    found.sort_by(|(a, name_a), (b, name_b)| {
        b.similarity.total_cmp(&a.similarity).then_with(|| name_a.cmp(name_b))
    });
    found.into_iter().map(|(candidate, _)| candidate).take(count).collect()
}

/// Entries that the scale of similarity is read off, at most: each is compared with each.
const MOST_COMPARED: usize = 200;

/// How similar the mean features of entries of different kinds are, and of one kind, in the owner's words: what the
/// features of an encoder that nobody measured are read by. None where no two entries have one kind, or all have.
pub(super) fn similarity_of_kinds(entries: &[EntryRecord]) -> Option<LikenessScale> {
    let named = entries.iter().filter(|entry| entry.kind.is_some()).take(MOST_COMPARED);
    let named: Vec<&EntryRecord> = named.collect();
    let (mut unlike, mut alike) = (Vec::new(), Vec::new());
    for (place, entry) in named.iter().enumerate() {
        for other in &named[..place] {
            let similarity = cosine(&entry.descriptor, &other.descriptor);
            if entry.kind == other.kind { &mut alike } else { &mut unlike }.push(similarity);
        }
    }
    if unlike.is_empty() || alike.is_empty() {
        return None;
    }
    LikenessScale::of(&unlike, &alike)
}

/// Of two vectors of unit length.
fn cosine(a: &[f32], b: &[f32]) -> f64 {
    f64::from(a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>())
}

impl Memory {
    /// [`shortlist`] of the entries, of one `kind` or of all.
    pub(super) fn candidates(
        &self,
        target: &PlainFeatures,
        kind: Option<&str>,
        count: usize,
    ) -> Vec<Candidate> {
        let entries = self.entries().iter().enumerate();
        let of_kind = entries.filter(|(_, entry)| kind.is_none() || entry.kind.as_deref() == kind);
        let places: Vec<usize> = of_kind.map(|(place, _)| place).collect();
        let entries = places.iter().map(|&place| &self.entries()[place]);
        let looked_at = entries.map(|entry| (entry.name.as_str(), entry.descriptor.as_slice()));
        let mut found = shortlist(target, looked_at, count);
        found.iter_mut().for_each(|candidate| candidate.place = places[candidate.place]);
        found
    }
}
