//! Smooths measured ground; planes are left unchanged.

/// Weight of a filled cell in the smoothing; that of a measured one is 1.
const FILLED_WEIGHT: f64 = 0.25;
/// The kernel is cut off at this many standard deviations.
const KERNEL_REACH: f64 = 3.0;
/// Less smoothing than this changes nothing, cells.
const LEAST_WIDTH: f64 = 0.25;
/// Rows smoothed at a time; limits the memory for their moments.
const BAND: usize = 64;

/// Smooths by local planes under a Gaussian of standard deviation `width` (in cells). Each cell gets the value of the plane
/// that best fits the heights around it, weighted by the Gaussian and, where `filled`, by ¼. Unlike a plain Gaussian
/// average it preserves planes, even at the border of the raster. A width below ¼ cell changes nothing.
///
/// `heights` must not contain NaN; `filled` has the same shape.
pub fn smooth(columns: usize, heights: &[f64], filled: &[bool], width: f64) -> Vec<f64> {
    let rows = heights.len() / columns;
    if width < LEAST_WIDTH {
        return heights.to_vec();
    }
    let reach = (KERNEL_REACH * width).ceil() as usize;
    let kernel: Vec<f64> =
        (0..=2 * reach).map(|k| (-0.5 * ((k as f64 - reach as f64) / width).powi(2)).exp()).collect();
    let mut result = Vec::with_capacity(heights.len());
    let mut sums = vec![[0.0; 9]; columns];
    for band in (0..rows).step_by(BAND) {
        let first = band.saturating_sub(reach);
        let last = (band + BAND + reach).min(rows);
        let moments: Vec<[f64; 5]> = (first..last)
            .flat_map(|row| {
                let row = row * columns..(row + 1) * columns;
                row_moments(&heights[row.clone()], &filled[row], &kernel)
            })
            .collect();
        for row in band..(band + BAND).min(rows) {
            sums.fill([0.0; 9]);
            for r in row.saturating_sub(reach)..(row + reach + 1).min(rows) {
                let dy = r as f64 - row as f64;
                let k = kernel[r + reach - row];
                let moments = &moments[(r - first) * columns..(r - first + 1) * columns];
                for (sums, &[m, mx, mxx, z, zx]) in sums.iter_mut().zip(moments) {
                    let terms = [m, mx, m * dy, mxx, mx * dy, m * dy * dy, z, zx, z * dy];
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        *sum += k * term;
                    }
                }
            }
            result.extend(sums.iter().map(|sums| plane_value(*sums)));
        }
    }
    result
}

/// Σ w, Σ w dx, Σ w dx², Σ w z, Σ w z dx along a row of cells through each of them, with dx in cells from it.
fn row_moments(heights: &[f64], filled: &[bool], kernel: &[f64]) -> Vec<[f64; 5]> {
    let (reach, columns) = (kernel.len() / 2, heights.len());
    let mut moments = vec![[0.0; 5]; columns];
    // As far as there are two cells of the row at such a distance.
    for n in reach.saturating_sub(columns - 1)..kernel.len().min(reach + columns) {
        let dx = n as f64 - reach as f64;
        let middles = reach.saturating_sub(n)..columns.min(columns + reach - n);
        let start = n.saturating_sub(reach);
        for ((sums, z), filled) in moments[middles].iter_mut().zip(&heights[start..]).zip(&filled[start..]) {
            let w = kernel[n] * if *filled { FILLED_WEIGHT } else { 1.0 };
            for (sum, term) in sums.iter_mut().zip([1.0, dx, dx * dx, *z, z * dx]) {
                *sum += w * term;
            }
        }
    }
    moments
}

/// a of the weighted least-squares plane a + b dx + c dy, from Σw·(1, x, y, x², xy, y², z, zx, zy): eliminating b and c
/// from the normal equations leaves a = (Σz − p Σzx − q Σzy)/(Σ1 − p Σx − q Σy) with [Σx² Σxy; Σxy Σy²](p, q) = (Σx, Σy).
fn plane_value([s, sx, sy, sxx, sxy, syy, z, zx, zy]: [f64; 9]) -> f64 {
    let det = sxx * syy - sxy * sxy;
    let p = (syy * sx - sxy * sy) / det;
    let q = (sxx * sy - sxy * sx) / det;
    (z - p * zx - q * zy) / (s - p * sx - q * sy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raster(columns: usize, rows: usize, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        (0..columns * rows).map(|i| f((i % columns) as f64, (i / columns) as f64)).collect()
    }

    #[test]
    fn smoothing_leaves_planes_alone_up_to_the_border_and_beside_holes() {
        let plane = raster(150, 70, |x, y| 0.03 * x + 0.01 * y);
        let filled: Vec<bool> = (0..plane.len()).map(|i| i % 7 == 0 || i % 150 > 100).collect();
        for width in [0.3, 1.5, 6.0] {
            for (a, b) in smooth(150, &plane, &filled, width).iter().zip(&plane) {
                assert!((a - b).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn smoothing_is_a_gaussian_average_inside() {
        let mut spike = vec![0.0; 41 * 41];
        spike[20 * 41 + 20] = 1.0;
        let smoothed = smooth(41, &spike, &[false; 41 * 41], 2.0);
        let sum: f64 = (-6..=6).map(|k| (-0.125 * (k * k) as f64).exp()).sum();
        for (column, row) in [(20, 20), (22, 20), (17, 24)] {
            let (dx, dy) = (column as f64 - 20.0, row as f64 - 20.0);
            let expected = (-0.125 * (dx * dx + dy * dy)).exp() / (sum * sum);
            assert!((smoothed[row * 41 + column] - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn too_little_smoothing_changes_nothing() {
        let heights = raster(8, 8, |x, y| x * y % 3.0);
        assert_eq!(smooth(8, &heights, &[false; 64], 0.2), heights);
    }
}
