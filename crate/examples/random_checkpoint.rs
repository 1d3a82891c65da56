//! Writes a checkpoint that nobody trained, for benchmarks of extraction.
//!
//! `cargo run --release --no-default-features --features cli --example random_checkpoint -- keynet
//! 256 W.safetensors`

#[path = "../benches/random/mod.rs"]
mod random;

use std::error::Error;

use tracklens::checkpoint::SaeConfig;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [architecture, side, file] = &arguments[..] else {
        return Err(
            "expected an architecture, the side of its input in pixels, and the file to write"
                .into(),
        );
    };
    let side = side.parse()?;
    let mut config = SaeConfig::named(architecture)?;
    config.input_size = Some([side, side]);
    config.validate()?;
    std::fs::write(file, random::checkpoint(config).to_safetensors()?)?;
    Ok(())
}
