//! Evaluation of φ, the inner loop of the NLP, and building it: `cargo bench --bench map`.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use warpgait::heightfield::Heightfield;
use warpgait::scenario::MapSpec;
use warpgait::warp::{Order, WarpMap, build};

fn main() {
    evaluation();
    building();
}

fn evaluation() {
    let height = |x: f64, y: f64| 0.15 * (2.6 * x).sin() * (2.6 * y).sin();
    let field = Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.02, |x, y| Ok(height(x, y)))
        .expect("a valid terrain");
    let map = WarpMap::shear(&field, &MapSpec::default()).expect("a valid map");
    // Points along a line, as a motion visits them.
    let points: Vec<[f64; 3]> =
        (0..256).map(|i| f64::from(i) / 256.0).map(|t| [4.0 * t - 2.0, 3.0 * t - 1.5, 0.5 * t]).collect();
    let mut at = 0;
    let mut next = move || {
        at = (at + 1) % points.len();
        points[at]
    };
    measure("position", 100_000, || map.position(black_box(next())));
    for order in [Order::First, Order::Second, Order::Third] {
        measure(&format!("jet {order:?}"), 100_000, || map.jet(black_box(next()), order));
    }
    measure("inverse", 10_000, || map.inverse(map.position(black_box(next()))));
}

fn building() {
    let k = std::f64::consts::TAU / 2.4;
    let height = |x: f64, y: f64| Ok(0.15 * (k * x).sin() * (k * y).sin());
    let field = Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.02, height).expect("a valid terrain");
    measure("build of rippled, medium", 1, || {
        build(&field, &MapSpec::default(), &mut |_| ControlFlow::Continue(()))
    });
}

/// Prints how long one call takes: least, median and greatest of 20 samples, each the mean of `calls` calls.
fn measure<T>(name: &str, calls: u32, mut call: impl FnMut() -> T) {
    let mut sample = || {
        let start = Instant::now();
        for _ in 0..calls {
            black_box(call());
        }
        start.elapsed() / calls
    };
    sample(); // a first one, to warm up
    let mut samples: Vec<Duration> = (0..20).map(|_| sample()).collect();
    samples.sort();
    println!("{name:<26}{:>12.2?}{:>12.2?}{:>12.2?}", samples[0], samples[10], samples[19]);
}
