//! Changes to files, the same for the same number.

use std::io::{Cursor, Write};

/// Numbers at which readers go wrong.
const NUMBERS: [u64; 12] = [0, 1, 2, 7, 127, 128, 255, 32768, 65535, 1 << 31, u32::MAX as u64, u64::MAX];
/// The same in text, and what nests or ends it.
const WORDS: [&str; 26] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "99999999999999999999",
    "4294967296",
    "0.0",
    "true",
    "null",
    "\"\"",
    "[",
    "]",
    "{",
    "}",
    "(",
    ")",
    ",",
    "=",
    "\n",
    "'",
    "\\",
    "é",
    "\u{1b}[2J",
];
/// Repetitions of a piece.
const REPEATS: [usize; 4] = [2, 10, 100, 3000];

/// A sequence of numbers that depends only on its name and number (SplitMix64).
pub struct Random(u64);

impl Random {
    pub fn new(name: &str, number: u64) -> Self {
        let name = name.bytes().fold(0, |sum: u64, b| sum.wrapping_mul(257).wrapping_add(b.into()));
        Self(name.wrapping_add(number.wrapping_mul(0xd134_2543_de82_ef95)))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from 0 to `n` − 1.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// One of the seeds with one to four changes.
pub fn bytes(random: &mut Random, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = random.of(seeds).clone();
    for _ in 0..=random.below(4) {
        change(random, &mut bytes, seeds);
    }
    bytes
}

fn change(random: &mut Random, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
    let at = random.below(bytes.len() + 1);
    let scale = random.below(12);
    let end = (at + random.below(1 << scale)).min(bytes.len());
    match random.below(10) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
        1 if at < bytes.len() => bytes[at] = random.below(256) as u8,
        2 => {
            let number = *random.of(&NUMBERS);
            let width = *random.of(&[1, 2, 4, 8]);
            let number =
                if random.below(2) == 0 { number.to_le_bytes() } else { number.swap_bytes().to_le_bytes() };
            for (i, byte) in number[..width].iter().enumerate() {
                if let Some(target) = bytes.get_mut(at + i) {
                    *target = *byte;
                }
            }
        }
        3 => bytes.truncate(at),
        4 => _ = bytes.drain(at..end),
        5 => {
            let piece = bytes[at..end.min(at + 64)].repeat(*random.of(&REPEATS));
            bytes.splice(at..at, piece);
        }
        6 => {
            let other = random.of(seeds);
            let from = random.below(other.len() + 1);
            let to = (from + random.below(256)).min(other.len());
            bytes.splice(at..end.min(at + 8), other[from..to].iter().copied());
        }
        7 => {
            let word = random.of(&WORDS).as_bytes().repeat(if random.below(8) == 0 {
                *random.of(&REPEATS)
            } else {
                1
            });
            bytes.splice(at..end.min(at + 4), word);
        }
        _ => replace_number(random, bytes, at),
    }
}

/// Puts another number in the place of the first one in text after `at`.
fn replace_number(random: &mut Random, bytes: &mut Vec<u8>, at: usize) {
    let is_part = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'e' | b'+');
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
    let end = bytes[start..].iter().position(|b| !is_part(b)).map_or(bytes.len(), |i| start + i);
    let word = random.of(&WORDS[..12]).as_bytes().to_vec();
    bytes.splice(start..end, word);
}

/// The members of an archive, by name.
pub type Members = Vec<(String, Vec<u8>)>;

/// The members of one of the seeds, of which one to three are changed, dropped, swapped or renamed.
pub fn members(random: &mut Random, seeds: &[Members]) -> Members {
    let mut members = random.of(seeds).clone();
    let all: Vec<Vec<u8>> = members.iter().map(|(_, content)| content.clone()).collect();
    for _ in 0..=random.below(3) {
        let at = random.below(members.len());
        match random.below(8) {
            0 => _ = members.swap_remove(at),
            1 => members[at].1 = random.of(&all).clone(),
            2 => {
                let other = random.below(members.len());
                members[at].0 = format!("{}x", members[other].0);
            }
            _ => change(random, &mut members[at].1, &all),
        }
        if members.is_empty() {
            break;
        }
    }
    members
}

/// An archive, with right checksums.
pub fn zipped(members: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, content) in members {
        // A name that is there already is left out.
        if zip.start_file(name, options).is_ok() {
            zip.write_all(content).unwrap();
        }
    }
    zip.finish().unwrap().into_inner()
}

/// Corrects the checksums of the chunks of a PNG image, as far as it is one.
pub fn with_png_checksums(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let Some(end) = length.checked_add(at + 8).filter(|end| end + 4 <= bytes.len()) else { break };
        let sum = crc32(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
    })
}
