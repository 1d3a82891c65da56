//! The names in a ZIP archive, which say in which encoding they are only when it is UTF-8.

/// The upper half of code page 437, in which names are by the standard.
const CP437: &str = "ÇüéâäàåçêëèïîìÄÅÉæÆôöòûùÿÖÜ¢£¥₧ƒáíóúñÑªº¿⌐¬½¼¡«»░▒▓│┤╡╢╖╕╣║╗╝╜╛┐└┴┬├─┼╞╟╚╔╩╦╠═╬╧\
                     ╨╤╥╙╘╒╓╫╪┘┌█▄▌▐▀αßΓπΣσµτΦΘΩδ∞φε∩≡±≥≤⌠⌡÷≈°∙·√ⁿ²■\u{a0}";

/// The name that `bytes` are: UTF-8 where the archive says so or they can be; otherwise Shift-JIS, as
/// Japanese systems write, where it makes Japanese of them; otherwise code page 437.
pub(super) fn decoded(bytes: &[u8], is_utf8: bool) -> String {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return text.to_owned();
    }
    if is_utf8 {
        return String::from_utf8_lossy(bytes).into_owned();
    }
    match shift_jis(bytes).filter(|text| is_japanese(text)) {
        Some(text) => text,
        None => bytes.iter().map(|byte| cp437(*byte)).collect(),
    }
}

fn cp437(byte: u8) -> char {
    let upper = byte.checked_sub(128).map(usize::from);
    let char = upper.and_then(|at| CP437.chars().nth(at));
    char.unwrap_or(char::from(byte))
}

/// Whether text that could be read as Shift-JIS is meant so: what is meant as another encoding gives
/// single signs between letters, Latin letters of full width and Katakana of half width.
fn is_japanese(text: &str) -> bool {
    let is_sign = |c: char| matches!(c, '\u{3040}'..='\u{30ff}' | '\u{3400}'..='\u{9fff}' | '々');
    if text
        .chars()
        .any(|c| !c.is_ascii() && !is_sign(c) && !matches!(c, '\u{3000}'..='\u{303f}'))
    {
        return false;
    }
    let chars: Vec<char> = text.chars().collect();
    let is_alone = |at: usize| {
        let beside = |at: Option<usize>| at.and_then(|at| chars.get(at)).copied();
        let [before, after] = [beside(at.checked_sub(1)), beside(Some(at + 1))];
        let is_letter = |c: Option<char>| c.is_some_and(|c| c.is_ascii_alphabetic());
        let is_kanji = matches!(chars[at], '\u{3400}'..='\u{9fff}');
        let has_company = [before, after].into_iter().flatten().any(is_sign);
        is_kanji && !has_company && (is_letter(before) || is_letter(after))
    };
    !(0..chars.len()).any(is_alone)
}

/// By the browser, which has the tables already; `None` where they are not Shift-JIS.
#[cfg(all(feature = "web-part", target_arch = "wasm32"))]
fn shift_jis(bytes: &[u8]) -> Option<String> {
    use wasm_bindgen::prelude::*;
    #[wasm_bindgen]
    extern "C" {
        type TextDecoder;
        #[wasm_bindgen(constructor, catch)]
        fn new(encoding: &str) -> Result<TextDecoder, JsValue>;
        #[wasm_bindgen(method)]
        fn decode(this: &TextDecoder, bytes: &[u8]) -> String;
    }
    let text = TextDecoder::new("shift_jis").ok()?.decode(bytes);
    (!text.contains(char::REPLACEMENT_CHARACTER)).then_some(text)
}

/// Only the page opens archives of files.
#[cfg(not(all(feature = "web-part", target_arch = "wasm32")))]
fn shift_jis(_: &[u8]) -> Option<String> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_the_encoding_that_they_can_be_in() {
        assert_eq!(decoded("Größe/ä".as_bytes(), false), "Größe/ä");
        assert_eq!(decoded(b"Gr\x94\xe1e/\x84.csv", false), "Größe/ä.csv");
        assert_eq!(decoded(b"\xffa", true), "\u{fffd}a");
        assert_eq!(CP437.chars().count(), 128);
    }

    #[test]
    fn japanese_is_told_from_what_only_looks_like_it() {
        for text in [
            "日本/表.csv",
            "表1.csv",
            "カメラ_1/フレーム.png",
            "あ.csv",
            "日x本語",
        ] {
            assert_eq!(is_japanese(text), text != "日x本語", "{text}");
        }
        // As `Höhle`, `été` and `ñandú` are read.
        for text in ["H派le", "値t値", "､and｣"] {
            assert!(!is_japanese(text), "{text}");
        }
    }
}
