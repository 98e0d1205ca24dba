//! The outermost layer of a glTF file: GLB chunks, or plain JSON.

use std::borrow::Cow;
use std::path::Path;

/// The two things that a file holds.
pub(super) struct Container {
    /// The JSON text.
    pub json: Vec<u8>,
    /// The binary chunk of a GLB.
    pub bin: Option<Vec<u8>>,
}

const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    four.try_into().ok().map(u32::from_le_bytes)
}

impl Container {
    /// Reads a file.
    pub(super) fn open(path: &Path) -> Result<Container, String> {
        if path.is_dir() {
            return Err("this is a folder; the scene is a .glb or .gltf file in it".to_owned());
        }
        Self::read(std::fs::read(path).map_err(|e| format!("cannot read the file: {e}"))?)
    }

    /// Splits `bytes`; a GLB is known by its first four bytes, not by the file's name.
    pub(super) fn read(bytes: Vec<u8>) -> Result<Container, String> {
        if bytes.is_empty() {
            return Err("the file is empty".into());
        }
        if bytes.starts_with(b"glTF") {
            return glb(&bytes);
        }
        let json = match bytes.strip_prefix(b"\xef\xbb\xbf") {
            Some(rest) => rest.to_vec(),
            None => bytes,
        };
        match json.iter().find(|b| !b.is_ascii_whitespace()) {
            Some(b'{') => Ok(Container { json, bin: None }),
            _ => Err("this is neither a binary glTF file (it does not start with \"glTF\") nor glTF JSON; export scenes of other \
                      programs as glTF 2.0 (.glb)"
                .into()),
        }
    }
}

/// glTF 2.0 specification, section 4.4. Chunk alignment and padding are not insisted on, sizes are.
fn glb(bytes: &[u8]) -> Result<Container, String> {
    let (Some(version), Some(length)) = (u32_at(bytes, 4), u32_at(bytes, 8)) else {
        return Err("the GLB header is cut off; the file is incomplete".into());
    };
    if version != 2 {
        return Err(format!("GLB version {version} is not supported, only 2; convert the file to glTF 2.0"));
    }
    let length = length as usize;
    if length > bytes.len() {
        let len = bytes.len();
        return Err(format!("the GLB header promises {length} bytes, the file has {len}; it is incomplete"));
    }
    let bytes = &bytes[..length];
    let mut json = None;
    let mut bin = None;
    let mut at = 12_usize;
    let mut chunk = 0;
    while at < bytes.len() {
        let (Some(size), Some(kind)) = (u32_at(bytes, at), u32_at(bytes, at + 4)) else {
            // Up to 7 stray bytes: padding that some writers leave; before the first chunk it is a broken file.
            if chunk == 0 {
                return Err("the GLB holds no chunk".into());
            }
            break;
        };
        let start = at + 8;
        let data = start
            .checked_add(size as usize)
            .and_then(|end| bytes.get(start..end))
            .ok_or_else(|| format!("GLB chunk {chunk} of {size} bytes reaches past the end of the file"))?;
        match kind {
            CHUNK_JSON if json.is_none() => json = Some(data),
            CHUNK_BIN if bin.is_none() => bin = Some(data),
            _ if chunk == 0 => return Err("the first chunk of the GLB is not JSON".into()),
            _ => {} // section 4.4.3: unknown chunks are ignored
        }
        at = start + data.len();
        chunk += 1;
    }
    match json {
        Some(json) if !json.is_empty() => Ok(Container { json: json.to_vec(), bin: bin.map(<[u8]>::to_vec) }),
        Some(_) => Err("the JSON chunk of the GLB is empty".into()),
        None => Err("the GLB holds no JSON chunk".into()),
    }
}

/// What a URI stands for.
pub(super) enum Uri<'a> {
    /// Bytes inside the URI itself.
    Data(Vec<u8>),
    /// A path relative to the file: percent-decoded, and as written.
    Relative(Cow<'a, str>, &'a str),
}

/// Reads a URI as RFC 3986 and RFC 2397 define it, as far as glTF allows.
pub(super) fn read_uri(uri: &str) -> Result<Uri<'_>, String> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let (head, body) = rest.split_once(',').ok_or("a data URI without a comma")?;
        let body: Vec<u8> = percent_encoding::percent_decode_str(body).collect();
        if !head.ends_with(";base64") {
            return Ok(Uri::Data(body));
        }
        // Writers disagree about padding, line breaks and the two alphabets of base64.
        let text: Vec<u8> = body
            .into_iter()
            .filter(|b| !b.is_ascii_whitespace() && *b != b'=')
            .map(|b| match b {
                b'-' => b'+',
                b'_' => b'/',
                b => b,
            })
            .collect();
        use base64::Engine;
        return match base64::engine::general_purpose::STANDARD_NO_PAD.decode(text) {
            Ok(data) => Ok(Uri::Data(data)),
            Err(e) => Err(format!("a data URI is no valid base64: {e}")),
        };
    }
    let scheme = uri
        .split_once(':')
        .map(|(s, _)| s)
        .filter(|s| s.len() > 1 && s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c)));
    if let Some(scheme) = scheme {
        return Err(format!("'{scheme}:' URIs are not fetched; download the file and refer to it by a relative path"));
    }
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8().unwrap_or(Cow::Borrowed(uri));
    Ok(Uri::Relative(decoded, uri))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb_of(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, data) in chunks {
            body.extend((data.len() as u32).to_le_bytes());
            body.extend(*kind);
            body.extend(*data);
        }
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend((body.len() as u32 + 12).to_le_bytes());
        out.extend(body);
        out
    }

    #[test]
    fn chunks_are_split_and_unknown_ones_skipped() {
        let c = Container::read(glb_of(&[(b"JSON", b"{}"), (b"odd!", b"x"), (b"BIN\0", b"123")])).unwrap();
        assert_eq!(c.json, b"{}");
        assert_eq!(c.bin.unwrap(), b"123");
    }

    #[test]
    fn every_truncation_is_refused_or_complete() {
        let whole = glb_of(&[(b"JSON", b"{}"), (b"BIN\0", b"1234")]);
        for n in 0..whole.len() {
            assert!(Container::read(whole[..n].to_vec()).is_err(), "{n} of {} bytes were accepted", whole.len());
        }
    }

    #[test]
    fn uris() {
        let data = |u: &str| match read_uri(u) {
            Ok(Uri::Data(d)) => d,
            _ => panic!("{u}"),
        };
        assert_eq!(data("data:application/octet-stream;base64,AQID"), [1, 2, 3]);
        assert_eq!(data("data:;base64,AQI="), [1, 2]);
        assert_eq!(data("data:;base64,AQI"), [1, 2]);
        assert_eq!(data("data:,a%20b"), b"a b");
        assert!(read_uri("data:;base64,A!").is_err());
        assert!(read_uri("https://example.org/a.bin").is_err());
        assert!(matches!(read_uri("a%20b/%C3%A9.bin"), Ok(Uri::Relative(p, _)) if p == "a b/é.bin"));
    }
}
