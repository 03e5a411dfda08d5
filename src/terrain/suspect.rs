//! Heights that cannot be meant: values that stand for "no data", units that are not the meter.

use crate::error::{Error, Result};

/// What programs write where they have measured nothing; beside them ±1e10 and beyond.
const MARKS: [f64; 13] = [
    -999.0,
    999.0,
    -9999.0,
    9999.0,
    -99999.0,
    99999.0,
    -32768.0,
    -32767.0,
    32767.0,
    65535.0,
    1e6,
    -1e6,
    -2147483648.0,
];
/// From here on a value is taken for a mark, whatever it is.
const HUGE: f64 = 1e10;
/// A value is isolated if it is this many times as far from the rest as the rest is from each other …
const ISOLATED: f64 = 3.0;
/// … and this far, m: less than this may be the bottom of a gap.
const LEAST_JUMP: f64 = 2.0;
/// A relief up to this is never out of proportion, m.
const LEAST_RELIEF: f64 = 3.0;
/// Larger reliefs are refused, in diagonals of the ground.
const RELIEF: f64 = 2.0;

/// The least or the greatest value, if it is far from all others.
struct Outlier {
    value: f64,
    /// Cells with this value.
    cells: usize,
    /// Distance from the nearest other value, m.
    jump: f64,
    /// How far the others are apart, m.
    rest: f64,
    below: bool,
}

/// Judges values as stored, NaN for no data, of which one unit is `unit` m, over a ground with a diagonal of `diagonal` m. Returns a
/// remark about a value that may stand for no data.
///
/// # Errors
/// If a value must stand for no data, or the heights differ by more than the ground is wide.
pub fn check(values: &[f64], unit: f64, diagonal: f64) -> Result<Option<String>> {
    let ends = [outlier(values, unit, true), outlier(values, unit, false)];
    let marked = |o: &&Outlier| MARKS.contains(&o.value) || o.value.abs() >= HUGE;
    if let Some(outlier) = ends.iter().flatten().find(marked) {
        return Err(Error::input(format!(
            "{}; if it {}, otherwise terrain.height_scale is wrong",
            outlier.describe(),
            outlier.remedy()
        )));
    }
    let (low, high) = super::raster::range(values);
    let relief = (high - low) * unit.abs();
    if relief > LEAST_RELIEF.max(RELIEF * diagonal) {
        let from = format!(
            "heights from {} to {} m on ground of {diagonal:.3} m from corner to corner",
            shown((low * unit).min(high * unit)),
            shown((low * unit).max(high * unit))
        );
        // Of two levels, either may be the one that stands for nothing.
        let why = match ends.iter().flatten().min_by_key(|o| o.cells) {
            Some(outlier) => format!("{}; if it {}, or", outlier.describe(), outlier.remedy()),
            None => format!("values from {} to {};", shown(low), shown(high)),
        };
        return Err(Error::input(format!(
            "{from} must be a mistake: {why} terrain.height_scale or terrain.spacing is wrong"
        )));
    }
    Ok(match ends {
        [Some(one), None] | [None, Some(one)] => Some(format!("{}; if it {}", one.describe(), one.remedy())),
        // Two levels far apart are a step.
        _ => None,
    })
}

impl Outlier {
    fn describe(&self) -> String {
        let Outlier { value, cells, jump, rest, below } = self;
        let side = if *below { "below" } else { "above" };
        let count = if *cells == 1 { "1 cell".to_owned() } else { format!("{cells} cells") };
        format!(
            "the value {} ({count}) is {} m {side} all others, which are within {} m of each other",
            shown(*value),
            shown(*jump),
            shown(*rest)
        )
    }

    fn remedy(&self) -> String {
        format!("stands for no data, set terrain.no_data = {}", shown(self.value))
    }
}

/// A number as short as it reads back, or, if it is a measure with many digits, with three decimals.
fn shown(value: f64) -> String {
    let exact = if value.abs() < 1e7 { format!("{value}") } else { format!("{value:e}") };
    if exact.len() <= 9 || value.abs() >= 1e7 { exact } else { format!("{value:.3}") }
}

/// The least value (or the greatest), if it is isolated.
fn outlier(values: &[f64], unit: f64, least: bool) -> Option<Outlier> {
    let sign = if least { 1.0 } else { -1.0 };
    let ordered = || values.iter().map(|v| sign * v).filter(|v| !v.is_nan());
    let first = ordered().fold(f64::INFINITY, f64::min);
    let (mut next, mut last, mut cells) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    for v in ordered() {
        if v == first {
            cells += 1;
        } else {
            next = next.min(v);
            last = last.max(v);
        }
    }
    if !next.is_finite() {
        return None;
    }
    let [jump, rest] = [next - first, last - next].map(|d| d * unit.abs());
    // The side in the world, where a negative unit turns the values over.
    let below = least == (unit >= 0.0);
    (jump >= ISOLATED * rest && jump >= LEAST_JUMP).then_some(Outlier {
        value: sign * first,
        cells,
        jump,
        rest,
        below,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ground(n: usize) -> Vec<f64> {
        (0..n).map(|i| 0.1 * (i as f64 * 0.37).sin()).collect()
    }

    fn with(value: f64) -> Vec<f64> {
        let mut values = ground(200);
        values[17] = value;
        values
    }

    #[test]
    fn marks_are_refused_by_their_value() {
        for (mark, shown) in [
            (-9999.0, "-9999"),
            (-32768.0, "-32768"),
            (1e20, "1e20"),
            (-3.4028234663852886e38, "-3.4028234663852886e38"),
            (65535.0, "65535"),
        ] {
            let message = check(&with(mark), 1.0, 5.0).unwrap_err().to_string();
            assert!(message.contains(&format!("{shown} (1 cell) is")), "{message}");
            assert!(message.contains("(1 cell)"), "{message}");
        }
        // In units of a millimeter.
        let millimeters: Vec<f64> = with(-32.768).iter().map(|v| (1000.0 * v).round()).collect();
        assert!(check(&millimeters, 0.001, 5.0).unwrap_err().to_string().contains("no_data = -32768"));
    }

    #[test]
    fn other_lone_values_are_remarked_on_and_refused_out_of_proportion() {
        let remark = check(&with(-4.0), 1.0, 5.0).unwrap().unwrap();
        assert!(
            remark.contains("the value -4 (1 cell) is 3.9")
                && remark.contains("if it stands for no data, set terrain.no_data")
        );
        let message = check(&with(-40.0), 1.0, 5.0).unwrap_err().to_string();
        assert!(
            message.contains("must be a mistake") && message.contains("terrain.no_data = -40"),
            "{message}"
        );
        let slope: Vec<f64> = (0..200).map(f64::from).collect();
        let message = check(&slope, 1.0, 5.0).unwrap_err().to_string();
        assert!(
            message.contains("heights from 0 to 199 m") && message.contains("terrain.height_scale"),
            "{message}"
        );
    }

    #[test]
    fn ground_with_steps_and_gaps_is_left_alone() {
        for values in [ground(200), with(1.0), with(-1.0), vec![f64::NAN; 9], vec![-9999.0; 9]] {
            assert_eq!(check(&values, 1.0, 5.0).unwrap(), None);
        }
        // Stones over a gap 5 m deep: two levels.
        let stones: Vec<f64> = (0..200).map(|i| if i % 3 == 0 { 0.0 } else { -5.0 }).collect();
        assert_eq!(check(&stones, 1.0, 8.0).unwrap(), None);
        // All values of 16 bits are used.
        let full: Vec<f64> = (0..200).map(|i| -32768.0 + 329.0 * f64::from(i)).collect();
        assert_eq!(check(&full, 1e-5, 5.0).unwrap(), None);
    }
}
