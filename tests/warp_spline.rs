//! φ, its derivatives and its inverse on a curved map, inside and outside its box.

use warpgait::heightfield::Heightfield;
use warpgait::scenario::{MapMethod, MapSpec};
use warpgait::warp::{Order, WarpMap};

/// An injective map that is curved along all axes and in all components: waves are added to the control points of the identity.
fn curved() -> WarpMap {
    let spec = MapSpec { method: MapMethod::Shear, cells: Some([12, 10, 6]), ..MapSpec::default() };
    let mut grid = WarpMap::flat([-3.0, 3.0, -2.0, 3.0], &spec).unwrap().to_grid();
    for p in &mut grid.control_points {
        let [x, y, z] = *p;
        p[0] += 0.20 * (1.1 * y + 0.3).sin() * (0.7 * z).cos() + 0.05 * (1.3 * x).sin();
        p[1] += 0.15 * (1.3 * x - 0.2).cos() * (0.5 * z + 0.1).cos();
        p[2] += 0.30 * (1.2 * x).sin() * (0.9 * y).cos() * (-0.3 * z).exp();
    }
    WarpMap::from_grid(&grid).unwrap()
}

/// Pseudo-random points in the box enlarged on all sides by the fraction `margin` of its size.
fn points(map: &WarpMap, margin: f64, count: usize) -> Vec<[f64; 3]> {
    let mut state = 7_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (origin, size) = (map.origin(), map.size());
    (0..count)
        .map(|_| std::array::from_fn(|d| origin[d] + size[d] * (uniform() * (1.0 + 2.0 * margin) - margin)))
        .collect()
}

fn moved(x: [f64; 3], d: usize, step: f64) -> [f64; 3] {
    let mut y = x;
    y[d] += step;
    y
}

#[test]
fn derivatives_match_central_differences_inside_and_outside() {
    let map = curved();
    let step = 1e-5;
    for margin in [0.0, 0.4] {
        for x in points(&map, margin, 400) {
            // The third derivative jumps at knots; keep away from them.
            let clear = (0..3).all(|d| {
                let s = (x[d] - map.origin()[d]) / map.cell()[d];
                (s - s.round()).abs() > 1e-3
            });
            if !clear {
                continue;
            }
            let jet = map.jet(x, Order::Third);
            assert_eq!(jet.position, map.position(x));
            for d in 0..3 {
                let ahead = map.jet(moved(x, d, step), Order::Third);
                let behind = map.jet(moved(x, d, -step), Order::Third);
                let slope = |a: f64, b: f64| (a - b) / (2.0 * step);
                for c in 0..3 {
                    let first = slope(ahead.position[c], behind.position[c]);
                    assert!((first - jet.jacobian[c][d]).abs() < 1e-8, "J[{c}][{d}] at {x:?}");
                    for e in 0..3 {
                        let second = slope(ahead.jacobian[c][e], behind.jacobian[c][e]);
                        assert!(
                            (second - jet.jacobian_derivative(d)[c][e]).abs() < 1e-7,
                            "∂J[{c}][{e}]/∂{d} at {x:?}"
                        );
                        for f in 0..3 {
                            let third = slope(
                                ahead.jacobian_derivative(e)[c][f],
                                behind.jacobian_derivative(e)[c][f],
                            );
                            let exact = jet.jacobian_second_derivative(d, e)[c][f];
                            assert!(
                                (third - exact).abs() < 1e-6,
                                "∂²J[{c}][{f}]/∂{d}∂{e} at {x:?}: {third} {exact}"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn lower_orders_agree_with_the_full_jet_and_the_rest_is_zero() {
    let map = curved();
    for x in points(&map, 0.3, 50) {
        let full = map.jet(x, Order::Third);
        let second = map.jet(x, Order::Second);
        let first = map.jet(x, Order::First);
        assert_eq!((first.position, first.jacobian), (full.position, full.jacobian));
        assert_eq!((second.jacobian, second.second), (full.jacobian, full.second));
        assert_eq!(first.second, [[0.0; 6]; 3]);
        assert_eq!(second.third, [[0.0; 10]; 3]);
    }
}

#[test]
fn second_derivatives_are_continuous_across_the_faces() {
    let map = curved();
    let (origin, size) = (map.origin(), map.size());
    for x in points(&map, 0.2, 50) {
        for d in 0..3 {
            for face in [
                origin[d],
                origin[d] + size[d],
                origin[d] - map.cell()[d],
                origin[d] + size[d] + map.cell()[d],
            ] {
                let mut inner = x;
                let mut outer = x;
                inner[d] = face - 1e-9;
                outer[d] = face + 1e-9;
                let (a, b) = (map.jet(inner, Order::Second), map.jet(outer, Order::Second));
                for c in 0..3 {
                    for s in 0..6 {
                        assert!((a.second[c][s] - b.second[c][s]).abs() < 1e-6, "{c} {s} at {inner:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_flat_map_is_the_identity_everywhere() {
    let spec = MapSpec { cells: Some([9, 7, 5]), ..MapSpec::default() };
    let map = WarpMap::flat([-1.0, 2.0, -3.0, 3.0], &spec).unwrap();
    for x in points(&map, 0.8, 200) {
        let jet = map.jet(x, Order::Third);
        for c in 0..3 {
            assert!((jet.position[c] - x[c]).abs() < 1e-12);
            for d in 0..3 {
                assert!((jet.jacobian[c][d] - f64::from(u8::from(c == d))).abs() < 1e-11);
            }
            assert!(jet.second[c].iter().all(|v| v.abs() < 1e-9));
            assert!(jet.third[c].iter().all(|v| v.abs() < 1e-7));
        }
    }
}

#[test]
fn inverse_round_trips_inside_and_outside() {
    let map = curved();
    for x in points(&map, 0.25, 400) {
        let back = map.inverse(map.position(x)).unwrap();
        for d in 0..3 {
            assert!((back[d] - x[d]).abs() < 1e-9, "{x:?} came back as {back:?}");
        }
        let p = map.position([x[0], x[1], 0.0]);
        let ground = map.ground_inverse([p[0], p[1]]).unwrap();
        assert!((ground[0] - x[0]).abs() < 1e-9 && (ground[1] - x[1]).abs() < 1e-9);
    }
}

#[test]
fn points_far_outside_have_no_inverse() {
    let map = curved();
    for p in [[50.0, 0.0, 0.5], [0.0, f64::NAN, 0.0], [0.0, 0.0, -40.0]] {
        let message = map.inverse(p).unwrap_err().to_string();
        assert!(message.contains("far outside"), "{message}");
    }
    assert!(map.ground_inverse([0.0, 40.0]).is_err());
}

#[test]
fn stored_maps_are_restored_and_broken_ones_rejected() {
    let map = curved();
    let grid = map.to_grid();
    let back = WarpMap::from_grid(&grid).unwrap();
    let x = [0.1, -0.7, 1.2];
    for c in 0..3 {
        assert!((back.position(x)[c] - map.position(x)[c]).abs() < 1e-12);
    }
    let mut short = grid.clone();
    short.control_points.pop();
    assert!(WarpMap::from_grid(&short).unwrap_err().to_string().contains("control points"));
    let mut graded = grid.clone();
    graded.knots[2][5] += 0.01;
    assert!(WarpMap::from_grid(&graded).unwrap_err().to_string().contains("knot 5 along z"));
    let mut broken = grid;
    broken.control_points[3][1] = f64::NAN;
    assert!(WarpMap::from_grid(&broken).unwrap_err().to_string().contains("not finite"));
}

#[test]
fn the_shear_is_on_the_ground() {
    let height = |x: f64, y: f64| 0.15 * (2.6 * x).sin() * (2.6 * y).sin() + 0.1 * x;
    let field = Heightfield::from_function([-3.0, 3.0, -2.0, 2.0], 0.02, |x, y| Ok(height(x, y))).unwrap();
    let map = WarpMap::shear(&field, &MapSpec::default()).unwrap();
    for x in points(&map, 0.0, 300) {
        let p = map.position(x);
        assert!((p[0] - x[0]).abs() < 1e-12 && (p[1] - x[1]).abs() < 1e-12);
        assert!((p[2] - x[2] - height(x[0], x[1])).abs() < 1e-4, "{x:?} {p:?}");
    }
}
