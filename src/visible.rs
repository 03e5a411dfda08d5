//! Text from files and arguments, made safe to show: on one line, and without characters that a terminal or an XML parser obeys.

use std::borrow::Cow;

/// Longer texts are cut, characters.
const LONGEST: usize = 2000;

/// A text on one line: control characters and marks that change the direction of writing are shown as escapes such as `\n` and
/// `\u{1b}`, and a very long text is cut.
pub fn visible(text: &str) -> Cow<'_, str> {
    if text.len() <= LONGEST && !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len().min(LONGEST));
    for (i, c) in text.chars().enumerate() {
        if i == LONGEST {
            shown.push('…');
            break;
        }
        if acts(c) { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// Control characters, ends of lines, marks of direction, and code points that are no characters.
fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
        || matches!(u32::from(c) & 0xffff, 0xfffe | 0xffff)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_is_shown_and_the_rest_stays() {
        assert_eq!(visible("fuß LF ×2"), "fuß LF ×2");
        assert_eq!(visible("a\u{1b}[2J\nb\u{202e}c\u{7}"), "a\\u{1b}[2J\\nb\\u{202e}c\\u{7}");
        assert_eq!(visible(&"x".repeat(9000)).chars().count(), LONGEST + 1);
    }
}
