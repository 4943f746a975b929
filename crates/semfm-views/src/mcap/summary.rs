//! The summary section and the footer, held against what the data section really holds.
//!
//! A reader that trusts the summary shows what it says; so it must say the truth. Parts may be
//! missing (all of them are optional), but an index that lists some of a file's chunks,
//! attachments or metadata records must list each of them, once.

use std::collections::BTreeMap;

use super::contents::{Contents, TimeRange};
use super::layout::{Layout, StoredAttachment, StoredChunk, StoredMetadata};
use super::record::{Fields, HEAD, Place, Record, Records, check_crc, opcode};
use crate::{Fault, Result};

/// Reads from behind the Data End record to the end of the file.
pub(super) fn check<'a>(
    contents: &mut Contents,
    layout: &'a Layout,
    records: &mut Records<'a>,
    data_end: usize,
) -> Result<()> {
    check_summary_crc(records, data_end)?;
    let n_declared = [contents.schemas.len(), contents.channels.len()];
    let mut summary =
        Summary { layout, statistics: Vec::new(), groups: Vec::new(), indexed: BTreeMap::new() };
    let mut offsets = Vec::new();
    let place = Place { path: records.path, opcode: None, offset: data_end, chunk: None };
    let footer = loop {
        let record = records
            .next()?
            .ok_or_else(|| place.error(Fault::Truncated, "a Footer record behind it", "the end"))?;
        match record.opcode {
            opcode::FOOTER => break record,
            opcode::SUMMARY_OFFSET => offsets.push(record),
            other if opcode::is_foreign(other) => {}
            _ if !offsets.is_empty() => {
                return Err(record.misplaced("a Summary Offset or the Footer"));
            }
            _ => summary.record(contents, &record)?,
        }
    };
    let n_behind = records.end() - footer.end();
    if n_behind > 0 {
        let expected = "the magic bytes and the end of the file behind it";
        return Err(footer.place.error(Fault::Length, expected, format!("{n_behind} bytes more")));
    }
    summary.check_complete(footer.place)?;
    for record in &summary.statistics {
        check_statistics(contents, layout, n_declared, record)?;
    }
    for record in &offsets {
        summary.check_group(record)?;
    }
    check_footer(&footer, data_end, offsets.first())
}

/// Two offsets and a checksum: the specification promises that the footer will not grow.
const FOOTER_BYTES: usize = 8 + 8 + 4;

/// What the summary has said so far.
struct Summary<'a> {
    layout: &'a Layout,
    statistics: Vec<Record<'a>>,
    /// Runs of records of one kind: opcode, first byte, byte behind.
    groups: Vec<(u8, usize, usize)>,
    /// Offsets that each kind of index has listed.
    indexed: BTreeMap<u8, Vec<u64>>,
}

impl<'a> Summary<'a> {
    fn record(&mut self, contents: &mut Contents, record: &Record<'a>) -> Result<()> {
        let is_split = self.groups.iter().any(|group| group.0 == record.opcode);
        match self.groups.last_mut() {
            Some((opcode, _, end)) if *opcode == record.opcode => *end = record.end(),
            _ if is_split => {
                return Err(record.misplaced("the summary grouped by kinds of records"));
            }
            _ => self.groups.push((record.opcode, record.place.offset, record.end())),
        }
        match record.opcode {
            opcode::CHUNK_INDEX => self.chunk_index(record),
            opcode::ATTACHMENT_INDEX => self.attachment_index(record),
            opcode::METADATA_INDEX => self.metadata_index(record),
            // Judged at the end, when every channel is known.
            opcode::STATISTICS => {
                self.statistics.push(*record);
                Ok(())
            }
            // Some recorders declare channels here that never had a message.
            _ => match contents.declare(record)? {
                Some(_) => Ok(()),
                None => Err(record.misplaced("a record of the summary section, or the Footer")),
            },
        }
    }

    fn chunk_index(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let found = StoredChunk {
            times: TimeRange { first: fields.u64()?, last: fields.u64()? },
            offset: fields.u64()?,
            length: fields.u64()?,
            message_indexes: fields.channel_map()?,
            message_index_length: fields.u64()?,
            compression: fields.text()?.to_owned(),
            compressed_size: fields.u64()?,
            size: fields.u64()?,
        };
        let at = self.layout.chunks.binary_search_by_key(&found.offset, |chunk| chunk.offset);
        let chunk = at.ok().map(|at| &self.layout.chunks[at]);
        let place = record.place;
        let chunk = self.listed(record, found.offset, chunk)?;
        if chunk.sizes() != found.sizes() {
            return Err(place.error(Fault::Size, chunk.sizes(), found.sizes()));
        }
        if chunk.times != found.times {
            return Err(place.error(Fault::Count, chunk.times, found.times));
        }
        // An empty map says that there is no message index to be used.
        let is_left_out = found.message_indexes.is_empty() && found.message_index_length == 0;
        let agrees = found.message_index_length == chunk.message_index_length
            && (found.message_indexes.is_empty() || found.message_indexes == chunk.message_indexes);
        if !is_left_out && !agrees {
            return Err(place.error(Fault::Offset, chunk.indexes(), found.indexes()));
        }
        Ok(())
    }

    fn attachment_index(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let found = StoredAttachment {
            offset: fields.u64()?,
            length: fields.u64()?,
            log_time: fields.u64()?,
            create_time: fields.u64()?,
            data_size: fields.u64()?,
            name: fields.text()?.to_owned(),
            media_type: fields.text()?.to_owned(),
        };
        let at = self.layout.attachments.binary_search_by_key(&found.offset, |known| known.offset);
        let known = at.ok().map(|at| &self.layout.attachments[at]);
        let known = self.listed(record, found.offset, known)?;
        same(record, known, &found)
    }

    fn metadata_index(&mut self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let found = StoredMetadata {
            offset: fields.u64()?,
            length: fields.u64()?,
            name: fields.text()?.to_owned(),
        };
        let at = self.layout.metadata.binary_search_by_key(&found.offset, |known| known.offset);
        let known = at.ok().map(|at| &self.layout.metadata[at]);
        let known = self.listed(record, found.offset, known)?;
        same(record, known, &found)
    }

    /// Notes that an index has listed `offset`: a record of its kind stands there (`known`), and it
    /// was not listed before.
    fn listed<'k, T>(
        &mut self,
        record: &Record<'_>,
        offset: u64,
        known: Option<&'k T>,
    ) -> Result<&'k T> {
        let known = known.ok_or_else(|| {
            let expected = "the offset of a record of the indexed kind";
            record.place.error(Fault::Offset, expected, offset)
        })?;
        self.indexed.entry(record.opcode).or_default().push(offset);
        Ok(known)
    }

    /// Each kind of index is complete or absent, and lists nothing twice.
    fn check_complete(&mut self, place: Place<'_>) -> Result<()> {
        for (&opcode, offsets) in &mut self.indexed {
            let expected = match opcode {
                opcode::CHUNK_INDEX => self.layout.chunks.len(),
                opcode::ATTACHMENT_INDEX => self.layout.attachments.len(),
                _ => self.layout.metadata.len(),
            };
            let n_listed = offsets.len();
            offsets.sort_unstable();
            offsets.dedup();
            if n_listed != expected || offsets.len() != expected {
                let name = opcode::name(opcode);
                let expected = format!("one {name} for each of {expected} records in the summary");
                let found = format!("{n_listed}, for {} different records", offsets.len());
                return Err(place.error(Fault::Count, expected, found));
            }
        }
        Ok(())
    }

    /// A Summary Offset record names a whole group of the summary.
    fn check_group(&self, record: &Record<'_>) -> Result<()> {
        let mut fields = record.fields();
        let (opcode, start, length) = (fields.u8()?, fields.u64()?, fields.u64()?);
        let group = self.groups.iter().find(|group| group.0 == opcode);
        let found = format!("{length} bytes at byte {start}");
        match group {
            Some(&(_, first, end)) if (start, length) == (first as u64, (end - first) as u64) => {
                Ok(())
            }
            Some(&(_, first, end)) => {
                let name = opcode::name(opcode);
                let expected = format!("the {name} group, {} bytes at byte {first}", end - first);
                Err(record.place.error(Fault::Offset, expected, found))
            }
            // A group of private records is not ours to judge.
            None if opcode::is_foreign(opcode) => Ok(()),
            None if length == 0 => Ok(()),
            None => Err(record.place.error(Fault::Offset, "a group of the summary", found)),
        }
    }
}

/// What an index says of a record is what the record says.
fn same<T: PartialEq + std::fmt::Debug>(record: &Record<'_>, known: &T, found: &T) -> Result<()> {
    match known == found {
        true => Ok(()),
        false => {
            let (known, found) = (format!("{known:?}"), format!("{found:?}"));
            Err(record.place.error(Fault::Offset, known, found))
        }
    }
}

/// `n_declared`: schemas and channels of the data section. The summary may know more of them, and
/// recorders differ in whether they count those.
fn check_statistics(
    contents: &Contents,
    layout: &Layout,
    n_declared: [usize; 2],
    record: &Record<'_>,
) -> Result<()> {
    let mut fields = record.fields();
    let n_messages = fields.u64()?;
    let (n_schemas, n_channels) = (fields.u16()?, fields.u32()?);
    let (n_attachments, n_metadata, n_chunks) = (fields.u32()?, fields.u32()?, fields.u32()?);
    let times = TimeRange { first: fields.u64()?, last: fields.u64()? };
    let counts = fields.channel_map()?;
    check_count(record, "messages", contents.n_messages(), n_messages)?;
    if u64::from(n_schemas) != n_declared[0] as u64 {
        check_count(record, "schemas", contents.schemas.len() as u64, n_schemas.into())?;
    }
    if u64::from(n_channels) != n_declared[1] as u64 {
        check_count(record, "channels", contents.channels.len() as u64, n_channels.into())?;
    }
    check_count(record, "attachments", layout.attachments.len() as u64, n_attachments.into())?;
    check_count(record, "metadata records", layout.metadata.len() as u64, n_metadata.into())?;
    check_count(record, "chunks", layout.chunks.len() as u64, n_chunks.into())?;
    if let Some(TimeRange { first, last }) = contents.log_times {
        check_count(record, "as time of the first message", first, times.first)?;
        check_count(record, "as time of the last message", last, times.last)?;
    }
    if !counts.is_empty() {
        for id in contents.n_messages_of.keys().chain(counts.keys()) {
            let true_count = contents.n_messages_of.get(id).copied().unwrap_or(0);
            let stated = counts.get(id).copied().unwrap_or(0);
            check_count(record, &format!("messages on channel {id}"), true_count, stated)?;
        }
    }
    Ok(())
}

/// A count of the statistics is the true one.
fn check_count(record: &Record<'_>, what: &str, true_count: u64, stated: u64) -> Result<()> {
    match true_count == stated {
        true => Ok(()),
        false => Err(record.place.error(Fault::Count, format!("{true_count} {what}"), stated)),
    }
}

fn check_footer(
    footer: &Record<'_>,
    data_end: usize,
    first_offset: Option<&Record<'_>>,
) -> Result<()> {
    let place = footer.place;
    if footer.body.len() != FOOTER_BYTES {
        return Err(place.error(Fault::Length, "20 bytes", footer.body.len()));
    }
    let mut fields = footer.fields();
    let (summary_start, offset_start) = (fields.u64()?, fields.u64()?);
    let footer_start = place.offset;
    let summary_end = first_offset.map_or(footer_start, |record| record.place.offset);
    // Zero says that there is none.
    if !(summary_start == data_end as u64 || (summary_start == 0 && summary_end == data_end)) {
        let expected = format!("the summary section at byte {data_end}");
        return Err(place.error(Fault::Offset, expected, format!("byte {summary_start}")));
    }
    if !(offset_start == summary_end as u64 || (offset_start == 0 && first_offset.is_none())) {
        let expected = format!("the summary offsets at byte {summary_end}");
        return Err(place.error(Fault::Offset, expected, format!("byte {offset_start}")));
    }
    Ok(())
}

/// The checksum of the summary and of the footer's first two fields, compared before the summary is
/// read: a flipped bit should be called that. The footer has the same length in every file, so its
/// place is known; whether it really stands there is seen later.
fn check_summary_crc(records: &Records<'_>, data_end: usize) -> Result<()> {
    let footer_start = records.end().saturating_sub(HEAD + FOOTER_BYTES).max(data_end);
    let mut tail = Records { at: footer_start, ..*records };
    let Ok(Some(footer)) = tail.next() else { return Ok(()) };
    if footer.opcode != opcode::FOOTER || footer.body.len() != FOOTER_BYTES {
        return Ok(());
    }
    let (covered, crc) = records.from(data_end).split_at(records.end() - 4 - data_end);
    let mut crc = Fields { bytes: crc, place: footer.place };
    check_crc(crc.u32()?, covered, footer.place)
}
