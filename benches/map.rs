//! The warp map φ: its evaluation, which is the inner loop of the NLP, and its construction.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::ops::ControlFlow;
use warpgait::heightfield::Heightfield;
use warpgait::scenario::MapSpec;
use warpgait::warp::{Order, WarpMap, build};

fn evaluation(criterion: &mut Criterion) {
    let height = |x: f64, y: f64| 0.15 * (2.6 * x).sin() * (2.6 * y).sin();
    let field = Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.02, |x, y| Ok(height(x, y)))
        .expect("a valid terrain");
    let map = WarpMap::shear(&field, &MapSpec::default()).expect("a valid map");
    // Points along a line, like those of a motion.
    let points: Vec<[f64; 3]> =
        (0..256).map(|i| f64::from(i) / 256.0).map(|t| [4.0 * t - 2.0, 3.0 * t - 1.5, 0.5 * t]).collect();
    let mut at = 0;
    let mut next = move || {
        at = (at + 1) % points.len();
        points[at]
    };
    criterion.bench_function("position", |b| b.iter(|| map.position(black_box(next()))));
    for order in [Order::First, Order::Second, Order::Third] {
        criterion.bench_function(&format!("jet {order:?}"), |b| b.iter(|| map.jet(black_box(next()), order)));
    }
    criterion.bench_function("inverse", |b| b.iter(|| map.inverse(map.position(black_box(next())))));
}

fn building(criterion: &mut Criterion) {
    let k = std::f64::consts::TAU / 2.4;
    let height = |x: f64, y: f64| Ok(0.15 * (k * x).sin() * (k * y).sin());
    let field = Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.02, height).expect("a valid terrain");
    let mut group = criterion.benchmark_group("build");
    group.sample_size(10);
    group.bench_function("rippled, medium", |b| {
        b.iter(|| build(&field, &MapSpec::default(), &mut |_| ControlFlow::Continue(())))
    });
}

criterion_group!(benches, evaluation, building);
criterion_main!(benches);
