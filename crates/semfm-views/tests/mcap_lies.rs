//! Indexes, statistics and sizes that do not tell the truth, in files without a single checksum.
#![cfg(feature = "mcap")]

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions};
use semfm_views::mcap::read_bytes;

/// Two chunks with two channels, an attachment, a metadata record and all the indexes.
fn honest() -> Vec<u8> {
    let options = WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false)
        .calculate_attachment_crcs(false);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("S", "jsonschema", b"{}").unwrap();
    let channels = ["/a", "/b"]
        .map(|topic| writer.add_channel(schema, topic, "json", &BTreeMap::new()).unwrap());
    for i in 0..6u8 {
        let header = MessageHeader {
            channel_id: channels[usize::from(i % 2)],
            sequence: 0,
            log_time: 100 + u64::from(i),
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, &[b'x'; 10]).unwrap();
        if i == 3 {
            writer.flush().unwrap();
        }
    }
    let entries = BTreeMap::from([("k".to_owned(), "v".to_owned())]);
    writer.write_metadata(&Metadata { name: "m".to_owned(), metadata: entries }).unwrap();
    let attachment = Attachment {
        log_time: 1,
        create_time: 2,
        name: "a".to_owned(),
        media_type: "text/plain".to_owned(),
        data: Cow::Borrowed(b"data"),
    };
    writer.attach(&attachment).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// First byte of the body of the `nth` record of an opcode.
fn body(bytes: &[u8], opcode: u8, nth: usize) -> usize {
    let mut at = 8;
    let mut left = nth;
    while at + 9 <= bytes.len() - 8 {
        if bytes[at] == opcode {
            match left {
                0 => return at + 9,
                _ => left -= 1,
            }
        }
        at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    panic!("no record {nth} of opcode {opcode:#x}");
}

fn verdict(bytes: &[u8]) -> Result<u64, &'static str> {
    let contents = read_bytes(Path::new("lies.mcap"), bytes, |_| Ok(()));
    contents.map(|contents| contents.n_messages()).map_err(|error| error.code())
}

#[test]
fn the_honest_file_is_accepted() {
    assert_eq!(verdict(&honest()), Ok(6));
}

#[test]
fn every_number_that_lies_is_noticed() {
    const CHUNK: u8 = 0x06;
    const MESSAGE_INDEX: u8 = 0x07;
    const CHUNK_INDEX: u8 = 0x08;
    const ATTACHMENT_INDEX: u8 = 0x0A;
    const STATISTICS: u8 = 0x0B;
    const METADATA_INDEX: u8 = 0x0D;
    const SUMMARY_OFFSET: u8 = 0x0E;
    const FOOTER: u8 = 0x02;
    for (what, opcode, nth, offset, code) in [
        ("the chunk's first time", CHUNK, 0, 0, "count"),
        ("the chunk's last time", CHUNK, 1, 8, "count"),
        ("the chunk's size", CHUNK, 0, 16, "size"),
        ("an indexed time", MESSAGE_INDEX, 0, 6, "offset"),
        ("an indexed offset", MESSAGE_INDEX, 1, 14, "offset"),
        ("the channel of an index", MESSAGE_INDEX, 0, 0, "offset"),
        ("the first time of an index", CHUNK_INDEX, 0, 0, "count"),
        ("where the chunk is", CHUNK_INDEX, 1, 16, "offset"),
        ("how long the chunk is", CHUNK_INDEX, 0, 24, "size"),
        ("where a message index is", CHUNK_INDEX, 0, 38, "offset"),
        ("how long the message indexes are", CHUNK_INDEX, 0, 56, "offset"),
        ("the chunk's stored size", CHUNK_INDEX, 0, 68, "size"),
        ("the chunk's true size", CHUNK_INDEX, 0, 76, "size"),
        ("where the attachment is", ATTACHMENT_INDEX, 0, 0, "offset"),
        ("how long the attachment is", ATTACHMENT_INDEX, 0, 8, "offset"),
        ("the attachment's data", ATTACHMENT_INDEX, 0, 32, "offset"),
        ("where the metadata is", METADATA_INDEX, 0, 0, "offset"),
        ("the name of the metadata", METADATA_INDEX, 0, 20, "offset"),
        ("the number of messages", STATISTICS, 0, 0, "count"),
        ("the number of schemas", STATISTICS, 0, 8, "count"),
        ("the number of channels", STATISTICS, 0, 10, "count"),
        ("the number of attachments", STATISTICS, 0, 14, "count"),
        ("the number of metadata records", STATISTICS, 0, 18, "count"),
        ("the number of chunks", STATISTICS, 0, 22, "count"),
        ("the first time", STATISTICS, 0, 26, "count"),
        ("the last time", STATISTICS, 0, 34, "count"),
        ("the messages of a channel", STATISTICS, 0, 48, "count"),
        ("where a group is", SUMMARY_OFFSET, 0, 1, "offset"),
        ("how long a group is", SUMMARY_OFFSET, 1, 9, "offset"),
        ("where the summary is", FOOTER, 0, 0, "offset"),
        ("where the offsets are", FOOTER, 0, 8, "offset"),
    ] {
        let mut bytes = honest();
        let at = body(&bytes, opcode, nth) + offset;
        bytes[at] ^= 4;
        assert_eq!(verdict(&bytes), Err(code), "{what}");
    }
}

/// The file without its `nth` record of an opcode, with the footer's offsets set right.
fn without(opcode: u8, nth: usize) -> Vec<u8> {
    let mut bytes = honest();
    let start = body(&bytes, opcode, nth) - 9;
    let length = u64::from_le_bytes(bytes[start + 1..start + 9].try_into().unwrap()) as usize;
    bytes.drain(start..start + 9 + length);
    let footer = body(&bytes, 0x02, 0);
    // Without summary offsets: those would have to be moved one by one.
    let first_offset = body(&bytes, 0x0E, 0) - 9;
    bytes.drain(first_offset..footer - 9);
    let footer = body(&bytes, 0x02, 0);
    bytes[footer + 8..footer + 16].fill(0);
    bytes
}

#[test]
fn an_index_lists_everything_or_does_not_exist() {
    // One of two chunk indexes left out; the only attachment and metadata index; the statistics.
    assert_eq!(verdict(&without(0x08, 0)), Err("count"));
    assert_eq!(verdict(&without(0x0A, 0)), Ok(6));
    assert_eq!(verdict(&without(0x0D, 0)), Ok(6));
    assert_eq!(verdict(&without(0x0B, 0)), Ok(6));
}

#[test]
fn an_attachment_checksum_is_compared() {
    let mut bytes = honest();
    let at = body(&bytes, 0x09, 0);
    let length = u64::from_le_bytes(bytes[at - 8..at].try_into().unwrap()) as usize;
    let crc = crc32fast::hash(&bytes[at..at + length - 4]);
    bytes[at + length - 4..at + length].copy_from_slice(&crc.to_le_bytes());
    assert_eq!(verdict(&bytes), Ok(6));
    bytes[at + length - 5] ^= 1;
    assert_eq!(verdict(&bytes), Err("crc"));
}
