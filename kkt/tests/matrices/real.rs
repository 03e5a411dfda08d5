//! Matrices from solves of gaits, as Ipopt gave them to the plug, rounded to single precision: `scenarios/rubble.toml` with `anymal_towr`, exact Hessian, and
//! `scenarios/pit.toml` with the joints of `anymal_c`, limited memory; both with `horizon = 1.4`, `time_step = 0.1`, `gait.cycle = 0.8`.
//!
//! A file has little-endian numbers: `u32` variables, inequalities, equations, entries, matrices; `u16` row and column of each entry, from 0; `f32`
//! values of each entry, matrix after matrix.

use super::common::{Matrix, Random};
use kkt::Factored;

/// Of each file the layout and the matrices.
fn read(bytes: &[u8]) -> Vec<Matrix> {
    let word = |k: usize| u32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap()) as usize;
    let [variables, inequalities, equations, entries, count] = [0, 1, 2, 3, 4].map(word);
    let index = |k: usize| u32::from(u16::from_le_bytes(bytes[20 + 2 * k..22 + 2 * k].try_into().unwrap()));
    let values = &bytes[20 + 4 * entries..];
    let value = |k: usize| f64::from(f32::from_le_bytes(values[4 * k..4 * k + 4].try_into().unwrap()));
    assert_eq!(values.len(), 4 * entries * count);
    let mut matrix = Matrix::new(variables, inequalities, equations);
    matrix.rows = (0..entries).map(|k| index(2 * k)).collect();
    matrix.columns = (0..entries).map(|k| index(2 * k + 1)).collect();
    let values = |number: usize| (0..entries).map(|k| value(number * entries + k)).collect();
    (0..count).map(|number| Matrix { values: values(number), ..matrix.clone() }).collect()
}

/// All are regular, and called so; everything is condensed; some have the wrong inertia, for Ipopt to correct.
#[test]
fn matrices_of_real_solves() {
    let mut random = Random(1);
    let mut wrong = 0;
    for bytes in [&include_bytes!("../data/rubble.bin")[..], &include_bytes!("../data/joints.bin")[..]] {
        let matrices = read(bytes);
        let mut kkt = matrices[0].kkt();
        let layout = matrices[0].layout;
        assert_eq!(kkt.num_condensed(), layout.inequalities);
        for matrix in &matrices {
            let (ratio, negative) = matrix.check_inertia(&mut kkt);
            assert!(ratio > 1e-14, "the eigenvalues decide");
            let negative = negative.expect("regular");
            wrong += usize::from(negative != layout.inequalities + layout.equations);
            assert!(matrix.check_solve(&mut kkt, &mut random) <= 1e-12);
            assert_eq!(kkt.factor(&matrix.values), Factored::Regular { negative }, "the same again");
        }
    }
    assert!(wrong > 0, "a matrix that Ipopt has to correct is among them");
}
