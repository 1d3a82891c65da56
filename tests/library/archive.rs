//! Directories of ZIP archives, read from their ends.

use std::io::Write as _;

use rawzip::{CompressionMethod, ZipArchiveWriter};
use tracklens::data::{ARCHIVE_TAIL, ArchiveEntry, ArchiveIndex, MAX_RATIO};

/// An archive of files stored as they are.
fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut bytes);
    for (name, content) in files {
        let (mut entry, config) = archive
            .new_file(*name)
            .compression_method(CompressionMethod::STORE)
            .start()
            .expect("an entry");
        let mut writer = config.wrap(&mut entry);
        writer.write_all(content).expect("written");
        let (_, descriptor) = writer.finish().expect("written");
        entry.finish(descriptor).expect("written");
    }
    archive.finish().expect("an archive");
    bytes
}

fn entries(bytes: &[u8]) -> Vec<ArchiveEntry> {
    match ArchiveIndex::read(bytes, bytes.len() as u64).expect("a directory") {
        ArchiveIndex::Entries(entries) => entries,
        ArchiveIndex::Needs(start) => panic!("needs all from {start}, and had all"),
    }
}

fn error(bytes: &[u8]) -> String {
    ArchiveIndex::read(bytes, bytes.len() as u64)
        .expect_err("a bad archive")
        .to_string()
}

/// Where the `nth` record of the directory begins.
fn record(bytes: &[u8], nth: usize) -> usize {
    let starts = bytes
        .windows(4)
        .enumerate()
        .filter(|(_, w)| w == b"PK\x01\x02");
    starts.map(|(i, _)| i).nth(nth).expect("a record")
}

#[test]
fn files_are_found_with_their_places_and_the_end_alone_is_enough() {
    let long = vec![7; 300_000];
    let bytes = archive(&[
        ("data/a.bin", &long),
        ("data/b.csv", b"x,y\n"),
        (r"c\d.txt", b"d"),
    ]);
    let all = entries(&bytes);
    let paths: Vec<_> = all.iter().map(|e| e.path.as_str()).collect();
    assert_eq!(paths, ["data/a.bin", "data/b.csv", "c/d.txt"]);
    assert_eq!(
        (all[0].size, all[0].packed, all[0].deflated),
        (300_000, 300_000, false)
    );
    assert!(all.iter().all(|e| e.problem.is_empty()));
    // The local header of the second lies where its entry says.
    let at = all[1].offset as usize;
    assert_eq!(&bytes[at..at + 4], b"PK\x03\x04");

    let tail = &bytes[bytes.len() - 2000..];
    assert_eq!(
        ArchiveIndex::read(tail, bytes.len() as u64).expect("a directory"),
        ArchiveIndex::Entries(all)
    );
}

#[test]
fn a_directory_longer_than_the_end_that_was_given_is_asked_for() {
    let names: Vec<String> = (0..3000)
        .map(|i| format!("{}/{i:06}.png", "long_name".repeat(20)))
        .collect();
    let files: Vec<(&str, &[u8])> = names
        .iter()
        .map(|n| (n.as_str(), b"x".as_slice()))
        .collect();
    let bytes = archive(&files);
    let size = bytes.len() as u64;
    let tail = &bytes[bytes.len() - ARCHIVE_TAIL as usize..];
    let mut start = match ArchiveIndex::read(tail, size).expect("a directory") {
        ArchiveIndex::Needs(start) => start,
        ArchiveIndex::Entries(_) => panic!("the directory is longer than the tail"),
    };
    let mut rounds = 1;
    let entries = loop {
        match ArchiveIndex::read(&bytes[start as usize..], size).expect("a directory") {
            ArchiveIndex::Needs(earlier) => {
                assert!(earlier < start);
                start = earlier;
            }
            ArchiveIndex::Entries(entries) => break entries,
        }
        rounds += 1;
    };
    assert_eq!(
        (entries.len(), rounds),
        (3000, 1),
        "one more piece is enough"
    );
}

#[test]
fn bombs_are_told_by_the_entry_and_its_limit() {
    let mut bytes = archive(&[("bomb.bin", b"0123456789"), ("good.csv", b"x\n")]);
    let at = record(&bytes, 0);
    // Unpacked size 1 GiB, method DEFLATE.
    bytes[at + 24..at + 28].copy_from_slice(&(1u32 << 30).to_le_bytes());
    bytes[at + 10] = 8;
    let found = entries(&bytes);
    assert!(
        found[0].problem.contains("unpacks to 1024 MB")
            && found[0]
                .problem
                .contains(&format!("at most {MAX_RATIO} times")),
        "{}",
        found[0].problem
    );
    // The others are as good as before.
    assert_eq!(found[1].problem, "");

    // Both records name the same bytes.
    let mut overlapping = archive(&[("a.bin", &[1; 500]), ("b.bin", &[2; 500])]);
    let (a, b) = (record(&overlapping, 0), record(&overlapping, 1));
    let offset = overlapping[a + 42..a + 46].to_vec();
    overlapping[b + 42..b + 46].copy_from_slice(&offset);
    let text = error(&overlapping);
    assert!(text.contains("share bytes, as in a ZIP bomb"), "{text}");
}

#[test]
fn what_cannot_be_unpacked_says_why() {
    let mut bytes = archive(&[("secret.csv", b"abc"), ("new.bin", b"abc")]);
    let (a, b) = (record(&bytes, 0), record(&bytes, 1));
    bytes[a + 8] |= 1;
    bytes[b + 10] = 93;
    let found = entries(&bytes);
    assert!(
        found[0].problem.contains("encrypted"),
        "{}",
        found[0].problem
    );
    assert!(
        found[1].problem.contains("expected DEFLATE"),
        "{}",
        found[1].problem
    );
}

#[test]
fn damaged_archives_are_told() {
    let bytes = archive(&[("a.bin", &[1; 500]), ("b.bin", &[2; 500])]);
    let cut = error(&bytes[..bytes.len() - 40]);
    assert!(
        cut.contains("its directory, at the end, is missing"),
        "{cut}"
    );
    assert!(error(b"").contains("not a whole ZIP archive"));
    // An entry that lies beyond the end.
    let mut far = bytes.clone();
    let at = record(&far, 1);
    far[at + 20..at + 24].copy_from_slice(&100_000u32.to_le_bytes());
    assert!(
        error(&far).contains("`b.bin` lies beyond the end"),
        "{}",
        error(&far)
    );
}
