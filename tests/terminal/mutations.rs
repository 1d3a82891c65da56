//! A short round of fuzzing: every function that takes bytes gets its seeds, changed at random, and
//! must return within time and memory. The same bytes every time; `cargo xtask fuzz` goes further.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use fastrand::Rng;

#[path = "../shared/entries.rs"]
mod entries;

use entries::{ENTRIES, Entry};

/// Mutated inputs of an entry; `TRACKLENS_MUTATIONS` is another number of them.
const INPUTS: u64 = 2000;
/// Longer seeds are left out: most of their bytes are pixels and weights.
const LONGEST: u64 = 64 << 10;
/// What an input may take, on a machine that does many things at a time.
const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes that any input may take, and a byte of input more.
const MEMORY: u64 = 64 << 20;
const MEMORY_OF_BYTE: u64 = 32;

/// Counts what this thread holds.
struct Counted;

thread_local! {
    static HELD: Cell<i64> = const { Cell::new(0) };
    static PEAK: Cell<i64> = const { Cell::new(0) };
}

fn hold(bytes: i64) {
    // A thread that ends has no counters any more.
    let _ = HELD.try_with(|held| {
        held.set(held.get() + bytes);
        PEAK.with(|peak| peak.set(peak.get().max(held.get())));
    });
}

// SAFETY: every call goes to the system's allocator as it is.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        hold(layout.size() as i64);
        // SAFETY: the caller's promises are those of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        hold(-(layout.size() as i64));
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        hold(layout.size() as i64);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        hold(size as i64 - layout.size() as i64);
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTED: Counted = Counted;

/// The seeds of an entry: its folder in `fuzz/seeds`, and the repository's fixtures of its kind.
fn seeds(entry: &Entry) -> Vec<Vec<u8>> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let table = fs::read_to_string(root.join("fuzz/seeds.json")).expect("a table of seeds");
    let table: serde_json::Value = serde_json::from_str(&table).expect("JSON");
    let folders = table[entry.name].as_object().expect("seeds of the entry");
    let mut seeds = Vec::new();
    for (folder, extensions) in folders {
        let extensions = extensions.as_array().expect("extensions");
        let files = fs::read_dir(root.join(folder)).expect("a folder");
        let mut files: Vec<PathBuf> = files.map(|f| f.expect("a file").path()).collect();
        files.sort();
        for file in files {
            let extension = file.extension().unwrap_or_default().to_string_lossy();
            let wanted = extensions.iter().any(|e| *e == *extension);
            let size = fs::metadata(&file).expect("a size").len();
            if wanted && size <= LONGEST {
                seeds.push(fs::read(&file).expect("a seed"));
            }
        }
    }
    assert!(!seeds.is_empty(), "{} has seeds", entry.name);
    seeds
}

/// Bytes made of seeds.
fn mutate(seeds: &[Vec<u8>], random: &mut Rng) -> Vec<u8> {
    const WORDS: [&[u8]; 12] = [
        b"-1",
        b"0",
        b"1e308",
        b"NaN",
        b"4294967296",
        b"18446744073709551615",
        b"\"",
        b",",
        b"\n",
        b"{",
        b"[",
        b"\0",
    ];
    let mut bytes = random.choice(seeds).cloned().unwrap_or_default();
    for _ in 0..1 << random.u32(0..5) {
        let at = random.usize(..=bytes.len());
        let end = (at + (1 << random.u32(0..10))).min(bytes.len());
        match random.u8(0..9) {
            0 | 1 if at < bytes.len() => bytes[at] ^= 1 << random.u32(0..8),
            2 if at < bytes.len() => {
                bytes[at] = random.choice([0, 1, 0x7f, 0x80, 0xff]).unwrap_or(0)
            }
            3 => drop(bytes.drain(at..end)),
            4 => {
                let part = bytes[at..end].to_vec();
                let to = random.usize(..=bytes.len());
                bytes.splice(to..to, part);
            }
            5 => {
                let word = random.choice(WORDS).unwrap_or_default();
                let end = (at + random.usize(..=word.len())).min(bytes.len());
                bytes.splice(at..end, word.iter().copied());
            }
            6 if at + 8 <= bytes.len() => {
                let value = 1u64 << random.u32(0..64);
                let value = value.wrapping_sub(random.u64(0..2)).to_le_bytes();
                let size = 1 << random.u32(0..4);
                bytes[at..at + size].copy_from_slice(&value[..size]);
            }
            7 => {
                let other = random.choice(seeds).map_or(&[][..], Vec::as_slice);
                let from = random.usize(..=other.len());
                let part = other[from..(from + end - at).min(other.len())].to_vec();
                bytes.splice(at..end, part);
            }
            8 if random.u8(0..4) == 0 => bytes.truncate(at),
            _ => {}
        }
    }
    bytes
}

/// Runs an entry on bytes and says what was wrong.
fn attempt(entry: &Entry, bytes: &[u8]) -> Result<(), String> {
    let before = HELD.get();
    PEAK.set(before);
    catch_unwind(AssertUnwindSafe(|| (entry.run)(bytes))).map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|t| (*t).to_owned()));
        format!("panicked: {}", text.unwrap_or_default())
    })?;
    let taken = (PEAK.get() - before).max(0) as u64;
    let allowed = MEMORY + MEMORY_OF_BYTE * bytes.len() as u64;
    match taken > allowed {
        true => Err(format!("took {} MiB of memory", taken >> 20)),
        false => Ok(()),
    }
}

#[test]
fn mutated_inputs_are_read_or_refused_in_time_and_memory() {
    let inputs = std::env::var("TRACKLENS_MUTATIONS")
        .map_or(INPUTS, |n| n.parse().expect("a number of inputs"));
    let mut wrong = Vec::new();
    for entry in ENTRIES {
        let seeds = seeds(entry);
        let mut random = Rng::with_seed(7);
        let ended = AtomicBool::new(false);
        // What is being worked on, since when.
        let current = Mutex::new((Vec::new(), Instant::now()));
        let started = Instant::now();
        let keep = |bytes: &[u8], why: &str| {
            let folder = std::env::temp_dir();
            let path = folder.join(format!("tracklens-{}-{}", entry.name, fastrand::u32(..)));
            fs::write(&path, bytes).expect("written");
            format!("{}: {why}: {}", entry.name, path.display())
        };
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for i in 0..inputs + seeds.len() as u64 {
                    let bytes = match seeds.get(i as usize) {
                        Some(seed) => seed.clone(),
                        None => mutate(&seeds, &mut random),
                    };
                    *current.lock().expect("a lock") = (bytes.clone(), Instant::now());
                    if let Err(why) = attempt(entry, &bytes) {
                        wrong.push(keep(&bytes, &why));
                    }
                }
                ended.store(true, Ordering::Relaxed);
            });
            while !ended.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(5));
                let current = current.lock().expect("a lock");
                if current.1.elapsed() > PATIENCE {
                    // The thread cannot be ended, but its process can.
                    eprintln!("{}", keep(&current.0, "took too long"));
                    std::process::exit(101);
                }
            }
        });
        println!(
            "{}: {inputs} inputs of {} seeds in {:.1?}",
            entry.name,
            seeds.len(),
            started.elapsed()
        );
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
