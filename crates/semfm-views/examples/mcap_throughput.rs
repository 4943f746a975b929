//! How fast embeddings are written and read, in MB of payload per second of processor time (on Linux;
//! elsewhere per second), best of five.
//!
//! `cargo run --release -p semfm-views --example mcap_throughput -- FOLDER`
//! (a folder in memory, such as `/dev/shm`, leaves the disk out of it).
#![allow(clippy::print_stdout, reason = "the numbers are the purpose")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use cpu_time::ProcessTime;
use semfm_geom::math::{DAffine3, DVec3};
use semfm_geom::{Intrinsics, Mesh, Pinhole};
use semfm_views::mcap::{Dtype, EmbeddingsFile, EmbeddingsMetadata, ViewsMetadata, read_messages};
use semfm_views::{EmbeddedView, PatchEmbeddings, PatchGrid};

const ROWS: usize = 37;
const DIM: usize = 768;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: mcap_throughput FOLDER")?;
    let path = Path::new(&folder).join("throughput.emb.mcap");
    let file = embeddings()?;
    for dtype in [Dtype::F16, Dtype::F32] {
        let write = best(|| file.write(&path, dtype))?;
        let mut n_bytes = 0;
        let messages = best(|| {
            n_bytes = 0;
            read_messages(&path, |message| {
                n_bytes += message.data.len();
                Ok(())
            })
        })?;
        let read = best(|| EmbeddingsFile::read(&path))?;
        let megabytes = n_bytes as f64 / 1e6;
        let rate = |seconds: f64| megabytes / seconds;
        println!(
            "{dtype:?}, {megabytes:.0} MB: write {:.0} MB/s, read {:.0} MB/s, read messages {:.0} MB/s",
            rate(write),
            rate(read),
            rate(messages)
        );
        let lz4 = path.with_extension("lz4.mcap");
        let write = best(|| repack(&path, &lz4))?;
        let messages = best(|| read_messages(&lz4, |_| Ok(())))?;
        println!(
            "  as lz4: read and write {:.0} MB/s, read messages {:.0} MB/s",
            rate(write),
            rate(messages)
        );
        std::fs::remove_file(&lz4)?;
    }
    std::fs::remove_file(&path)?;
    Ok(())
}

/// Shortest of five runs, in seconds.
fn best<T, E>(mut run: impl FnMut() -> Result<T, E>) -> Result<f64, E> {
    let mut seconds = f64::INFINITY;
    for _ in 0..5 {
        let start = ProcessTime::now();
        run()?;
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    Ok(seconds)
}

/// The same messages in chunks of lz4.
fn repack(from: &Path, to: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let file = std::io::BufWriter::new(std::fs::File::create(to)?);
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let mut writer = options.create(file)?;
    let channel_id = writer.add_channel(0, "/all", "protobuf", &BTreeMap::new())?;
    let mut result = Ok(());
    read_messages(from, |message| {
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: 0,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        if result.is_ok() {
            result = writer.write_to_known_channel(&header, message.data);
        }
        Ok(())
    })?;
    result?;
    writer.finish()?;
    Ok(())
}

/// Fourteen views of 37 × 37 patches of 768 noisy numbers.
fn embeddings() -> Result<EmbeddingsFile, semfm_geom::Error> {
    let mesh = Mesh::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]])?;
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let mut view = |_| EmbeddedView {
        camera: Pinhole::with_pixel_centres_at_half(
            Intrinsics { width: 518, height: 518, fx: 600.0, fy: 600.0, cx: 259.0, cy: 259.0 },
            DAffine3::IDENTITY,
        )
        .unwrap(),
        patches: PatchEmbeddings::new(
            PatchGrid { rows: ROWS, cols: ROWS, rect: [0.0, 0.0, 518.0, 518.0] },
            DIM,
            (0..ROWS * ROWS * DIM).map(|_| noise()).collect(),
            vec![255; ROWS * ROWS],
            vec![true; ROWS * ROWS],
        )
        .unwrap(),
    };
    let metadata = EmbeddingsMetadata {
        views: ViewsMetadata::of(&mesh, 518, 518),
        encoder: "noise".to_owned(),
        revision: String::new(),
        preprocessing: String::new(),
        rolls: 1,
        outliers: String::new(),
        simulated: true,
    };
    Ok(EmbeddingsFile { path: PathBuf::new(), metadata, views: (0..14).map(&mut view).collect() })
}
