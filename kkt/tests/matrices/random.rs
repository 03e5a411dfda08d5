//! Random saddle-point matrices of every kind against dense eigenvalues.

use super::common::{Matrix, Random};
use kkt::{Error, Factored, Kkt, Layout};

/// What to make of the parts of a matrix.
#[derive(Clone, Copy, Debug)]
struct Kind {
    /// Diagonal of H: its typical size and whether signs are random.
    diagonal: (f64, bool),
    /// Which fraction of the diagonal of H is zero.
    zeros: f64,
    /// Entries off the diagonal of H.
    coupling: f64,
    /// The slacks' diagonal spans 10^±this.
    spread: f64,
    /// δ_c and δ_d.
    perturbation: f64,
    /// Every third equation is the sum of its two predecessors.
    dependent: bool,
}

const CONVEX: Kind = Kind {
    diagonal: (1.0, false),
    zeros: 0.0,
    coupling: 0.1,
    spread: 1.0,
    perturbation: 0.0,
    dependent: false,
};

const KINDS: [Kind; 12] = [
    CONVEX,
    Kind { diagonal: (1.0, true), coupling: 1.0, ..CONVEX },
    Kind { zeros: 0.5, ..CONVEX },
    Kind { zeros: 1.0, coupling: 0.0, ..CONVEX },
    Kind { zeros: 1.0, coupling: 1.0, ..CONVEX },
    Kind { diagonal: (1e-12, false), coupling: 0.0, ..CONVEX },
    Kind { diagonal: (1e-6, true), coupling: 1e-6, ..CONVEX },
    Kind { spread: 8.0, ..CONVEX },
    Kind { spread: 8.0, perturbation: 1e-9, dependent: true, ..CONVEX },
    Kind { perturbation: 1e-8, ..CONVEX },
    Kind { diagonal: (1.0, true), coupling: 1.0, perturbation: 1e-10, dependent: true, ..CONVEX },
    Kind { dependent: true, ..CONVEX },
];

fn matrix(n: usize, inequalities: usize, equations: usize, kind: Kind, random: &mut Random) -> Matrix {
    let mut matrix = Matrix::new(n, inequalities, equations);
    for i in 0..n {
        let size = kind.diagonal.0 * (1.0 + random.number().abs());
        let zero = random.number().abs() < kind.zeros;
        let sign = if kind.diagonal.1 && random.number() < 0.0 { -1.0 } else { 1.0 };
        matrix.add(i, i, if zero { 0.0 } else { sign * size });
        if i > 0 && kind.coupling > 0.0 {
            let (value, j) = (kind.coupling * random.number(), random.below(i));
            // Ipopt's triangle, or the other one.
            if random.bits().is_multiple_of(2) { matrix.add(i, j, value) } else { matrix.add(j, i, value) }
        }
    }
    let mut rows: Vec<Vec<(usize, f64)>> = Vec::new();
    for k in 0..equations {
        let row = if kind.dependent && k % 3 == 2 {
            [rows[k - 1].clone(), rows[k - 2].clone()].concat()
        } else {
            (0..3.min(n)).map(|_| (random.below(n), random.number())).chain([(k % n, 2.0)]).collect()
        };
        row.iter().for_each(|&(j, value)| matrix.add(matrix.equation(k), j, value));
        matrix.add(matrix.equation(k), matrix.equation(k), -kind.perturbation);
        rows.push(row);
    }
    for k in 0..inequalities {
        let sigma = 10f64.powf(kind.spread * random.number());
        matrix.add(matrix.slack(k), matrix.slack(k), sigma);
        matrix.add(matrix.multiplier(k), matrix.slack(k), -1.0);
        // Neighbors share their variables, as the rows of one constraint do.
        for t in 0..4.min(n) {
            matrix.add(matrix.multiplier(k), (k / 3 * 5 + t) % n, random.number());
        }
        matrix.add(matrix.multiplier(k), matrix.multiplier(k), -kind.perturbation);
    }
    matrix
}

/// The inertia is that of the eigenvalues or the matrix is called singular; solutions are exact to 1e-12 or said not to be. Well-conditioned matrices of
/// Ipopt's kind are never called singular.
#[test]
fn inertia_and_solutions_are_right() {
    let mut random = Random(1);
    for (number, kind) in KINDS.into_iter().enumerate() {
        let (mut regular, mut well, mut missed) = (0, 0, 0);
        for sample in 0..60 {
            let n = 1 + random.below(if sample < 40 { 12 } else { 60 });
            let equations = random.below(n / 2 + 1);
            let inequalities = random.below(2 * n);
            let matrix = matrix(n, inequalities, equations, kind, &mut random);
            let mut kkt = matrix.kkt();
            assert_eq!(kkt.num_condensed(), inequalities);
            let (ratio, negative) = matrix.check_inertia(&mut kkt);
            regular += usize::from(negative.is_some());
            well += usize::from(ratio > 1e-6);
            missed += usize::from(ratio > 1e-6 && negative.is_none());
            if negative.is_some() {
                matrix.check_solve(&mut kkt, &mut random);
            }
        }
        println!(
            "kind {number}: {regular} of 60 regular, {well} well-conditioned, of which {missed} called singular"
        );
        assert!(
            20 * missed <= well,
            "kind {number}: {missed} of {well} well-conditioned ones called singular"
        );
    }
}

/// Any pattern, any values: nothing that an interior-point method would make.
#[test]
fn arbitrary_matrices_are_right_too() {
    let mut random = Random(2);
    let mut regular = 0;
    for _ in 0..300 {
        let mut matrix = Matrix::new(1 + random.below(10), random.below(8), random.below(6));
        let n = matrix.dimension();
        for _ in 0..1 + random.below(3 * n) {
            let size = 10f64.powf(6.0 * random.number());
            matrix.add(random.below(n), random.below(n), size * random.number());
        }
        let mut kkt = matrix.kkt();
        if matrix.check_inertia(&mut kkt).1.is_some() {
            regular += 1;
            matrix.check_solve(&mut kkt, &mut random);
        }
    }
    println!("{regular} of 300 regular");
}

/// Dependent equations make the matrix singular, and it is called so; a perturbation of Ipopt's size repairs it.
#[test]
fn dependent_equations_are_singular_until_perturbed() {
    let mut random = Random(3);
    for _ in 0..50 {
        let (n, equations) = (6 + random.below(40), 3 + random.below(3));
        let kind = Kind { dependent: true, ..CONVEX };
        let singular = matrix(n, 5, equations, kind, &mut random);
        let mut kkt = singular.kkt();
        assert_eq!(kkt.factor(&singular.values), Factored::Singular);
        for perturbation in [1e-8, 1e-9, 5e-11] {
            let mut perturbed = singular.clone();
            for k in 0..equations {
                perturbed.add(perturbed.equation(k), perturbed.equation(k), -perturbation);
            }
            let mut kkt = perturbed.kkt();
            assert_eq!(kkt.factor(&perturbed.values), Factored::Regular { negative: 5 + equations });
            perturbed.check_solve(&mut kkt, &mut random);
        }
    }
}

/// More equations than variables; and a matrix of zeros.
#[test]
fn structurally_singular_matrices_are_called_so() {
    let mut random = Random(4);
    let matrix = matrix(3, 2, 5, CONVEX, &mut random);
    assert_eq!(matrix.kkt().factor(&matrix.values), Factored::Singular);
    let zeros = vec![0.0; matrix.values.len()];
    assert_eq!(matrix.kkt().factor(&zeros), Factored::Singular);
}

#[test]
fn one_by_one() {
    for (value, expected) in [
        (2.0, Factored::Regular { negative: 0 }),
        (-3.0, Factored::Regular { negative: 1 }),
        (1e-300, Factored::Singular),
        (0.0, Factored::Singular),
        (f64::NAN, Factored::Singular),
        (f64::INFINITY, Factored::Singular),
    ] {
        let mut kkt = Kkt::new(Layout { variables: 1, inequalities: 0, equations: 0 }, &[0], &[0]).unwrap();
        assert_eq!(kkt.factor(&[value]), expected, "{value}");
    }
    let mut kkt = Kkt::new(Layout { variables: 1, inequalities: 0, equations: 0 }, &[0], &[0]).unwrap();
    kkt.factor(&[4.0]);
    let mut x = [2.0];
    kkt.solve(&mut x);
    assert!((x[0] - 0.5).abs() < 1e-15);
}

/// Wrong inertia is what Ipopt corrects with δ_x: it must be counted, not repaired.
#[test]
fn negative_curvature_is_counted() {
    let mut random = Random(5);
    for negative in 0..10 {
        let mut matrix = Matrix::new(20, 10, 5);
        for i in 0..20 {
            matrix.add(i, i, if i >= 10 && i < 10 + negative { -1.0 } else { 2.0 });
        }
        // The equations and inequalities fix nothing of the variables 10 to 19.
        for k in 0..5 {
            matrix.add(matrix.equation(k), k, 1.0 + random.number().abs());
        }
        for k in 0..10 {
            matrix.add(matrix.slack(k), matrix.slack(k), 0.5);
            matrix.add(matrix.multiplier(k), matrix.slack(k), -1.0);
            matrix.add(matrix.multiplier(k), k, random.number());
        }
        let mut kkt = matrix.kkt();
        assert_eq!(kkt.factor(&matrix.values), Factored::Regular { negative: 15 + negative });
    }
}

/// A pattern that contradicts the layout is factored as it is.
#[test]
fn nothing_is_condensed_where_the_pattern_is_another() {
    let mut random = Random(6);
    let mut matrix = matrix(8, 4, 2, CONVEX, &mut random);
    matrix.add(matrix.slack(1), 3, 0.3);
    let mut kkt = matrix.kkt();
    assert_eq!(kkt.num_condensed(), 0);
    assert_eq!(matrix.check_inertia(&mut kkt).1, Some(6));
    matrix.check_solve(&mut kkt, &mut random);
}

#[test]
fn wrong_structures_are_refused() {
    let layout = Layout { variables: 2, inequalities: 0, equations: 1 };
    assert_eq!(Kkt::new(layout, &[0, 1], &[0]).err(), Some(Error::Structure));
    assert_eq!(Kkt::new(layout, &[0, 3], &[0, 1]).err(), Some(Error::Structure));
    assert_eq!(Kkt::new(layout, &[u32::MAX], &[0]).err(), Some(Error::Structure));
}

/// The same factors serve one matrix after another, singular ones between.
#[test]
fn factorizations_do_not_remember() {
    let mut random = Random(7);
    let first = matrix(30, 20, 10, CONVEX, &mut random);
    let mut kkt = first.kkt();
    let solve = |kkt: &mut Kkt| {
        let mut x = vec![1.0; first.dimension()];
        assert_eq!(kkt.factor(&first.values), Factored::Regular { negative: 30 });
        kkt.solve(&mut x);
        x
    };
    let before = solve(&mut kkt);
    assert_eq!(kkt.factor(&vec![0.0; first.values.len()]), Factored::Singular);
    assert_eq!(kkt.factor(&vec![f64::NAN; first.values.len()]), Factored::Singular);
    assert_eq!(solve(&mut kkt), before);
}

/// Large ones, whose inertia is known by construction: a convex H and independent equations.
#[test]
fn large_matrices() {
    let mut random = Random(8);
    for (n, inequalities, equations) in [(400, 300, 100), (2000, 1200, 600)] {
        let matrix = matrix(n, inequalities, equations, CONVEX, &mut random);
        let mut kkt = matrix.kkt();
        let expected = Factored::Regular { negative: inequalities + equations };
        assert_eq!(kkt.factor(&matrix.values), expected, "order {}", matrix.dimension());
        assert!(matrix.check_solve(&mut kkt, &mut random) <= 1e-12);
    }
    let matrix = matrix(300, 200, 100, KINDS[1], &mut random);
    let mut kkt = matrix.kkt();
    assert!(matrix.check_inertia(&mut kkt).1.is_some());
}
