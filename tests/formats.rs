//! Recordings as arrays (NPZ, HDF5), and the authors' split: against files that numpy and h5py wrote.

use std::path::PathBuf;

use serde_json::Value;
use tracklens::data::{Split, numpy_permutation};

fn fixture(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../tests")
        .join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn the_reference_split_is_numpys() {
    let cases: Value = serde_json::from_slice(&fixture("golden/numpy_split.json")).expect("JSON");
    let cases = cases.as_array().expect("cases");
    assert_eq!(cases.len(), 21);
    for case in cases {
        let number = |name: &str| case[name].as_u64().expect("a number") as u32;
        let expected: Vec<usize> = serde_json::from_value(case["order"].clone()).expect("an order");
        let (count, seed) = (number("count"), number("seed"));
        assert_eq!(numpy_permutation(count, seed), expected, "{count}, seed {seed}");
        let parts = Split::Reference { seed }
            .divide(expected.len(), |_| panic!("nothing is drawn"))
            .expect("a split");
        let all = [&parts.training[..], &parts.validation, &parts.testing].concat();
        assert_eq!(all, expected, "{count}, seed {seed}");
    }
    let parts = Split::Reference { seed: 0 }
        .divide(1000, |_| ())
        .expect("a split");
    let sizes = [&parts.training, &parts.validation, &parts.testing].map(Vec::len);
    assert_eq!(sizes, [500, 250, 250]);
}

#[test]
fn splits_are_read_from_text_and_json() {
    let parse = |text: &str| text.parse::<Split>();
    let shares = Split::Shares {
        training: 0.5,
        validation: 0.25,
    };
    assert_eq!(parse("0.5, 0.25").expect("shares"), shares);
    assert_eq!(parse("reference").expect("a split"), Split::Reference { seed: 0 });
    assert_eq!(
        parse("reference:7").expect("a split"),
        Split::Reference { seed: 7 }
    );
    for wrong in ["", "0.5", "reference:x", "reference:-1", "a,b", "ref:1"] {
        let error = parse(wrong).expect_err(wrong).to_string();
        assert!(error.contains("expected two shares"), "{error}");
    }
    for (split, json) in [
        (shares, r#"{"training":0.5,"validation":0.25}"#),
        (Split::Reference { seed: 3 }, r#"{"reference":{"seed":3}}"#),
    ] {
        assert_eq!(serde_json::to_string(&split).expect("JSON"), json);
        assert_eq!(serde_json::from_str::<Split>(json).expect("a split"), split);
    }
    assert!(serde_json::from_str::<Split>(r#"{"training":0.5}"#).is_err());
    assert!(serde_json::from_str::<Split>(r#"{"training":0.5,"validation":0.2,"x":1}"#).is_err());
}

#[test]
fn every_share_has_a_sequence() {
    for (training, validation) in [(0.001, 0.001), (0.999, 0.001), (0.5, 0.5)] {
        let split = Split::Shares { training, validation };
        for sequences in 2..9 {
            let parts = split.divide(sequences, |order| order.reverse()).expect("a split");
            assert!(!parts.training.is_empty() && !parts.validation.is_empty());
            let total = parts.training.len() + parts.validation.len() + parts.testing.len();
            assert_eq!(total, sequences);
        }
        assert!(split.divide(1, |_| ()).is_err());
    }
}
