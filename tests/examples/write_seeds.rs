//! Writes the seeds of every reader into a folder of its own: the first corpus of `cargo fuzz`.
//!
//! `cargo run -p semfm-tests --example write_seeds -- fuzz/corpus`

use std::path::PathBuf;

use semfm_tests::readers::READERS;
use semfm_tests::seeds::seeds;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: write_seeds FOLDER")?);
    for reader in &READERS {
        let own = folder.join(reader.name);
        std::fs::create_dir_all(&own)?;
        for (number, seed) in seeds(reader.name).iter().enumerate() {
            std::fs::write(own.join(format!("seed{number}")), seed)?;
        }
    }
    Ok(())
}
