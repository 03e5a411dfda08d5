use super::*;

/// A small deterministic generator of numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

fn rough() -> Heightfield {
    let mut random = Random(7);
    let samples: Vec<f64> = (0..9 * 7).map(|_| random.between(-0.3, 0.3)).collect();
    Heightfield::interpolate([-0.7, 0.2], [0.11, 0.17], 9, 7, &samples).unwrap()
}

#[test]
fn interpolates_its_samples() {
    let field = rough();
    let grid = *field.grid();
    for row in 0..grid.rows {
        for column in 0..grid.columns {
            let h = field.height(grid.x(column), grid.y(row));
            assert!((h - field.samples()[row * grid.columns + column]).abs() < 1e-14);
        }
    }
}

#[test]
fn reproduces_bicubic_polynomials_up_to_the_ends() {
    let f = |x: f64, y: f64| (1.0 - 2.0 * x + 0.5 * x * x * x) * (0.3 + y - y * y + 0.7 * y * y * y);
    for (columns, rows) in [(4, 4), (4, 9), (5, 4), (12, 6)] {
        let (dx, dy) = (1.0 / (columns - 1) as f64, 2.0 / (rows - 1) as f64);
        let samples: Vec<f64> = (0..columns * rows)
            .map(|i| f((i % columns) as f64 * dx, -1.0 + (i / columns) as f64 * dy))
            .collect();
        let field = Heightfield::interpolate([0.0, -1.0], [dx, dy], columns, rows, &samples).unwrap();
        let mut random = Random(3);
        for _ in 0..200 {
            let (x, y) = (random.between(0.0, 1.0), random.between(-1.0, 1.0));
            assert!((field.height(x, y) - f(x, y)).abs() < 1e-12, "{columns} x {rows} at {x}, {y}");
        }
        let jet = field.jet(0.4, 0.3);
        let b = 0.3 + 0.3 - 0.09 + 0.7 * 0.027;
        assert!((jet.d3[0] - 3.0 * b).abs() < 1e-9);
        assert!((jet.d2[1] - (-2.0 + 1.5 * 0.16) * (1.0 - 0.6 + 2.1 * 0.09)).abs() < 1e-10);
    }
}

#[test]
fn interpolation_error_is_of_fourth_order() {
    let f = |x: f64, y: f64| (2.0 * x).sin() * (1.5 * y).cos();
    let error = |spacing: f64| {
        let field = Heightfield::from_function([-1.0, 1.0, -1.0, 1.0], spacing, |x, y| Ok(f(x, y))).unwrap();
        let mut random = Random(11);
        (0..2000)
            .map(|_| (random.between(-1.0, 1.0), random.between(-1.0, 1.0)))
            .map(|(x, y)| (field.height(x, y) - f(x, y)).abs())
            .fold(0.0, f64::max)
    };
    let ratio = error(0.1) / error(0.05);
    assert!(ratio > 12.0, "halving the spacing divides the error by {ratio}, not by about 16");
}

/// Points inside, beyond each side, in the corners, in the fading bands and far away.
fn points(field: &Heightfield, count: usize) -> Vec<(f64, f64)> {
    let [x_min, x_max, y_min, y_max] = field.extent();
    let mut random = Random(5);
    (0..count)
        .map(|_| (random.between(x_min - 0.8, x_max + 0.8), random.between(y_min - 0.8, y_max + 0.8)))
        .collect()
}

/// Whether a step of ±`step` from v meets a place where the third derivative jumps along this axis.
fn meets_a_knot(v: f64, step: f64, origin: f64, spacing: f64, count: usize) -> bool {
    let end = origin + spacing * (count - 1) as f64;
    let fades = [CURVATURE_FADE, SLOPE_FADE].into_iter().flat_map(|l| [origin - l, end + l]);
    (0..count).map(|i| origin + spacing * i as f64).chain(fades).any(|k| (v - k).abs() < 2.0 * step)
}

#[test]
fn derivatives_agree_with_central_differences_everywhere() {
    let field = rough();
    let grid = *field.grid();
    let step = 1e-5;
    let mut compared = 0;
    for (x, y) in points(&field, 4000) {
        let near = meets_a_knot(x, step, grid.origin[0], grid.spacing[0], grid.columns)
            || meets_a_knot(y, step, grid.origin[1], grid.spacing[1], grid.rows);
        if near {
            continue;
        }
        compared += 1;
        let jet = field.jet(x, y);
        let [e, w, n, s] =
            [field.jet(x + step, y), field.jet(x - step, y), field.jet(x, y + step), field.jet(x, y - step)];
        let slope = |a: f64, b: f64| (a - b) / (2.0 * step);
        let pairs = [
            (jet.d1[0], slope(e.h, w.h)),
            (jet.d1[1], slope(n.h, s.h)),
            (jet.d2[0], slope(e.d1[0], w.d1[0])),
            (jet.d2[1], slope(n.d1[0], s.d1[0])),
            (jet.d2[1], slope(e.d1[1], w.d1[1])),
            (jet.d2[2], slope(n.d1[1], s.d1[1])),
            (jet.d3[0], slope(e.d2[0], w.d2[0])),
            (jet.d3[1], slope(n.d2[0], s.d2[0])),
            (jet.d3[1], slope(e.d2[1], w.d2[1])),
            (jet.d3[2], slope(n.d2[1], s.d2[1])),
            (jet.d3[2], slope(e.d2[2], w.d2[2])),
            (jet.d3[3], slope(n.d2[2], s.d2[2])),
        ];
        for (k, (exact, difference)) in pairs.into_iter().enumerate() {
            // Relative to the size that derivatives of this order have here: 0.6 m over powers of 0.11 m.
            let order = 1 + (k >= 2) as i32 + (k >= 6) as i32;
            let tolerance = 1e-6 * 0.6 / 0.11_f64.powi(order);
            assert!(
                (exact - difference).abs() < tolerance,
                "pair {k} at {x}, {y}: {exact} against {difference}"
            );
        }
        assert_eq!(field.height(x, y), jet.h);
        assert_eq!(field.gradient(x, y), jet.d1);
    }
    assert!(compared > 3000, "{compared}");
}

#[test]
fn value_gradient_and_hessian_are_continuous_across_every_knot_and_the_border() {
    let field = rough();
    let grid = *field.grid();
    let [x_min, x_max, y_min, y_max] = field.extent();
    let mut xs: Vec<f64> = (0..grid.columns).map(|i| grid.x(i)).collect();
    xs.extend([x_min - CURVATURE_FADE, x_max + CURVATURE_FADE, x_min - SLOPE_FADE, x_max + SLOPE_FADE]);
    let mut ys: Vec<f64> = (0..grid.rows).map(|i| grid.y(i)).collect();
    ys.extend([y_min - CURVATURE_FADE, y_max + CURVATURE_FADE, y_min - SLOPE_FADE, y_max + SLOPE_FADE]);
    let step = 1e-9;
    let close = |a: HeightJet, b: HeightJet, place: (f64, f64)| {
        let all = |j: HeightJet| [j.h, j.d1[0], j.d1[1], j.d2[0], j.d2[1], j.d2[2]];
        for (u, v) in all(a).into_iter().zip(all(b)) {
            assert!((u - v).abs() < 1e-4, "jump at {place:?}: {u} against {v}");
        }
    };
    for (x, y) in points(&field, 60) {
        for k in &xs {
            close(field.jet(k - step, y), field.jet(k + step, y), (*k, y));
        }
        for k in &ys {
            close(field.jet(x, k - step), field.jet(x, k + step), (x, *k));
        }
    }
}

#[test]
fn the_extension_is_tame_and_finite() {
    // A plane of slope 1 leaves its rectangle and levels out half a fading length higher.
    let plane = Heightfield::from_function([0.0, 1.0, 0.0, 1.0], 0.1, |x, _| Ok(x)).unwrap();
    assert!((plane.height(50.0, 0.5) - (1.0 + 0.5 * SLOPE_FADE)).abs() < 1e-12);
    assert!((plane.height(-50.0, 0.5) + 0.5 * SLOPE_FADE).abs() < 1e-12);
    let field = rough();
    for v in [-1e300, -1e6, -3.0, 0.3, 3.0, 1e6, 1e300, f64::INFINITY, f64::NEG_INFINITY] {
        for (x, y) in [(v, 0.5), (0.0, v), (v, v), (v, -v)] {
            let jet = field.jet(x, y);
            assert!(jet.h.is_finite() && jet.d3.iter().all(|d| d.is_finite()));
        }
    }
    assert_eq!(field.jet(-9.0, 9.0).d1, [0.0, 0.0]);
    assert!(field.height(f64::NAN, 0.0).is_nan());
}

#[test]
fn normals_are_upward_units_orthogonal_to_the_ground() {
    let field = rough();
    for (x, y) in points(&field, 100) {
        let [hx, hy] = field.gradient(x, y);
        let n = field.normal(x, y);
        assert!((n.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-14 && n[2] > 0.0);
        assert!((n[0] + hx * n[2]).abs() < 1e-13 && (n[1] + hy * n[2]).abs() < 1e-13);
    }
}

#[test]
fn grids_hit_the_extent_exactly() {
    for (extent, spacing) in [([-3.0, 3.0, -3.0, 3.0], 0.01), ([-0.1, 1.23, 4.0, 4.7], 0.03)] {
        let grid = Grid::fitted(extent, spacing).unwrap();
        for (a, b) in grid.extent().into_iter().zip(extent) {
            assert!((a - b).abs() < 1e-12);
        }
        assert!(grid.spacing.iter().all(|s| *s <= spacing * (1.0 + 1e-6) && *s > 0.9 * spacing));
    }
    assert_eq!(Grid::fitted([-3.0, 3.0, -3.0, 3.0], 0.01).unwrap().columns, 601);
    assert_eq!(Grid::fitted([0.0, 1.0, 0.0, 1.0], 5.0).unwrap().rows, 4);
}

#[test]
fn crossings_of_lines_have_the_values_of_their_places() {
    let field = rough();
    let [mut xs, ys] = field.grid().lines_between();
    assert_eq!((xs.len(), ys.len()), (8, 6));
    assert!((xs[0] + 0.645).abs() < 1e-12 && (ys[5] - 1.135).abs() < 1e-12);
    // Also beyond the ends.
    xs.extend([-1.0, 0.5]);
    let mut visited = Vec::new();
    field.for_each_crossing(&xs, &ys, |place, h, gradient| visited.push((place, h, gradient)));
    let places: Vec<[f64; 2]> = ys.iter().flat_map(|&y| xs.iter().map(move |&x| [x, y])).collect();
    assert_eq!(visited.len(), places.len());
    for ((place, h, gradient), [x, y]) in visited.into_iter().zip(places) {
        assert_eq!((place, (h, gradient)), ([x, y], field.height_and_gradient(x, y)));
    }
}

#[test]
fn bad_grids_are_refused() {
    let message = |r: Result<Heightfield>| r.unwrap_err().to_string();
    let flat = |extent, spacing| message(Heightfield::from_function(extent, spacing, |_, _| Ok(0.0)));
    assert!(flat([1.0, 1.0, 0.0, 1.0], 0.1).contains("not a rectangle"));
    assert!(flat([0.0, f64::NAN, 0.0, 1.0], 0.1).contains("not a rectangle"));
    assert!(flat([0.0, f64::INFINITY, 0.0, 1.0], 0.1).contains("not a rectangle"));
    assert!(flat([0.0, 1.0, 0.0, 1.0], 0.0).contains("positive"));
    assert!(flat([0.0, 1.0, 0.0, 1.0], f64::NAN).contains("positive"));
    assert!(flat([0.0, 1e5, 0.0, 1e5], 0.01).contains("at least"));
    assert!(flat([0.0, 1.0, 0.0, 1.0], 1e-300).contains("at least"));
    assert!(flat([1e5, 1e5 + 1e-9, 0.0, 1.0], 0.1).contains("too narrow"));
    let grid = |columns, rows, samples: &[f64]| {
        message(Heightfield::interpolate([0.0; 2], [0.1; 2], columns, rows, samples))
    };
    assert!(grid(3, 4, &[0.0; 12]).contains("at least 4 x 4"));
    assert!(grid(4, 4, &[0.0; 15]).contains("15 heights"));
    assert!(grid(usize::MAX, 4, &[]).contains("too large"));
    let mut samples = [0.0; 20];
    samples[7] = f64::NAN;
    assert!(grid(5, 4, &samples).contains("x = 0.2000, y = 0.1000 is NaN"));
    samples[7] = 1e9;
    assert!(grid(5, 4, &samples).contains("within"));
}
