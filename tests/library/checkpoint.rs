//! Checkpoints of every format: what goes in comes out, other readers agree, and bad files say what
//! is wrong.

use std::collections::BTreeMap;

use crate::shared::golden;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use tracklens::checkpoint::{Checkpoint, Format, Tensor, read_tensors};

const FORMATS: [Format; 3] = [Format::Safetensors, Format::PyTorch, Format::Burnpack];
const TINY: [&str; 3] = [
    "basic-vel-std-bg-tiny",
    "keynet-vel-std-bg-tiny",
    "dsae-tiny",
];

fn tiny(name: &str) -> Checkpoint {
    Checkpoint::from_bytes(&golden(&format!("{name}.safetensors"))).expect("a checkpoint")
}

fn error(bytes: &[u8]) -> String {
    Checkpoint::from_bytes(bytes)
        .expect_err("an error")
        .to_string()
}

/// The weights without what the golden files hold beside them.
fn weights(checkpoint: &Checkpoint) -> BTreeMap<&String, &Tensor> {
    let mut weights: BTreeMap<_, _> = checkpoint.tensors.iter().collect();
    weights.retain(|name, _| !name.starts_with("golden."));
    weights
}

#[test]
fn every_format_gives_back_what_went_in() {
    for name in TINY {
        let mut checkpoint = tiny(name);
        checkpoint.config.input_size = Some([96, 64]);
        checkpoint
            .metadata
            .insert("tracklens.epoch".into(), "7".into());
        checkpoint.metadata.insert("note".into(), "ünïcödé".into());
        for format in FORMATS {
            let bytes = checkpoint.to_bytes(format).expect("bytes");
            assert_eq!(Format::of(&bytes), Some(format), "{name}");
            assert_eq!(
                Checkpoint::from_bytes(&bytes).expect("a checkpoint"),
                checkpoint,
                "{name} {format}"
            );
            assert_eq!(read_tensors(&bytes).expect("tensors"), checkpoint.tensors);
        }
    }
}

#[test]
fn strides_are_stored_where_they_are_not_the_papers() {
    let mut checkpoint = tiny("keynet-vel-std-bg-tiny");
    let json = |checkpoint: &Checkpoint| {
        serde_json::to_string(&checkpoint.config).expect("JSON of a configuration")
    };
    assert!(!json(&checkpoint).contains("encoder_strides"));
    checkpoint.config.encoder_strides = vec![1, 2, 1, 1];
    assert!(json(&checkpoint).contains(r#""encoder_strides":[1,2,1,1]"#));
    // From 64 pixels to 32 cells, each as wide as two pixels.
    let sides = checkpoint.config.encoder_layers();
    let cells = sides.iter().try_fold(64, |side, l| l.output_side(side));
    assert_eq!(cells, Some(32));
    assert_eq!(checkpoint.config.cell_positions(), [0.0, 2.0]);
    for format in FORMATS {
        let bytes = checkpoint.to_bytes(format).expect("bytes");
        let read = Checkpoint::from_bytes(&bytes).expect("a checkpoint");
        assert_eq!(read.config.encoder_strides, [1, 2, 1, 1], "{format}");
    }

    let wrong = |checkpoint: &Checkpoint, part: &str| {
        let error = checkpoint.config.validate().expect_err(part).to_string();
        assert!(error.contains(part), "{error}");
    };
    checkpoint.config.encoder_strides = vec![1, 2];
    wrong(&checkpoint, "2 encoder strides given");
    checkpoint.config.encoder_strides = vec![1, 2, 3, 1];
    wrong(&checkpoint, "encoder strides is 3; expected 1 to 2");
    let mut basic = tiny("basic-vel-std-bg-tiny");
    basic.config.encoder_strides = vec![1, 1, 1];
    wrong(&basic, "only a KeyNet takes them");
}

#[test]
fn a_checkpoint_of_the_authors_holds_weights_and_configuration() {
    let checkpoint =
        Checkpoint::from_bytes(&golden("basic-vel-std-bg-tiny.pth")).expect("a checkpoint");
    let expected = tiny("basic-vel-std-bg-tiny");
    assert_eq!(weights(&checkpoint), weights(&expected));
    // The velocity loss leaves no tensor; only the configuration tells of it.
    assert_eq!(checkpoint.config.name(), "basic-kp4-vel-std-bg");
    assert_eq!(expected.config.name(), "basic-kp4-std-bg");
    assert_eq!(checkpoint.config.target_size, [16, 16]);
    assert_eq!(checkpoint.metadata["epoch"], "499");
    let cfg: serde_json::Value = serde_json::from_str(&checkpoint.metadata["cfg"]).expect("JSON");
    assert_eq!(cfg["training"]["learning_rate"], 0.001);
    assert_eq!(cfg["training"]["loss_weights"]["velocity"], 0.1);
    assert_eq!(cfg["dataset"]["split"], serde_json::json!([500, 250, 250]));
    assert_eq!(
        cfg["model"]["decoder"]["settings"]["limit_gaussian_std"],
        serde_json::Value::Null
    );
    assert_eq!(
        checkpoint.metadata.len(),
        2,
        "the optimizer's state is left out"
    );
}

#[test]
fn the_configuration_of_the_authors_tells_what_the_tensors_do_not() {
    let mut checkpoint = tiny("basic-vel-std-bg-tiny");
    for name in [
        "decoder.gaussian_sampling.std",
        "decoder.background_bias.bias",
    ] {
        checkpoint.tensors.remove(name);
    }
    let cfg = r#"{"dataset": {"target_shape": [3, 24, 32]}, "training": {"loss_weights": {"velocity": 0.0}},
        "model": {"encoder": {"settings": {"softmax_temperature": 0.5}},
                  "decoder": {"settings": {"gaussian_std": 0.2, "limit_gaussian_std": 3.0}}}}"#;
    let header = [("cfg".to_owned(), cfg.to_owned())].into();
    let config = Checkpoint::from_bytes(&safetensors(&checkpoint.tensors, Some(header)))
        .expect("a checkpoint")
        .config;
    assert_eq!(config.name(), "basic-kp4");
    assert_eq!(config.target_size, [32, 24]);
    assert_eq!(
        (config.temperature, config.sigma, config.sigma_limit),
        (0.5, 0.2, Some(3.0))
    );
}

#[test]
fn the_authors_checkpoint_at_full_size() {
    let Some(bytes) = crate::shared::large_golden("checkpoint_final.pth") else {
        return;
    };
    let checkpoint = Checkpoint::from_bytes(&bytes).expect("a checkpoint");
    let Some(expected) = crate::shared::large_golden("basic.safetensors") else {
        return;
    };
    let expected = Checkpoint::from_bytes(&expected).expect("a checkpoint");
    assert_eq!(weights(&checkpoint), weights(&expected));
    assert_eq!(checkpoint.config.name(), "basic-vel");
    let summary = checkpoint.summary();
    assert_eq!(
        (summary.parameters.encoder, summary.parameters.decoder),
        (289_520, 32_531)
    );
    assert_eq!(
        (summary.epoch, summary.training.epochs),
        (Some(499), Some(500))
    );
    same_as_pytorch_reader(&bytes);
}

#[test]
fn pytorch_reader_reads_the_same() {
    same_as_pytorch_reader(&golden("basic-vel-std-bg-tiny.pth"));
    for name in TINY {
        same_as_pytorch_reader(&tiny(name).to_bytes(Format::PyTorch).expect("bytes"));
    }
}

/// Against the reader behind burn's import of PyTorch files.
fn same_as_pytorch_reader(bytes: &[u8]) {
    let reader =
        pytorch_reader::PytorchReader::from_bytes(bytes.to_vec(), Some("model_state_dict"))
            .expect("a file");
    let theirs: BTreeMap<String, Tensor> = reader
        .tensors()
        .iter()
        .filter(|(name, _)| !name.ends_with("num_batches_tracked"))
        .map(|(name, tensor)| {
            let bytes = tensor.read().expect("bytes");
            let float = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
            let data = bytes.chunks_exact(4).map(float).collect();
            let shape = tensor.shape().to_vec();
            (name.clone(), Tensor { shape, data })
        })
        .collect();
    assert_eq!(read_tensors(bytes).expect("tensors"), theirs);
}

#[test]
fn burn_reads_and_writes_the_same() {
    for name in TINY {
        let checkpoint = tiny(name);
        let ours = checkpoint.to_bytes(Format::Burnpack).expect("bytes");
        let reader =
            burn_pack::Reader::from_bytes(burn_pack::Bytes::from_bytes_vec(ours)).expect("a file");
        assert!(reader.metadata().contains_key("tracklens.config"));
        let tensors = reader.into_tensors().expect("tensors");
        assert_eq!(tensors.len(), checkpoint.tensors.len());
        let written = burn_pack::Writer::new(tensors)
            .with_metadata("note", "from burn")
            .into_bytes()
            .expect("bytes");
        let again = Checkpoint::from_bytes(&written).expect("a checkpoint");
        assert_eq!(again.tensors, checkpoint.tensors);
        assert_eq!(again.metadata["note"], "from burn");
    }
}

fn safetensors(
    tensors: &BTreeMap<String, Tensor>,
    header: Option<std::collections::HashMap<String, String>>,
) -> Vec<u8> {
    typed(tensors, header, Dtype::F32, |v| v.to_le_bytes().to_vec())
}

/// A `.safetensors` file with elements of another type.
fn typed(
    tensors: &BTreeMap<String, Tensor>,
    header: Option<std::collections::HashMap<String, String>>,
    dtype: Dtype,
    bytes: impl Fn(f32) -> Vec<u8>,
) -> Vec<u8> {
    let data: Vec<(&String, &Tensor, Vec<u8>)> = tensors
        .iter()
        .map(|(name, tensor)| {
            (
                name,
                tensor,
                tensor.data.iter().flat_map(|v| bytes(*v)).collect(),
            )
        })
        .collect();
    let views = data.iter().map(|(name, tensor, data)| {
        (
            name,
            TensorView::new(dtype, tensor.shape.clone(), data).expect("a view"),
        )
    });
    safetensors::serialize(views, header).expect("bytes")
}

#[test]
fn weights_of_other_precisions_become_f32() {
    let checkpoint = tiny("dsae-tiny");
    let tensors = &checkpoint.tensors;
    let read = |bytes: Vec<u8>| {
        Checkpoint::from_bytes(&bytes)
            .expect("a checkpoint")
            .tensors
    };
    assert_eq!(
        &read(typed(tensors, None, Dtype::F64, |v| f64::from(v)
            .to_le_bytes()
            .to_vec())),
        tensors
    );
    // bfloat16 is the upper half of an f32.
    let bf16 = read(typed(tensors, None, Dtype::BF16, |v| {
        v.to_le_bytes()[2..].to_vec()
    }));
    let near = |a: &Tensor, b: &Tensor, relative: f32| {
        a.data
            .iter()
            .zip(&b.data)
            .all(|(a, b)| (a - b).abs() <= relative * b.abs())
    };
    assert!(tensors.iter().all(|(name, t)| near(&bf16[name], t, 0.01)));
    let ones = typed(tensors, None, Dtype::F16, |_| vec![0x00, 0x3c]);
    assert!(
        read(ones)
            .values()
            .all(|t| t.data.iter().all(|v| *v == 1.0))
    );
    let integers = typed(tensors, None, Dtype::I16, |_| vec![0, 0]);
    assert!(
        error(&integers).contains("is I16; expected floating-point weights"),
        "{}",
        error(&integers)
    );
}

#[test]
fn the_prefix_of_a_wrapper_is_taken_off() {
    let checkpoint = tiny("dsae-tiny");
    let wrapped = checkpoint
        .tensors
        .iter()
        .map(|(name, tensor)| (format!("module.{name}"), tensor.clone()))
        .collect();
    let read = Checkpoint::from_bytes(&safetensors(&wrapped, None)).expect("a checkpoint");
    assert_eq!(read.tensors, checkpoint.tensors);
}

#[test]
fn any_networks_tensors_can_be_read() {
    let tensor = Tensor {
        shape: vec![2, 1],
        data: vec![1.0, 2.0],
    };
    let tensors: BTreeMap<String, Tensor> = [("features.conv0.weight".to_owned(), tensor)].into();
    let bytes = safetensors(&tensors, None);
    assert_eq!(read_tensors(&bytes).expect("tensors"), tensors);
    let error = error(&bytes);
    assert!(
        error.contains("not a checkpoint of a Basic, DSAE or KeyNet SAE"),
        "{error}"
    );
    assert!(error.contains("features.conv0.weight"), "{error}");
}

/// A `.pth` file with this pickle and one storage of eight bytes.
fn archive(pickle: &[u8], more: &[(&str, &[u8])]) -> Vec<u8> {
    use std::io::Write as _;
    let mut bytes = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut bytes);
    let storage: (&str, &[u8]) = ("data/0", &[0; 8]);
    for (name, data) in [("data.pkl", pickle), storage].iter().chain(more) {
        let (mut entry, config) = archive
            .new_file(format!("a/{name}"))
            .start()
            .expect("an entry");
        let mut writer = config.wrap(&mut entry);
        writer.write_all(data).expect("written");
        let (_, descriptor) = writer.finish().expect("written");
        entry.finish(descriptor).expect("written");
    }
    archive.finish().expect("written");
    bytes
}

/// The pickle of `{"w": tensor}` with two values, seen as `shape` with `strides`, both pickled.
fn one_tensor(class: &str, shape: &[u8], strides: &[u8]) -> Vec<u8> {
    let mut pickle =
        b"\x80\x02}U\x01wctorch._utils\n_rebuild_tensor_v2\n((U\x07storagectorch\n".to_vec();
    pickle.extend(class.as_bytes());
    pickle.extend(b"\nU\x010U\x03cpuK\x02tQK\x00");
    pickle.extend([shape, strides].concat());
    pickle.extend(b"\x89ccollections\nOrderedDict\n)RtRs.");
    pickle
}

#[test]
fn views_are_gathered_and_stay_inside_their_storage() {
    let read = |class: &str, shape: &[u8], strides: &[u8], data: &[f32]| {
        let data: Vec<u8> = data.iter().flat_map(|v| v.to_le_bytes()).collect();
        read_tensors(&archive(
            &one_tensor(class, shape, strides),
            &[("data/0", &data)],
        ))
    };
    // (2, 3) with strides (1, 2): the transpose of a (3, 2) tensor.
    let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let tensors = read(
        "FloatStorage",
        b"K\x02K\x03\x86",
        b"K\x01K\x02\x86",
        &values,
    )
    .expect("tensors");
    assert_eq!(tensors["w"].data, [1.0, 3.0, 5.0, 2.0, 4.0, 6.0]);
    let wrong = |class: &str, shape: &[u8], strides: &[u8]| {
        read(class, shape, strides, &values)
            .expect_err("an error")
            .to_string()
    };
    for (shape, strides) in [
        (&b"K\x07\x85"[..], &b"K\x01\x85"[..]),
        (b"K\x02K\x03\x86", b"K\x05K\x02\x86"),
        (b"K\x06\x85", b"J\xff\xff\xff\x7f\x85"),
        (b"J\xff\xff\xff\x7fJ\xff\xff\xff\x7f\x86", b"K\x00K\x00\x86"),
    ] {
        let error = wrong("FloatStorage", shape, strides);
        assert!(error.contains("reaches beyond its"), "{error}");
    }
    let error = wrong("FloatStorage", b"K\x01\x85", b"K\x01K\x01\x86");
    assert!(
        error.contains("not described as torch.save does"),
        "{error}"
    );
    let error = wrong("IntStorage", b"K\x01\x85", b"K\x01\x85");
    assert!(
        error.contains("tensor `w` is in a `torch.IntStorage`; expected floating-point"),
        "{error}"
    );
}

#[test]
fn bad_files_say_what_is_wrong_and_what_to_do() {
    let expect = |bytes: &[u8], part: &str| {
        let error = error(bytes);
        assert!(error.contains(part), "{error}");
    };
    let pth = golden("basic-vel-std-bg-tiny.pth");
    expect(
        &pth[..pth.len() / 2],
        "not a complete .pth file (23444 bytes",
    );
    let mut damaged = pth.clone();
    let place = damaged
        .windows(7)
        .position(|w| w == b"/data/5")
        .expect("an entry")
        + 200;
    damaged[place] ^= 0xff;
    expect(
        &damaged,
        "does not have the sum it was written with; the file is damaged",
    );
    expect(
        b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.",
        "not a complete .pth file (15 bytes); was the download or the copy cut short?",
    );
    expect(
        b"PK\x03\x04 an archive of something else",
        "a ZIP archive that torch.save did not write",
    );
    expect(
        b"sequence,frame,object,x,y\n",
        "not a checkpoint (26 bytes); expected .safetensors, PyTorch's .pth or burn's .bpk",
    );
    expect(b"", "not a checkpoint (0 bytes)");

    let of = |pickle: &[u8]| archive(pickle, &[]);
    expect(
        &of(b"\x80\x02}U\x05epochK\x01s."),
        "no weights under `model_state_dict` (the file holds epoch)",
    );
    expect(&of(b"\x80\x02]."), "(the file holds no names)");
    expect(
        &of(b"\x80\x02cmodels\nSAE\n)\x81."),
        "a whole `models.SAE` rather than its weights; save model.state_dict()",
    );
    expect(
        &of(b"\x80\x02}(U\x01w"),
        "the pickle cannot be read at byte",
    );
    expect(
        &of(b"\x80\x02I01\n."),
        "the pickle cannot be read at byte 2 of 7 (code 0x49)",
    );
    expect(
        &archive(b"\x80\x02].", &[("byteorder", b"big")]),
        "saved on a big-endian machine",
    );

    let bpk = tiny("dsae-tiny").to_bytes(Format::Burnpack).expect("bytes");
    for length in [4, 9, 100, bpk.len() / 2, bpk.len() - 1] {
        expect(&bpk[..length], "not a complete .bpk file");
    }
    let mut newer = bpk.clone();
    newer[4] = 9;
    expect(&newer, "a .bpk file of version 9");
}

#[test]
fn a_pickle_that_holds_itself_or_repeats_itself_is_read() {
    // A list that holds itself, and lists that hold the one before twice, forty times, beside the
    // weights.
    let mut pickle = b"\x80\x02}(U\x04self]q\x00h\x00aU\x05large]q\x01".to_vec();
    for i in 1..=40 {
        pickle.extend([b'0', b']', b'q', i + 1, b'h', i, b'a', b'h', i, b'a']);
    }
    let weights = one_tensor("FloatStorage", b"K\x02\x85", b"K\x01\x85");
    pickle.extend(b"U\x10model_state_dict");
    pickle.extend(&weights[2..weights.len() - 1]);
    pickle.extend(b"u.");
    let tensors = read_tensors(&archive(&pickle, &[])).expect("tensors");
    assert_eq!(tensors["w"].data, [0.0, 0.0]);
}

#[test]
fn a_small_pickle_does_not_make_large_metadata() {
    let weights = one_tensor("FloatStorage", b"K\x02\x85", b"K\x01\x85");
    // `{.., "model_state_dict": weights}`, the rest given as pickled keys and values.
    let file = |rest: &[u8]| {
        let mut pickle = b"\x80\x02}(".to_vec();
        pickle.extend(rest);
        pickle.extend(b"U\x10model_state_dict");
        pickle.extend(&weights[2..weights.len() - 1]);
        pickle.extend(b"u.");
        archive(&pickle, &[])
    };

    // Many keys share a list of many values.
    let mut shared = b"U\x01a](".to_vec();
    shared.extend(b"N".repeat(19_000));
    shared.extend(b"eq\x00");
    for key in 0..400u16 {
        shared.extend(b"U\x02");
        shared.extend(key.to_le_bytes());
        shared.extend(b"h\x00");
    }
    let error = read_tensors(&file(&shared))
        .expect_err("too large")
        .to_string();
    assert!(
        error.contains("the values saved with the weights"),
        "{error}"
    );

    // Lists that name one long text many times are not a configuration, and are left out.
    let mut texts = b"U\x01tX".to_vec();
    texts.extend(100_000u32.to_le_bytes());
    texts.extend(b"x".repeat(100_000));
    texts.extend(b"q\x00");
    for key in [b'a', b'b', b'c'] {
        texts.extend([b'U', 1, key, b']', b'(']);
        texts.extend(b"h\x00".repeat(19_000));
        texts.push(b'e');
    }
    assert!(read_tensors(&file(&texts)).is_ok());

    // Objects share the name of their class.
    let mut objects = b"U\x01o](c".to_vec();
    objects.extend(b"m".repeat(20_000));
    objects.extend(b"\nC\nq\x00");
    objects.extend(b"h\x00)R".repeat(200_000));
    objects.push(b'e');
    assert!(read_tensors(&file(&objects)).is_ok());

    // A name of two texts is a text of its own.
    let mut names = b"U\x01nX".to_vec();
    names.extend(100_000u32.to_le_bytes());
    names.extend(b"m".repeat(100_000));
    names.extend(b"q\x00](");
    names.extend(b"h\x00h\x00\x93".repeat(1000));
    names.push(b'e');
    let error = read_tensors(&file(&names))
        .expect_err("too large")
        .to_string();
    assert!(error.contains("the pickle cannot be read"), "{error}");

    // A byte a value.
    let mut values = b"U\x01v](".to_vec();
    values.extend(b"]".repeat(1 << 20));
    values.push(b'e');
    let error = read_tensors(&file(&values))
        .expect_err("too large")
        .to_string();
    assert!(error.contains("more than 524288 values"), "{error}");
}

#[test]
fn a_summary_gives_the_velocity_weight_of_the_training() {
    let mut checkpoint = tiny("basic-vel-std-bg-tiny");
    let training = |weight: f64| format!(r#"{{"epochs": 3, "velocity_weight": {weight}}}"#);
    for weight in [0.0, 0.1, 0.5] {
        let metadata = ("tracklens.training".to_owned(), training(weight));
        checkpoint.metadata = [metadata].into();
        for format in FORMATS {
            let bytes = checkpoint.to_bytes(format).expect("bytes");
            let summary = Checkpoint::from_bytes(&bytes)
                .expect("a checkpoint")
                .summary();
            assert_eq!(summary.training.velocity_weight, Some(weight), "{format}");
        }
    }
    checkpoint.metadata.clear();
    assert_eq!(checkpoint.summary().training.velocity_weight, None);
    // What the authors' code trained with is in its own configuration.
    let cfg = r#"{"training": {"loss_weights": {"velocity": 0.25}}}"#;
    checkpoint.metadata = [("cfg".to_owned(), cfg.to_owned())].into();
    assert_eq!(checkpoint.summary().training.velocity_weight, Some(0.25));
}

#[test]
fn no_damage_makes_a_reader_panic() {
    for bytes in [
        golden("basic-vel-std-bg-tiny.pth"),
        tiny("dsae-tiny").to_bytes(Format::Burnpack).expect("bytes"),
        tiny("dsae-tiny").to_bytes(Format::PyTorch).expect("bytes"),
    ] {
        for at in (0..bytes.len()).step_by(41) {
            for change in [0xff, 0x01] {
                let mut damaged = bytes.clone();
                damaged[at] ^= change;
                _ = Checkpoint::from_bytes(&damaged);
            }
        }
    }
    // With sums that fit, so that a damaged pickle reaches its reader.
    let weights = one_tensor("FloatStorage", b"K\x02\x85", b"K\x01\x85");
    for at in 0..weights.len() {
        for value in 0..=255 {
            let mut damaged = weights.clone();
            damaged[at] = value;
            _ = read_tensors(&archive(&damaged, &[]));
        }
        _ = read_tensors(&archive(&weights[..at], &[]));
    }
}

/// A checkpoint's tensors under names with a prefix.
fn prefixed(checkpoint: &Checkpoint, prefix: &str) -> BTreeMap<String, Tensor> {
    let named = |(name, tensor): (&String, &Tensor)| (format!("{prefix}{name}"), tensor.clone());
    checkpoint.tensors.iter().map(named).collect()
}

#[test]
fn weights_are_found_below_any_prefix_and_chosen_by_key() {
    let (one, other) = (tiny("dsae-tiny"), tiny("basic-vel-std-bg-tiny"));
    for prefix in ["model.", "_orig_mod.module.", "policy.features_extractor."] {
        let read = Checkpoint::from_bytes(&safetensors(&prefixed(&one, prefix), None));
        assert_eq!(read.expect(prefix).tensors, one.tensors);
    }
    let mut both = prefixed(&one, "actor.");
    both.extend(prefixed(&other, "critic."));
    let both = safetensors(&both, None);
    let error = Checkpoint::from_bytes(&both).expect_err("two").to_string();
    assert!(
        error.contains("2 sets of weights") && error.contains("`actor`, `critic`"),
        "{error}"
    );
    let read = Checkpoint::from_bytes_at(&both, Some("critic")).expect("one of them");
    assert_eq!(read.tensors, other.tensors);
    assert_eq!(
        read.metadata["tracklens.weights"],
        "critic (there are also: actor)"
    );
    let none = Checkpoint::from_bytes_at(&both, Some("ema"))
        .expect_err("none")
        .to_string();
    assert!(
        none.contains("no weights of an SAE under the key `ema`"),
        "{none}"
    );
}

#[test]
fn a_checkpoint_in_several_files_is_put_together() {
    let whole = tiny("dsae-tiny");
    let (mut a, mut b) = (BTreeMap::new(), BTreeMap::new());
    for (i, (name, tensor)) in whole.tensors.iter().enumerate() {
        let part = if i % 2 == 0 { &mut a } else { &mut b };
        part.insert(format!("model.{name}"), tensor.clone());
    }
    let shards = [safetensors(&a, None), safetensors(&b, None)];
    let read = Checkpoint::from_shards(&shards, None).expect("a checkpoint");
    assert_eq!(read.tensors, whole.tensors);
    let twice = Checkpoint::from_shards(&[&shards[..], &shards[..1]].concat(), None);
    assert!(
        twice
            .expect_err("twice")
            .to_string()
            .contains("is in two of the files")
    );
}

#[test]
fn a_policy_in_an_archive_and_a_file_without_one_are_read() {
    let whole = tiny("dsae-tiny");
    let pth = whole.to_bytes(Format::PyTorch).expect("a file");
    use std::io::Write as _;
    let mut bytes = Vec::new();
    let mut zip = rawzip::ZipArchiveWriter::new(&mut bytes);
    for (name, data) in [("data", &b"{}"[..]), ("policy.pth", &pth[..])] {
        let (mut entry, config) = zip.new_file(name).start().expect("an entry");
        let mut writer = config.wrap(&mut entry);
        writer.write_all(data).expect("written");
        let (_, descriptor) = writer.finish().expect("written");
        entry.finish(descriptor).expect("written");
    }
    zip.finish().expect("written");
    let read = Checkpoint::from_bytes(&bytes).expect("a policy");
    assert_eq!(read.tensors, whole.tensors);

    // As before PyTorch 1.6: pickles one after the other, then every storage with its length.
    let mut legacy =
        b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.\x80\x02M\xe9\x03.\x80\x02}.".to_vec();
    legacy.extend(one_tensor("FloatStorage", b"K\x02\x85", b"K\x01\x85"));
    legacy.extend(b"\x80\x02]U\x010a.");
    legacy.extend(2_u64.to_le_bytes());
    legacy.extend([1.5_f32, -2.0].iter().flat_map(|v| v.to_le_bytes()));
    let tensors = read_tensors(&legacy).expect("tensors");
    assert_eq!(tensors["w"].data, [1.5, -2.0]);
    let cut = read_tensors(&legacy[..legacy.len() - 1])
        .expect_err("cut")
        .to_string();
    assert!(cut.contains("not a complete .pth file"), "{cut}");
}

#[test]
fn buffers_that_are_not_needed_are_left_out() {
    let whole = tiny("dsae-tiny");
    let mut dtypes = BTreeMap::new();
    let bytes: Vec<(String, Vec<u8>)> = whole
        .tensors
        .iter()
        .map(|(name, t)| {
            (
                name.clone(),
                t.data.iter().flat_map(|v| v.to_le_bytes()).collect(),
            )
        })
        .chain([("encoder.grid".to_owned(), vec![0; 16])])
        .collect();
    for (name, tensor) in &whole.tensors {
        dtypes.insert(name.clone(), (Dtype::F32, tensor.shape.clone()));
    }
    dtypes.insert("encoder.grid".to_owned(), (Dtype::I64, vec![2]));
    let views = bytes.iter().map(|(name, data)| {
        let (dtype, shape) = dtypes[name].clone();
        (
            name.clone(),
            TensorView::new(dtype, shape, data).expect("a view"),
        )
    });
    let file = safetensors::serialize(views, None).expect("a file");
    assert_eq!(
        Checkpoint::from_bytes(&file).expect("a checkpoint").tensors,
        whole.tensors
    );
}
