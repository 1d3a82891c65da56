//! How chunks are packed, for a browser: what zarrs takes from C elsewhere, in Rust.

use std::borrow::Cow;
use std::sync::{Arc, Once};

use zarrs::array::codec::api::{
    BytesToBytesCodecTraits, Codec, CodecError, CodecMetadataOptions, CodecOptions,
    CodecRuntimePluginV2, CodecRuntimePluginV3, CodecTraits, PartialDecoderCapability,
    PartialEncoderCapability, RecommendedConcurrency, register_codec_v2, register_codec_v3,
};
use zarrs::array::{ArrayBytesRaw, BytesRepresentation};
use zarrs::metadata::Configuration;
use zarrs::plugin::{ExtensionName, ZarrVersion};

/// Makes the codecs known to zarrs.
pub fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        for codec in [Unpacker::Blosc, Unpacker::Zstd] {
            let is_name = move |name: &str| {
                name.strip_prefix("numcodecs.").unwrap_or(name) == codec.codec_name()
            };
            let create = move || Ok(Codec::BytesToBytes(Arc::new(codec)));
            register_codec_v2(CodecRuntimePluginV2::new(is_name, move |_| create()));
            register_codec_v3(CodecRuntimePluginV3::new(is_name, move |_| create()));
        }
    });
}

/// A codec that only unpacks.
#[derive(Debug, Clone, Copy)]
enum Unpacker {
    Blosc,
    Zstd,
}

impl Unpacker {
    fn codec_name(self) -> &'static str {
        match self {
            Self::Blosc => "blosc",
            Self::Zstd => "zstd",
        }
    }

    /// What `packed` holds; `most` bytes at most, where that is known.
    fn unpack(self, packed: &[u8], most: Option<u64>) -> Result<Vec<u8>, CodecError> {
        let most = most.and_then(|most| usize::try_from(most).ok());
        let unpacked = match self {
            Self::Blosc if is_whole_blosc(packed) => {
                blusc::convenience::blosc1_decompress(packed).map_err(|e| e.to_string())
            }
            Self::Blosc => Err("its header does not fit its bytes".to_owned()),
            Self::Zstd => zrip::decompress_with_limit(packed, most.unwrap_or(usize::MAX))
                .map_err(|e| e.to_string()),
        };
        unpacked.map_err(|e| CodecError::Other(format!("{}: {e}", self.codec_name())))
    }
}

/// Whether a header of Blosc is of as many bytes as there are.
fn is_whole_blosc(bytes: &[u8]) -> bool {
    const HEADER: usize = 16;
    /// A flag: the bytes follow as they are.
    const STORED: u8 = 2;
    let Some(header) = bytes.first_chunk::<HEADER>() else {
        return false;
    };
    let number = |at: usize| {
        let digits = header[at..at + 4].iter().rev();
        digits.fold(0, |number, digit| number << 8 | usize::from(*digit))
    };
    let (unpacked, packed) = (number(4), number(12));
    packed == bytes.len() && (header[2] & STORED == 0 || HEADER + unpacked == packed)
}

impl ExtensionName for Unpacker {
    fn name(&self, _version: ZarrVersion) -> Option<Cow<'static, str>> {
        Some(self.codec_name().into())
    }
}

impl CodecTraits for Unpacker {
    fn as_any(&self) -> &dyn std::any::Any {
        self
    }

    fn configuration(
        &self,
        _version: ZarrVersion,
        _options: &CodecMetadataOptions,
    ) -> Option<Configuration> {
        None
    }

    fn partial_decoder_capability(&self) -> PartialDecoderCapability {
        PartialDecoderCapability {
            partial_read: false,
            partial_decode: false,
        }
    }

    fn partial_encoder_capability(&self) -> PartialEncoderCapability {
        PartialEncoderCapability {
            partial_encode: false,
        }
    }
}

impl BytesToBytesCodecTraits for Unpacker {
    fn into_dyn(self: Arc<Self>) -> Arc<dyn BytesToBytesCodecTraits> {
        self
    }

    fn recommended_concurrency(
        &self,
        _decoded: &BytesRepresentation,
    ) -> Result<RecommendedConcurrency, CodecError> {
        Ok(RecommendedConcurrency::new_maximum(1))
    }

    fn encoded_representation(&self, _decoded: &BytesRepresentation) -> BytesRepresentation {
        BytesRepresentation::UnboundedSize
    }

    fn encode<'a>(
        &self,
        _decoded: ArrayBytesRaw<'a>,
        _options: &CodecOptions,
    ) -> Result<ArrayBytesRaw<'a>, CodecError> {
        Err(CodecError::Other("chunks are only read".to_owned()))
    }

    fn decode<'a>(
        &self,
        packed: ArrayBytesRaw<'a>,
        decoded: &BytesRepresentation,
        _options: &CodecOptions,
    ) -> Result<ArrayBytesRaw<'a>, CodecError> {
        self.unpack(&packed, decoded.size()).map(Cow::Owned)
    }
}
