//! How deeply brackets and braces of a TOML text are nested. The parser recurses into each, and its own limit does not hold for all.

/// Deeper texts are refused before they are parsed.
const DEEPEST: usize = 64;

/// The place, in bytes, at which brackets and braces outside strings and comments are nested too deeply; none if they are not.
pub(super) fn too_deep(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut depth, mut at) = (0_usize, 0);
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'[' | b'{' if depth == DEEPEST => return Some(at),
            b'[' | b'{' => depth += 1,
            b']' | b'}' => depth = depth.saturating_sub(1),
            b'#' => at = end_of_line(bytes, at),
            b'"' | b'\'' => {
                at = end_of_string(bytes, at);
                continue;
            }
            _ => {}
        }
        at += 1;
    }
    None
}

fn end_of_line(bytes: &[u8], from: usize) -> usize {
    bytes[from..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| from + i)
}

/// The place after a string that starts at `start`, or after the line or the text if it does not end.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let quote = bytes[start];
    let long = bytes[start..].starts_with(&[quote; 3]);
    let end: &[u8] = if long { &[quote; 3] } else { &[quote] };
    let mut at = start + end.len();
    while let Some(&byte) = bytes.get(at) {
        match byte {
            _ if bytes[at..].starts_with(end) => return at + end.len(),
            b'\n' if !long => return at,
            b'\\' if quote == b'"' => at += 2,
            _ => at += 1,
        }
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_brackets_that_nest_count() {
        assert_eq!(too_deep(&format!("a = {}{}", "[".repeat(64), "]".repeat(64))), None);
        assert_eq!(too_deep(&format!("a = {}", "[{".repeat(40))), Some(4 + 64));
        assert_eq!(too_deep(&"[a]\n".repeat(100)), None);
        let many = "[".repeat(100);
        for text in [
            format!("# {many}"),
            format!("a = \"{many}\\\"{many}\""),
            format!("a = '{many}'"),
            format!("a = '''{many}\n{many}'''"),
            format!("a = \"\"\"\n{many}\\\"\"\"\"\"{many}\"\"\""),
            format!("a = \"{many}\nb = 1"),
        ] {
            let outside = format!("{text}\n{many}");
            assert_eq!(too_deep(&text), None, "{text}");
            assert_eq!(too_deep(&outside), Some(text.len() + 1 + DEEPEST), "{outside}");
        }
    }
}
