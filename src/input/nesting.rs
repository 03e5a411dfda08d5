//! How deeply brackets and braces of a TOML text are nested. The parser recurses into each, and its own limit does not hold for all.

/// Deeper texts are refused before they are parsed.
const DEEPEST: usize = 64;

/// The place, in bytes, at which brackets and braces outside strings and comments are nested too deeply; none if they are not. Strings and
/// comments end where the parser ends them, also if they are malformed, and what closes another kind than the last that was opened closes
/// nothing.
pub(super) fn too_deep(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut open, mut at) = (Vec::new(), 0);
    while let Some(&byte) = bytes.get(at) {
        match byte {
            b'[' | b'{' if open.len() == DEEPEST => return Some(at),
            b'[' => open.push(b']'),
            b'{' => open.push(b'}'),
            b']' | b'}' => _ = open.pop_if(|closes| *closes == byte),
            b'#' => {
                at = bytes[at..]
                    .iter()
                    .position(|b| matches!(b, b'\r' | b'\n'))
                    .map_or(bytes.len(), |i| at + i);
                continue;
            }
            b'"' | b'\'' => {
                at = end_of_string(bytes, at);
                continue;
            }
            b'.' | b'=' | b',' | b' ' | b'\t' | b'\r' | b'\n' => {}
            // A word, of which a quote inside is a part.
            _ => {
                let ends = |b: &u8| b".=,[]{} \t#\r\n".contains(b);
                at = bytes[at..].iter().position(ends).map_or(bytes.len(), |i| at + i);
                continue;
            }
        }
        at += 1;
    }
    None
}

/// The place after a string that starts at `start`, or after the line or the text if it does not end.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let quote = bytes[start];
    let long = bytes[start..].starts_with(&[quote; 3]);
    let end: &[u8] = if long { &[quote; 3] } else { &[quote] };
    let mut at = start + end.len();
    while let Some(&byte) = bytes.get(at) {
        match byte {
            _ if bytes[at..].starts_with(end) => {
                at += end.len();
                // A long string may end with one or two quotes of its own.
                let own = bytes[at..].iter().take(2).take_while(|b| long && **b == quote).count();
                return at + own;
            }
            b'\n' if !long => return at,
            b'\\' if quote == b'"' && matches!(bytes.get(at + 1), Some(b'\\' | b'"')) => at += 2,
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
            format!("a = \"\"\"\n{many}\\\"\"\"{many}\"\"\"\"\""),
            format!("a = \"{many}\nb = 1"),
        ] {
            let outside = format!("{text}\n{many}");
            assert_eq!(too_deep(&text), None, "{text}");
            assert_eq!(too_deep(&outside), Some(text.len() + 1 + DEEPEST), "{outside}");
        }
        for text in
            ["{]".repeat(100), format!("a = \"b\\\n{many}\""), format!("# b\r{many}"), format!("a\"{many}\"")]
        {
            assert!(too_deep(&text).is_some(), "{text}");
        }
    }
}
